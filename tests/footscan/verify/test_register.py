"""One pose from any start, or a finding that says why not.

    FOOTSCAN_FUZZ=200 pytest tests/footscan/verify/test_register.py      200 starts instead of a few
    FOOTSCAN_FUZZ_FIRST=41 FOOTSCAN_FUZZ=1 ...                           start 41 again

A start follows from its number.
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from footscan.mesh.formats.files import Shape, read_mesh
from footscan.mesh.sampling import sample_surface
from footscan.verify.register import Registration, register
from footscan.virtual.foot.foot import FootShape, make_foot
from schemas.base.errors import Finding
from schemas.parameters.registration import RegistrationParameters

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
FEET, TEMPLATES = (3, 2) if ASKED is None else (int(ASKED), int(ASKED))
FURTHEST_MM = 100.0
SAME_MM = 0.02
NO_FACES = np.zeros((0, 3), np.int32)
QUICK = RegistrationParameters(points=1500)


@pytest.fixture(scope="module")
def foot() -> Shape:
    made = make_foot(resolution_mm=3.0)
    return made.vertices, made.faces


@pytest.fixture(scope="module")
def scan() -> Shape:
    """The same foot: other triangles, the leg cut 16 mm lower, noise of 0.1 mm."""
    made = make_foot(replace(FootShape(), scan_height=92.0), resolution_mm=2.5)
    return made.vertices + np.random.default_rng(7).normal(0, 0.1, made.vertices.shape), made.faces


def tee() -> Shape:
    """A body that no turn, and no mirror, brings onto itself: three arms of different lengths on a slab."""
    parts = [
        trimesh.creation.box(bounds=bounds)
        for bounds in (
            ((0, 0, 0), (120, 60, 15)),
            ((0, 0, 15), (20, 20, 55)),
            ((90, 10, 15), (120, 30, 35)),
            ((60, 60, 0), (80, 85, 15)),
        )
    ]
    body = trimesh.util.concatenate(parts)
    return np.asarray(body.vertices), np.asarray(body.faces, np.int32)


def shape(mesh: trimesh.Trimesh) -> Shape:
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)


def cloud(of: Shape, count: int, noise: float = 0.1) -> Shape:
    """Points that share no place with those that registration itself takes from the mesh."""
    rng = np.random.default_rng(count)
    points = rng.permutation(sample_surface(*of, 2 * count + 1))[:count]
    return points + rng.normal(0, noise, points.shape), NO_FACES


def start(number: int) -> np.ndarray:
    """(4, 4) any rotation, and a shift of up to 100 mm in any direction."""
    rng = np.random.default_rng(1000 + number)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.random(rng=rng).as_matrix()
    way = rng.normal(size=3)
    matrix[:3, 3] = rng.uniform(0, FURTHEST_MM) * way / np.linalg.norm(way)
    return matrix


def moved(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def end_of(of: Shape, onto: Shape, number: int, parameters: RegistrationParameters = QUICK) -> np.ndarray:
    """(V, 3) where the vertices come to lie from start `number`."""
    begun = moved(of[0], start(number))
    registration = register((begun, of[1]), onto, parameters)
    assert registration.verdict == "same shape"
    return moved(begun, np.array(registration.transform))


def furthest(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b, axis=1).max())


@pytest.mark.slow
def test_a_foot_from_random_starts_ends_at_one_pose(foot: Shape, scan: Shape) -> None:
    ends = [end_of(scan, foot, number) for number in range(FIRST, FIRST + FEET)]
    assert max(furthest(end, ends[0]) for end in ends) < SAME_MM
    # And that is the true one: noise of 0.1 mm on 3000 points, and facets of 3 mm on one side, 2.5 mm on the other.
    assert furthest(ends[0], scan[0]) < 0.05


def test_a_real_foot_model_from_random_starts_ends_where_it_was() -> None:
    data = os.environ.get("FOOTSCAN_DATA")
    if not data:
        pytest.skip("FOOTSCAN_DATA is not set")
    vertices, faces = read_mesh(Path(data) / "find" / "template.obj")
    template = vertices * 265 / np.ptp(vertices[:, 0]), faces
    for number in range(FIRST, FIRST + TEMPLATES):
        assert furthest(end_of(template, template, number), template[0]) < SAME_MM


def test_a_known_motion_is_undone() -> None:
    start_pose = start(5)
    registration = register((moved(tee()[0], start_pose), tee()[1]), tee(), QUICK)
    np.testing.assert_allclose(np.array(registration.transform), np.linalg.inv(start_pose), atol=1e-4)
    assert (registration.after.rms, registration.after.inliers, registration.after.overlap) == pytest.approx(
        (0, 1, 1), abs=1e-4
    )
    assert registration.before.rms > 10
    assert registration.runner_up is not None
    assert registration.runner_up.rms > 1
    assert 1 <= registration.agreeing <= registration.starts == 504


def test_either_may_be_a_cloud() -> None:
    start_pose = start(6)
    points = cloud(tee(), 4000)
    onto_mesh = register((moved(points[0], start_pose), NO_FACES), tee(), QUICK)
    assert furthest(moved(moved(points[0], start_pose), np.array(onto_mesh.transform)), points[0]) < 0.05
    onto_cloud = register((moved(tee()[0], start_pose), tee()[1]), points, QUICK)
    assert furthest(moved(moved(tee()[0], start_pose), np.array(onto_cloud.transform)), tee()[0]) < 0.05
    for registration in (onto_mesh, onto_cloud):
        assert 0.05 < registration.after.rms < 0.15  # the noise
        assert np.linalg.det(np.array(registration.transform)[:3, :3]) == pytest.approx(1)


def test_a_part_is_brought_onto_the_whole(foot: Shape, scan: Shape) -> None:
    upper = scan[1][scan[0][scan[1]][:, :, 2].min(axis=1) > 12]  # as seen from above: no sole, open
    assert furthest(end_of((scan[0], upper), foot, 3), scan[0]) < 0.05


def test_a_left_foot_is_not_taken_for_a_right_one(foot: Shape) -> None:
    mirrored = foot[0] * [1, -1, 1], foot[1][:, ::-1]
    registration = register(mirrored, foot, QUICK)
    assert registration.verdict == "different shapes"
    assert np.linalg.det(np.array(registration.transform)[:3, :3]) == pytest.approx(1)


def test_doubled_points_change_nothing_much() -> None:
    points = cloud(tee(), 3000)[0]
    doubled = np.concatenate([points, points])
    once, twice = (np.array(register((p, NO_FACES), tee(), QUICK).transform) for p in (points, doubled))
    np.testing.assert_allclose(twice, once, atol=0.01)


@pytest.mark.parametrize(
    ("mesh", "as_cloud"),
    [
        (trimesh.creation.box(extents=(100, 100, 100)), False),
        (trimesh.creation.box(extents=(150, 100, 50)), True),
        (trimesh.creation.icosphere(3, 60), False),
        (trimesh.creation.icosphere(3, 60), True),
        (trimesh.creation.cylinder(40, 200, sections=64), False),
    ],
    ids=["cube", "cloud of a block", "sphere", "cloud of a sphere", "cylinder"],
)
def test_what_lies_on_itself_in_several_ways_is_ambiguous(mesh: trimesh.Trimesh, as_cloud: bool) -> None:
    body = shape(mesh)
    vertices, faces = cloud(body, 2500) if as_cloud else body
    with pytest.raises(Finding, match=r"^ambiguous: .*\d.*expected at least"):
        register((moved(vertices, start(8)), faces), body, QUICK)


NOT_A_NUMBER = np.vstack([sample_surface(*tee(), 200), [[np.nan, 0, 0]]])
GRID = np.stack(np.meshgrid(np.arange(20.0), np.arange(30.0), [0.0]), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (np.zeros((0, 3)), "a cloud of 0 points, expected at least 100"),
        (np.zeros((1, 3)), "a cloud of 1 points, expected at least 100"),
        (NOT_A_NUMBER, "1 of 201 points are no numbers"),
        (np.where(np.isnan(NOT_A_NUMBER), 1e300, NOT_A_NUMBER), "1 of 201 points are no numbers or beyond"),
        (GRID, "is flat, 0 mm thick"),
        (np.tile([[30.0, 40.0, 50.0]], (500, 1)), "is flat, 0 mm thick and 0 mm long"),
        (np.tile(sample_surface(*tee(), 50), (10, 1)), "50 of 500 points are distinct, expected at least 100"),
        (sample_surface(*tee(), 500) / 1000, "shapes of"),
    ],
    ids=["empty", "one point", "nan", "huge", "planar", "one place", "doubled", "metres"],
)
def test_what_cannot_be_registered_is_a_finding(points: np.ndarray, problem: str) -> None:
    for moving, fixed in (((points, NO_FACES), tee()), (tee(), (points, NO_FACES))):
        with pytest.raises(Finding, match=problem) as registration:
            register(moving, fixed)
        assert "\n" not in str(registration.value)


def test_a_plane_and_triangles_without_area_are_findings() -> None:
    flat = shape(trimesh.creation.box(extents=(200, 100, 1e-6)))
    with pytest.raises(Finding, match="fixed: is flat"):
        register(tee(), flat)
    with pytest.raises(Finding, match="moving: a cloud of 3 points"):
        register((np.eye(3), np.array([[0, 0, 1], [1, 1, 1]], np.int32)), tee())


def test_is_a_document_that_can_be_read_back() -> None:
    registration = register((moved(tee()[0], start(9)), tee()[1]), tee(), QUICK)
    assert Registration.model_validate_json(registration.model_dump_json()) == registration


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no way here to take processors away")
def test_the_same_bytes_with_one_processor(tmp_path: Path) -> None:
    points = moved(cloud(tee(), 4000)[0], start(2))
    np.savez(tmp_path / "shapes.npz", points=points, vertices=tee()[0], faces=tee()[1])
    program = (
        "import os, sys; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n"
        "import numpy as np; from footscan.verify.register import register\n"
        "held = np.load(sys.argv[1])\n"
        "cloud = held['points'], np.zeros((0, 3), np.int32)\n"
        "print(register(cloud, (held['vertices'], held['faces'])).model_dump_json())\n"
    )
    alone = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "shapes.npz")],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert alone.stdout.strip() == register((points, NO_FACES), tee()).model_dump_json()

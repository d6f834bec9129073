"""A capture of the reference object, and its chart."""

from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from footscan.virtual.filming.capture import prism, record_capture, visible_corners
from footscan.virtual.filming.stripe_truth import is_lit, is_seen
from footscan.virtual.optics.scanner import HEIGHT, VOLUME_MM, WIDTH, standard_scanner
from footscan.virtual.optics.scene import MATT_GREY, Scene
from footscan.virtual.stage.reference import standard_reference
from schemas.base.yaml_files import read_yaml
from schemas.parameters.simulation import SimulationSettings
from schemas.reference import Capture, ReferenceObject

SETTINGS = SimulationSettings()
SCANNER = standard_scanner(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("capture")
    reference = standard_reference()
    record_capture(
        folder,
        reference.model_copy(update={"placements_mm": reference.placements_mm[:3]}),
        settings=SETTINGS,
        workers=1,
    )
    return folder


def test_capture_follows_the_format(folder: Path) -> None:
    capture = read_yaml(folder / "capture.yaml", Capture)
    reference = read_yaml(folder / capture.reference, ReferenceObject)
    assert reference.placements_mm == standard_reference().placements_mm[:3]
    assert capture.x_mm == 0.0
    for camera in capture.cameras:
        with av.open(folder / camera.file) as film:
            assert film.streams.video[0].frames == 3


def test_chart_is_clicked_near_the_exact_corners(folder: Path) -> None:
    lines = (folder / "chart.csv").read_text().splitlines()
    assert lines[0] == "camera,point,x_mm,y_mm,z_mm,i,j"
    rows = np.array([line.split(",") for line in lines[1:]], dtype=float)
    clicked = rows[:, 5:]
    np.testing.assert_array_equal(clicked * 2, np.rint(clicked * 2))
    exact = np.empty_like(clicked)
    for camera in SCANNER.cameras:
        mine = rows[:, 0] == camera.id
        assert mine.sum() >= 12
        exact[mine] = camera.project_plane(rows[mine, 3], rows[mine, 4])
    assert ((exact >= -0.5) & (exact <= np.array([WIDTH, HEIGHT]) - 0.5)).all()
    error = clicked - exact
    # A click of 0.3 px and rounding to a half, of standard deviation 0.5 / sqrt(12) = 0.144.
    assert error.std() == pytest.approx(np.hypot(0.3, 0.144), rel=0.2)
    assert np.abs(error).max() < 1.6


def test_corners_that_can_be_clicked() -> None:
    # A box 40 mm wide and 30 mm high: each upper camera sees its own flank and the top, each lower one the bottom.
    box = np.array([[-20.0, 0.0], [20.0, 0.0], [20.0, 30.0], [-20.0, 30.0]])
    visible = visible_corners(SCANNER, box, SETTINGS)
    for camera in (1, 2):
        np.testing.assert_array_equal(visible[camera], [False, True, True, True])
    for camera in (3, 4):
        np.testing.assert_array_equal(visible[camera], [True, False, True, True])
    for camera in (5, 6):
        np.testing.assert_array_equal(visible[camera], [True, True, True, False])
    for camera in (7, 8):
        np.testing.assert_array_equal(visible[camera], [True, True, False, True])
    backwards = visible_corners(SCANNER, box[::-1], SETTINGS)
    for camera_id, seen in visible.items():
        np.testing.assert_array_equal(backwards[camera_id], seen[::-1])


def test_all_placements_stand_on_the_glass_or_above() -> None:
    reference = standard_reference()
    assert len(reference.placements_mm) == 10
    assert reference.placements_mm[0] == [0, 0]
    assert min(z for _, z in reference.profile_mm) == 0.0
    assert all(dz >= 0.0 for _, dz in reference.placements_mm)


def test_reference_covers_the_volume() -> None:
    reference = standard_reference()
    corners: dict[int, list[NDArray[np.float64]]] = {camera.id: [] for camera in SCANNER.cameras}
    for placement in reference.placements_mm:
        profile = np.asarray(reference.profile_mm) + np.asarray(placement)
        for camera_id, seen in visible_corners(SCANNER, profile, SETTINGS).items():
            corners[camera_id].append(profile[seen])
    for camera_id, parts in corners.items():
        y, z = np.concatenate(parts).T
        left = camera_id in (1, 2, 5, 6)
        outward = y if left else -y
        assert outward.max() >= 70.0
        assert outward[z < 0.1].max() >= 50.0
        assert len(y) >= 40
        if camera_id <= 4:
            assert z.max() >= 110.0


def test_five_placements_cover_most_of_it() -> None:
    """The stripe over the first five, which is more than their corners, against that over all ten, in the volume."""
    reference = standard_reference()
    stripes = [stripe_seen(np.asarray(reference.profile_mm) + place) for place in reference.placements_mm]
    for camera in SCANNER.cameras:
        seen = [stripe[camera.id] for stripe in stripes]
        five = np.concatenate(seen[:5])
        assert hull_within_the_volume(five) >= 0.85 * hull_within_the_volume(np.concatenate(seen))
        outward = five[:, 0] if camera.id in (1, 2, 5, 6) else -five[:, 0]
        assert outward.max() >= 70.0
        assert outward[five[:, 1] < 1.0].max() >= 49.0
        assert five[:, 1].max() >= (113.0 if camera.id <= 4 else 80.0)


def hull_within_the_volume(points: NDArray[np.float64]) -> float:
    """Area of the convex hull of those of `points` (N, 2) that lie in the scan volume, mm2."""
    low, high = np.array(VOLUME_MM).T
    return float(ConvexHull(points[((points >= low) & (points <= high)).all(axis=1)]).volume)


def stripe_seen(profile: NDArray[np.float64]) -> dict[int, NDArray[np.float64]]:
    """For each camera (N, 2) Y and Z of the lit profile that it sees, a mm apart; corners counter-clockwise."""
    ways = np.roll(profile, -1, axis=0) - profile
    lengths = np.linalg.norm(ways, axis=1)
    units = ways / lengths[:, np.newaxis]
    along = [np.arange(0.5, length)[:, np.newaxis] for length in lengths]
    on_profile = np.concatenate([c + a * u for c, a, u in zip(profile, along, units, strict=True)])
    counts = [len(part) for part in along]
    points = np.column_stack([np.zeros(len(on_profile)), on_profile])
    normals = np.repeat(np.column_stack([np.zeros(len(units)), units[:, 1], -units[:, 0]]), counts, axis=0)
    scene = Scene(prism(profile), MATT_GREY)
    lit = is_lit(scene, SCANNER, 0.0, points, normals, SETTINGS)
    return {camera.id: on_profile[lit & is_seen(scene, camera, 0.0, points, normals)] for camera in SCANNER.cameras}

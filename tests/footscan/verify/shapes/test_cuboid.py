from itertools import product

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.mesh.sampling import sample_surface
from footscan.verify.shapes.cuboid import fit_cuboid
from footscan.verify.shapes.stripe_ends import Sights
from footscan.virtual.foot.foot import make_foot
from schemas.base.errors import Finding
from schemas.fits import CuboidFit, CuboidParameters, FaceFit

Floats = NDArray[np.float64]
Face = tuple[int, int]

SIZE = (150.0, 100.0, 50.0)
FACES = tuple(product(range(3), range(2)))
WITHOUT_BOTTOM = tuple(face for face in FACES if face != (2, 0))


def striped(
    size: tuple[float, float, float] = SIZE,
    turn: Rotation | None = None,
    middle: tuple[float, float, float] = (75.3, 0.0, 25.0),
    faces: tuple[Face, ...] = FACES,
    spacing: float = 0.5,
) -> Floats:
    """Where the planes X = 0, 2, 4 ... mm cut the faces of a cuboid: points 0.5 mm apart along straight lines."""
    axes = (turn or Rotation.identity()).as_matrix().T
    points = [np.zeros((0, 3))]
    for axis, side in faces:
        b, c = (k for k in range(3) if k != axis)
        corner = np.array(middle) + (side - 0.5) * size[axis] * axes[axis] - (size[b] * axes[b] + size[c] * axes[c]) / 2
        slope = np.array([axes[b][0], axes[c][0]])  # of X over the face's own coordinates
        steepness = np.linalg.norm(slope)
        if steepness < 1e-9:
            continue
        up, along = slope / steepness, np.array([-slope[1], slope[0]]) / steepness
        reach = size[b] + size[c]
        run = np.arange(-reach, reach, spacing)
        x_range = corner[0] + np.array([0.0, slope[0] * size[b], slope[1] * size[c], slope @ [size[b], size[c]]])
        for x in np.arange(2 * np.ceil(x_range.min() / 2), x_range.max(), 2.0):
            own = (x - corner[0]) / steepness * up + run[:, None] * along
            own = own[((own >= 0) & (own <= [size[b], size[c]])).all(axis=1)]
            points.append(corner + own[:, :1] * axes[b] + own[:, 1:] * axes[c])
    return np.concatenate(points)


def noisy(points: Floats, sigma: float, outliers: int = 0) -> Floats:
    """`points` with noise across and along the stripe, X apart, and some that are anywhere."""
    random = np.random.default_rng(5)
    moved = points + random.normal(0, sigma, points.shape) * [0, 1, 1]
    low, high = points.min(axis=0) - 15, points.max(axis=0) + 15
    stray = random.uniform(low, high, (outliers, 3))
    stray[:, 0] = 2 * np.round(stray[:, 0] / 2)
    return np.concatenate([moved, stray])


def values(fit: CuboidFit) -> list[float | None]:
    return [dimension.value_mm for dimension in fit.dimensions]


def face(fit: CuboidFit, name: str) -> FaceFit:
    [found] = [found for found in fit.faces if found.name == name]
    return found


POSES = {
    "askew": Rotation.from_euler("z", 20, degrees=True),
    "far askew": Rotation.from_euler("z", -41, degrees=True),
    "across": Rotation.from_euler("z", 90 - 17, degrees=True),
    "tilted": Rotation.from_euler("zyx", [12, 8, -5], degrees=True),
    "on its edge": Rotation.from_euler("xyz", [44, 15, 10], degrees=True),
}


@pytest.mark.parametrize("pose", POSES)
def test_a_perfect_block_in_any_pose(pose: str) -> None:
    fit = fit_cuboid(striped(turn=POSES[pose]))
    assert sorted(value or 0 for value in values(fit)) == pytest.approx([50, 100, 150], abs=1e-6)
    assert sorted(dimension.free_mm or 0 for dimension in fit.dimensions) == pytest.approx([50, 100, 150], abs=1e-6)
    assert [dimension.ends for dimension in fit.dimensions] == [("faces", "faces")] * 3
    assert {angle.faces: angle.degrees for angle in fit.angles} == pytest.approx(
        {angle.faces: 0.0 if angle.faces in OPPOSITE else 90.0 for angle in fit.angles}, abs=1e-5
    )
    assert len(fit.angles) == 15
    assert all(found.rms_mm < 1e-6 and found.outliers == 0 for found in fit.faces)
    assert fit.stripe_step_mm == pytest.approx(2)
    np.testing.assert_allclose(np.array(fit.axes) @ np.array(fit.axes).T, np.eye(3), atol=1e-12)


OPPOSITE = {("back", "front"), ("right", "left"), ("bottom", "top")}


@pytest.mark.parametrize("pose", POSES)
def test_noise_and_outliers(pose: str) -> None:
    points = striped(turn=POSES[pose])
    fit = fit_cuboid(noisy(points, 0.1, outliers=len(points) // 20))
    found = sorted((dimension.value_mm or 0, dimension.uncertainty_mm or 0) for dimension in fit.dimensions)
    for (value, uncertainty), true in zip(found, (50, 100, 150), strict=True):
        assert abs(value - true) < 4 * uncertainty < 0.08
    for found_face in fit.faces:
        across_face = 0.1 * np.hypot(found_face.normal[1], found_face.normal[2])  # there is no noise along X
        assert found_face.rms_mm == pytest.approx(across_face, rel=0.05)
        assert found_face.max_mm < 4.5 * across_face
        assert found_face.outliers > 0


def test_a_block_square_to_the_travel_ends_between_stripes() -> None:
    # From X = 0.3 to 150.3 it meets the stripes 2 to 150. Its ends lie within 0 to 2 and 150 to 152: 150 long, by
    # chance, each end with the standard deviation 2 / sqrt(12) of a uniform distribution.
    fit = fit_cuboid(noisy(striped(), 0.1), CuboidParameters(sheet_mm=(0, 0)))
    along = fit.dimensions[0]
    assert along.ends == ("stripes", "stripes")
    assert along.value_mm == pytest.approx(150, abs=0.01)
    assert along.uncertainty_mm == pytest.approx(2 / np.sqrt(6), abs=0.01)
    assert along.free_mm is None
    # 149.5 mm meet as many stripes.
    shorter = fit_cuboid(noisy(striped((149.5, 100, 50)), 0.1), CuboidParameters(sheet_mm=(0, 0)))
    assert shorter.dimensions[0].value_mm == pytest.approx(150, abs=0.01)
    # What stripes see well does not suffer.
    assert values(fit)[1:] == pytest.approx([100, 50], abs=0.02)


def test_cameras_that_see_stripes_displaced_tell_more_of_the_ends() -> None:
    # The light of a sheet with a standard deviation of 0.4 mm. Both ends stand 0.3 mm, 0.75 standard deviations, beyond
    # a stripe, and cut it: phi(0.75) / Phi(0.75) = 0.3011 / 0.7734. They stand 1.7 mm before the next one.
    points = striped((148.6, 100, 50), middle=(76, 0, 25), faces=FACES[2:])
    centres = {
        1: np.array([210.0, 180.0, 200.0]),
        2: np.array([-170.0, 150.0, 190.0]),
        3: np.array([200.0, -190.0, 90.0]),
    }
    lit = points.copy()
    lit[points[:, 0] > 149, 0] -= 0.4 * 0.3011 / 0.7734
    lit[points[:, 0] < 3, 0] += 0.4 * 0.3011 / 0.7734
    seen, camera = [], []
    for number, centre in centres.items():
        # Along the ray from the camera, which travels along, through the light to the plane that it is taken to lie in.
        stands = points * [1.0, 0.0, 0.0] + centre
        share = (points[:, 0] - stands[:, 0]) / (lit[:, 0] - stands[:, 0])
        before = (points[:, 2] > 49.9) | (points[:, 1] * centre[1] > 0)  # the faces that it sees
        seen.append((stands + share[:, None] * (lit - stands))[before & (points[:, 2] > 0.1)])
        camera.append(np.full(len(seen[-1]), number))
    sights = Sights(np.concatenate(seen), np.concatenate(camera), centres)
    parameters = CuboidParameters(sheet_mm=(0.4, 0.4))
    alone = fit_cuboid(points, parameters).dimensions[0]
    along = fit_cuboid(points, parameters, sights).dimensions[0]
    assert along.ends == alone.ends == ("stripes", "stripes")
    assert along.value_mm == pytest.approx(148.6, abs=0.1)
    assert (along.uncertainty_mm or 0) < 0.25 * (alone.uncertainty_mm or 0)


@pytest.mark.parametrize("degrees", [0.4, 0.8, 1.3])
def test_slightly_askew_the_ends_are_known_better(degrees: float) -> None:
    points = striped(turn=Rotation.from_euler("z", degrees, degrees=True), faces=FACES[2:])
    along = fit_cuboid(points, CuboidParameters(sheet_mm=(0, 0))).dimensions[0]
    unseen = max(2 - 100 * np.sin(np.radians(degrees)), 0) * np.cos(np.radians(degrees))
    assert along.uncertainty_mm == pytest.approx(unseen / np.sqrt(6), abs=0.02)
    assert abs((along.value_mm or 0) - 150) < unseen + 0.1


def test_a_stripe_or_two_on_an_end_tell_its_place() -> None:
    # At 1.3 degrees an end is 100 sin 1.3 = 2.3 mm deep in X: one or two stripes run down it, too few for a plane.
    points = striped(turn=Rotation.from_euler("z", 1.3, degrees=True))
    fit = fit_cuboid(points)
    assert fit.dimensions[0].ends == ("faces", "faces")
    assert fit.dimensions[0].value_mm == pytest.approx(150, abs=1e-3)


@pytest.mark.parametrize(("floor", "height"), [(0.0, 50.0), (-1.25, 51.25)])
def test_a_bottom_that_nothing_sees_is_the_floor(floor: float, height: float) -> None:
    points = striped(turn=POSES["askew"], faces=WITHOUT_BOTTOM)
    points = points[points[:, 2] > 4]  # nor the flanks just above the glass
    fit = fit_cuboid(points, CuboidParameters(floor_mm=floor))
    assert fit.dimensions[2].ends == ("floor", "faces")
    assert fit.dimensions[2].value_mm == pytest.approx(height, abs=1e-6)
    assert values(fit)[:2] == pytest.approx([150, 100], abs=1e-6)


def test_a_block_that_leans_has_no_height_above_the_floor() -> None:
    fit = fit_cuboid(striped(turn=Rotation.from_euler("zy", [20, 5], degrees=True), faces=WITHOUT_BOTTOM))
    height = fit.dimensions[2]
    assert (height.value_mm, height.uncertainty_mm, height.ends) == (None, None, (None, "faces"))
    assert height.note == "the place of its bottom is unknown"
    assert values(fit)[:2] == pytest.approx([150, 100], abs=1e-6)


def test_three_faces_suffice() -> None:
    fit = fit_cuboid(striped(turn=POSES["askew"], faces=((0, 1), (1, 1), (2, 1))))
    assert [found.name for found in fit.faces] == ["front", "left", "top"]
    assert fit.dimensions[1].note == "the place of its right is unknown"
    assert fit.dimensions[2].value_mm == pytest.approx(50, abs=1e-6)


def test_part_of_a_face_suffices() -> None:
    points = striped(turn=POSES["tilted"])
    fit = fit_cuboid(points[(points[:, 0] < 90) | (points[:, 1] < 20)])  # a corner is gone
    assert sorted(value or 0 for value in values(fit)) == pytest.approx([50, 100, 150], abs=1e-5)


def test_rounded_edges_are_left_out() -> None:
    turn = POSES["askew"].as_matrix()
    own = (striped(turn=POSES["askew"]) - [75.3, 0, 25]) @ turn
    # Edges with 2.5 mm radius: what lies outside of the rounded body is drawn in onto it.
    core = np.clip(own, -np.array(SIZE) / 2 + 2.5, np.array(SIZE) / 2 - 2.5)
    way = own - core
    rounded = (core + 2.5 * way / np.linalg.norm(way, axis=1, keepdims=True)) @ turn.T + [75.3, 0, 25]
    fit = fit_cuboid(rounded, CuboidParameters(edge_mm=3))
    assert values(fit) == pytest.approx([150, 100, 50], abs=1e-5)
    assert face(fit, "top").outliers == 0 < face(fit, "top").edge_points
    # Where edges are no edges, the rounded rim of 2.5 mm is off the face: 2.5 x 500 mm², with a point each.
    assert face(fit_cuboid(rounded, CuboidParameters(edge_mm=0)), "top").outliers > 1000


def test_a_face_out_of_square_shows_in_the_angles() -> None:
    turn = POSES["askew"]
    points = striped(turn=turn)
    own = (points - [75.3, 0, 25]) @ turn.as_matrix()
    left = own[:, 1] > 49.999
    own[left, 1] += np.tan(np.radians(0.5)) * own[left, 2]  # leans outward by half a degree
    fit = fit_cuboid(own @ turn.as_matrix().T + [75.3, 0, 25])
    angles = {angle.faces: angle.degrees for angle in fit.angles}
    assert angles["left", "top"] == pytest.approx(89.5, abs=1e-4)
    assert angles["left", "bottom"] == pytest.approx(90.5, abs=1e-4)
    assert angles["right", "left"] == pytest.approx(0.5, abs=1e-4)
    assert fit.dimensions[1].value_mm == pytest.approx(100, abs=0.01)


def test_a_mesh() -> None:
    mesh = trimesh.creation.box(extents=(80.0, 60.0, 30.0))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0.2, 0.1, 1.0], [5, 6, 7]))
    fit = fit_cuboid(sample_surface(mesh.vertices, mesh.faces, 40_000))
    assert values(fit) == pytest.approx([80, 60, 30], abs=1e-6)
    assert fit.stripe_step_mm is None
    assert fit.off_points == 0


def test_doubles_and_order_change_nothing() -> None:
    points = noisy(striped(turn=POSES["tilted"]), 0.1, 500)
    shuffled = np.random.default_rng(1).permutation(np.concatenate([points, points[::3]]))
    assert fit_cuboid(shuffled) == fit_cuboid(points)


def test_what_is_no_cuboid_is_told() -> None:
    nothing = np.zeros((0, 3))
    line = np.column_stack([np.linspace(0, 99, 1000), np.zeros((1000, 2))])
    plane = striped(faces=((2, 1),))
    sphere = trimesh.creation.icosphere(radius=50.0)
    foot = make_foot()
    for points, problem in [
        (nothing, "0 distinct points"),
        (np.ones((1, 3)), "1 distinct points"),
        (np.ones((5000, 3)), "1 distinct points"),
        (line, "expected a cuboid"),
        (plane, "no two faces at a right angle"),
        (striped(faces=((2, 0), (2, 1))), "no two faces at a right angle"),
        (np.full((200, 3), np.nan), "no numbers"),
        (np.random.default_rng(1).uniform(0, 100, (20_000, 3)), "cuboid"),
        (sample_surface(sphere.vertices, sphere.faces, 30_000), "cuboid"),
        (sample_surface(foot.vertices, foot.faces, 30_000), "cuboid"),
    ]:
        with pytest.raises(Finding, match=problem) as caught:
            fit_cuboid(points)
        assert "\n" not in str(caught.value)

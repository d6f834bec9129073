import tracemalloc

import numpy as np
import pytest
import trimesh

from footscan.mesh.formats.files import Shape
from footscan.mesh.mesh import Mesh
from footscan.verify import compare as compare_module
from footscan.verify import distances
from footscan.verify.compare import apart_mm, cloud_normals, compare, moved, vertex_distances
from footscan.verify.regions import foot_regions
from footscan.virtual.foot.foot import make_foot
from schemas.base.errors import RefusedInput

NOTHING = np.zeros((0, 3), np.int32)


def box(size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(extents=(size, size, size))
    return np.asarray(mesh.vertices) + np.array(centre), np.asarray(mesh.faces, np.int32)


def test_a_cloud_by_hand() -> None:
    heights = np.arange(101) * 0.1  # distances 0, 0.1 .. 10 mm above the box
    cloud = np.column_stack([np.zeros(101), np.zeros(101), 5 + heights])
    result = compare((cloud, NOTHING), box(10.0))
    assert result.mean == pytest.approx(5.0, abs=1e-5)
    assert result.signed_mean == pytest.approx(5.0, abs=1e-5)
    assert (result.min, result.max) == pytest.approx((0.0, 10.0), abs=1e-5)
    assert (result.p50, result.p90, result.p95, result.p99) == pytest.approx((5.0, 9.0, 9.5, 9.9), abs=1e-5)
    # Uniform steps: variance (n² - 1) / 12 steps².
    assert result.std == pytest.approx(0.1 * np.sqrt((101**2 - 1) / 12), abs=1e-5)
    assert result.rms == pytest.approx(np.hypot(result.mean, result.std), abs=1e-5)
    assert result.transform is None


def test_a_mesh_is_sampled_by_its_area_not_by_its_vertices() -> None:
    vertices, faces = box(10.0)
    # The bottom, 10 mm below, subdivided: most vertices are there, and a sixth of the area is.
    fine = trimesh.Trimesh(vertices, faces, process=False)
    bottom = np.flatnonzero(fine.triangles_center[:, 2] < -4.9)
    vertices, faces = trimesh.remesh.subdivide(vertices, faces, bottom)
    result = compare((vertices + np.array([0, 0, 1.0]), faces), box(10.0))
    # The top is 1 mm outside; of the sides the uppermost mm is, by 0.5 mm on average. The bottom is 1 mm inside, less
    # where a side is nearer: 100 less the integral of (1 - d) 4 (10 - 2 d) over d from 0 to 1.
    outside, inside = 100 + 4 * 10 * 0.5, 100 - 4 * (10 - 6 + 2 / 3)
    assert result.mean == pytest.approx((outside + inside) / 600, rel=0.01)
    assert result.signed_mean == pytest.approx((outside - inside) / 600, rel=0.03)


def test_a_cloud_to_a_cloud() -> None:
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(10.0), np.arange(10.0)))
    plane = np.column_stack([x, y, np.zeros(100)])
    upward = np.tile([0.0, 0, 1], (100, 1))
    above = plane + np.array([0.4, 0, 0.3])
    unsigned = compare((above, NOTHING), (plane, NOTHING), classes=8)
    assert unsigned.mean == pytest.approx(0.5)
    assert unsigned.signed_mean is None
    assert [classes.signed for classes in unsigned.histograms] == [False]
    signed = compare((above, NOTHING), (plane, NOTHING), normals_b=-upward, classes=8)
    assert (signed.mean, signed.signed_mean) == pytest.approx((0.5, -0.3))
    assert (signed.signed_std, signed.signed_min, signed.signed_max) == pytest.approx((0, -0.3, -0.3), abs=1e-6)
    assert [classes.signed for classes in signed.histograms] == [False, True]


def test_a_mesh_to_a_cloud_and_the_other_way() -> None:
    # The cloud is the lower half of the box's bottom: what is there of it lies on the box, but little of the box is.
    vertices, faces = box(10.0)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-5, 5.1, 0.1), np.arange(-5, 0.01, 0.1)))
    cloud = np.column_stack([x, y, np.full(len(x), -5.0)]), NOTHING
    comparison = compare(cloud, (vertices, faces), both=True)
    assert comparison.max == pytest.approx(0, abs=1e-5)
    assert comparison.completeness is not None
    assert comparison.completeness.points == 200_000
    # Within 1 mm: half of the bottom and 1 mm of it beyond, 1 mm of one side, and that of two sides along half their
    # length, with a quarter of a circle at the end.
    area = 50 + 10 + 10 + 2 * (5 + np.pi / 4)
    assert comparison.completeness.within_share == pytest.approx(area / 600, rel=0.01)
    assert comparison.completeness.max == pytest.approx(np.hypot(10, 5), rel=0.01)
    back = compare((vertices, faces), cloud)
    assert back.model_dump(exclude={"unit", "transform", "histograms", "completeness"}) == {
        **comparison.completeness.model_dump(exclude={"within_mm", "within_share"})
    }


def test_regions_are_parts_of_the_whole() -> None:
    foot = make_foot(resolution_mm=2.0)
    shifted = foot.vertices + np.array([0.0, 0, 0.2]), foot.faces
    comparison = compare(shifted, (foot.vertices, foot.faces), both=True)
    assert [region.region for region in comparison.regions] == ["sole", "heel", "midfoot", "ball", "toes", "ankle"]
    counts = [region.points or 0 for region in comparison.regions]
    assert sum(counts) == comparison.points == 200_000
    means = [region.mean for region in comparison.regions]
    assert np.average(means, weights=counts) == pytest.approx(comparison.mean)
    assert max(region.max for region in comparison.regions) == comparison.max
    # Lifted by 0.2 mm, a surface moves out by 0.2 mm times the rise of its normal.
    mesh = trimesh.Trimesh(foot.vertices, foot.faces, process=False)
    regions = foot_regions((foot.vertices, foot.faces))
    assert regions is not None
    region_of = regions.of(mesh.triangles_center)
    for row, region in enumerate(comparison.regions):
        rise = np.average(mesh.face_normals[region_of == row, 2], weights=mesh.area_faces[region_of == row])
        assert region.signed_mean == pytest.approx(0.2 * rise, abs=0.01), region.region
    assert comparison.completeness is not None
    assert len(comparison.completeness.regions) == 6
    assert compare(box(10.0), box(9.0)).regions == []


def test_the_same_at_every_call() -> None:
    a, b = box(10.0), box(9.0, (0.3, 0.2, 0.1))
    assert compare(a, b, classes=70, both=True) == compare(a, b, classes=70, both=True)


def test_a_mesh_of_one_part_in_another_place() -> None:
    assert apart_mm(box(2.0), box(2.0, (10.0, 0, 0))) == 8
    assert apart_mm(box(2.0), box(2.0, (5.0, 6.0, 1.0))) == 5
    assert apart_mm(box(2.0), box(2.0, (1.9, 0, 0))) == 0


def test_what_is_moved_beforehand() -> None:
    vertices, faces = box(10.0)
    normals = vertices / np.sqrt(75)
    turned = moved(Mesh(vertices, faces, normals), [[0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 5], [0, 0, 0, 1]])
    assert compare((turned.vertices, turned.faces), box(10.0, (3.0, 4.0, 5.0))).max == pytest.approx(0, abs=1e-5)
    assert turned.normals is not None
    np.testing.assert_allclose(turned.normals, (turned.vertices - [3, 4, 5]) / np.sqrt(75), atol=1e-12)
    assert moved(Mesh(vertices, faces), np.eye(4).tolist()).normals is None


def test_normals_of_a_cloud_count_where_all_are_unit_vectors() -> None:
    points, upward = np.zeros((3, 3)), np.tile([0.0, 0, 1], (3, 1))
    faces = np.array([[0, 1, 2]], np.int32)
    assert cloud_normals(Mesh(points, NOTHING, upward)) is upward
    assert cloud_normals(Mesh(points, NOTHING)) is None
    assert cloud_normals(Mesh(points, faces, upward)) is None
    for length in (0.0, 0.5, np.nan, np.inf):
        spoiled = upward.copy()
        spoiled[1] *= length if np.isfinite(length) else 1
        spoiled[1, 2] = length
        assert cloud_normals(Mesh(points, NOTHING, spoiled)) is None


def test_distances_of_vertices() -> None:
    assert vertex_distances(box(10.0), box(8.0)).signed == pytest.approx(np.full(8, np.sqrt(3)))


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [
        ((np.zeros((0, 3)), NOTHING), box(1.0), "shape: is empty"),
        (box(1.0), (np.zeros((0, 3)), NOTHING), "reference: is empty"),
        ((np.zeros((4, 3)), np.array([[0, 1, 2]])), box(1.0), "shape: has no triangle with"),
        (box(1.0), (np.zeros((4, 3)), np.array([[0, 1, 2]])), "reference: has no triangle with"),
        (box(1.0), (np.zeros((1, 3)), NOTHING), "reference: is a single point"),
        ((np.ones((9, 3)), NOTHING), box(1.0), "shape: is a single point"),
        ((np.full((9, 3), np.nan), NOTHING), box(1.0), "shape: holds coordinates that are no numbers"),
        ((box(1.0)[0] * np.nan, box(1.0)[1]), box(1.0), "shape: holds coordinates that are no numbers"),
        (box(1.0), (box(1.0)[0] * np.inf, box(1.0)[1]), "reference: holds a coordinate of inf"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(a: Shape, b: Shape, told: str) -> None:
    with pytest.raises(RefusedInput, match=told):
        compare(a, b, both=True)


@pytest.mark.parametrize(
    "cloud",
    [
        np.array([[0.0, 0, 8]]),
        np.tile([0.0, 0, 8], (50, 1)),
        np.random.default_rng(0).random((99, 3)) * [1, 1, 0] + [0, 0, 8],
    ],
    ids=["one point", "doubled", "planar"],
)
def test_odd_clouds_have_their_distances(cloud: np.ndarray) -> None:
    comparison = compare((cloud, NOTHING), box(10.0), classes=70)
    assert (comparison.mean, comparison.std, comparison.p99, comparison.signed_mean) == pytest.approx((3, 0, 3, 3))
    assert sum(comparison.histograms[0].counts) == len(cloud)


@pytest.mark.parametrize("to_cloud", [False, True], ids=["to a mesh", "to a cloud"])
def test_memory_grows_by_few_bytes_a_point(to_cloud: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the two shapes: what all distances and their percentiles need, and for a cloud the order of its tree."""
    monkeypatch.setattr(distances, "BLOCK", 2000)  # what blocks need would hide what points need
    monkeypatch.setattr(compare_module, "CHUNK", 2000)
    few, many = 50_000, 150_000
    cloud = np.random.default_rng(0).uniform(-5, 5, (many, 3))
    compare((cloud[:100], NOTHING), box(10.0), classes=70)  # what is imported late is no part of it
    peaks = []
    for count in (few, many):
        reference = (cloud[::-1][:count].copy(), NOTHING) if to_cloud else box(10.0)
        tracemalloc.start()
        compare((cloud[:count], NOTHING), reference, classes=70)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    bytes_a_point = (peaks[1] - peaks[0]) / (many - few)
    assert 8 < bytes_a_point < 16 + 8 * to_cloud

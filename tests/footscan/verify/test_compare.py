import numpy as np
import pytest
import trimesh

from footscan.verify.compare import compare, distances, signed_distances
from schemas.errors import RefusedInput

NOTHING = np.zeros((0, 3), np.int32)


def box(size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(extents=(size, size, size))
    return np.asarray(mesh.vertices) + np.array(centre), np.asarray(mesh.faces, np.int32)


def test_distances_by_hand() -> None:
    points = np.array([[0.0, 0, 0], [0, 0, 7], [5, 5, 5], [8, 9, 5], [4, 0, 0]])
    np.testing.assert_allclose(signed_distances(points, box(10.0)), [-5, 2, 0, 5, -1], atol=1e-5)
    np.testing.assert_allclose(distances(points, box(10.0)), [5, 2, 0, 5, 1], atol=1e-5)


def test_far_from_the_origin_nothing_is_lost() -> None:
    centre = (1e5, -2e5, 3e5)
    points = np.array(centre) + np.array([[0.0, 0, 5.001], [0, 0, 4.999]])
    np.testing.assert_allclose(signed_distances(points, box(10.0, centre)), [0.001, -0.001], atol=2e-6)


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


def test_the_orientation_of_faces_does_not_decide_what_is_inside() -> None:
    vertices, faces = box(10.0)
    assert signed_distances(np.zeros((1, 3)), (vertices, faces[:, ::-1]))[0] == pytest.approx(-5.0)


def test_the_same_at_every_call_and_across_blocks() -> None:
    a, b = box(10.0), box(9.0, (0.3, 0.2, 0.1))
    assert compare(a, b) == compare(a, b)


def test_an_empty_shape_is_refused() -> None:
    with pytest.raises(RefusedInput, match="expected"):
        compare((np.zeros((1, 3)), NOTHING), (np.zeros((0, 3)), NOTHING))
    with pytest.raises(RefusedInput, match="expected"):
        compare((np.zeros((0, 3)), NOTHING), box(1.0))

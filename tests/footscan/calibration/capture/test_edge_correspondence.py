"""Names of four pieces of the stripe: which can be, and the maps they make."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.calibration.capture.edge_correspondence import can_be_seen, facing_names, is_view, misfits, named_maps
from footscan.calibration.capture.reference import Edges, edges_of, nearest_edge

Floats = NDArray[np.float64]
STEPS = [[-60, 0], [60, 0], [60, 20], [35, 40], [20, 75], [-10, 75], [-30, 50], [-60, 25]]


@pytest.fixture
def edges() -> Edges:
    return edges_of(STEPS)


def test_names_face_one_camera(edges: Edges) -> None:
    square = edges_of([[0, 0], [10, 0], [10, 10], [0, 10]])
    names = facing_names(square)
    # one, two or, of three neighbours, none: opposite edges never face one camera
    assert all(abs(a - b) != 2 for row in names.tolist() for a in row for b in row)
    assert len(names) == 4 * (2**4 - 2) + 4  # two neighbours, both named; or a single edge
    for row in facing_names(edges)[::97]:
        seen = np.isin(np.arange(len(edges.length)), row)
        assert can_be_seen(edges, seen)


def test_edges_on_one_line_have_one_name() -> None:
    notch = edges_of([[0, 0], [50, 0], [50, 40], [30, 40], [30, 20], [20, 20], [20, 40], [0, 40]])
    assert len(np.unique(facing_names(notch))) == 7


def seen(camera: Any, edges: Edges, names: list[int], shifts: Floats) -> tuple[Floats, Floats]:
    """Lines and ends of edges in the image of a pinhole, the object shifted by `shifts` (4, 2)."""
    inverse = np.linalg.inv(camera.to_plane())
    lines, ends = [], []
    for name, shift in zip(names, shifts, strict=True):
        plane = np.column_stack([np.array([edges.start[name], edges.end[name]]) + shift, np.ones(2)])
        image = plane @ inverse.T
        a, b = image[:, :2] / image[:, 2:]
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
        lines.append([*normal, normal @ a])
        ends += [a, b]
    return np.array(lines), np.array(ends)


def true_ones(maps: Floats, camera: Any) -> NDArray[np.bool_]:
    truth = camera.to_plane() / camera.to_plane()[2, 2]
    return np.asarray(np.abs(maps - truth).max(axis=(1, 2), initial=0.0) < 1e-6 * np.abs(truth).max())


def test_the_true_names_make_the_true_map_and_it_fits_best(pinhole: Any, edges: Edges) -> None:
    camera, still = pinhole(target_mm=(10.0, 40.0)), np.zeros((4, 2))
    lines, ends = seen(camera, edges, [2, 3, 4, 5], still)
    maps = named_maps(facing_names(edges), lines, ends, np.zeros(4, np.intp), still, edges)
    assert true_ones(maps, camera).sum() == 1
    inner = ends[::2] + np.linspace(0.2, 0.8, 4)[:, np.newaxis] * (ends[1::2] - ends[::2])
    misfit = misfits(maps, inner, still, edges, 4.0)
    assert misfit[true_ones(maps, camera)] == pytest.approx([0.0], abs=1e-6)
    assert true_ones(maps, camera)[misfit.argmin()]


def test_a_frame_names_an_edge_once_but_two_frames_may_share_it(pinhole: Any, edges: Edges) -> None:
    camera, shifts = pinhole(target_mm=(10.0, 40.0)), np.array([(0, 0), (0, 0), (30, 10), (30, 10)], float)
    lines, ends = seen(camera, edges, [2, 4, 2, 4], shifts)
    # parallel pairs: any three of the four lines still span the plane
    two = named_maps(facing_names(edges), lines, ends, np.array([0, 0, 1, 1]), shifts, edges)
    same_frame = named_maps(facing_names(edges), lines, ends, np.array([0, 0, 0, 0]), shifts, edges)
    assert true_ones(two, camera).any()
    assert not true_ones(same_frame, camera).any()


def test_what_no_camera_shows_is_no_view() -> None:
    pixels = np.array([[0.0, 0.0], [600.0, 0.0], [600.0, 400.0], [0.0, 400.0]])
    assert is_view(np.diag([0.3, 0.3, 1.0]), pixels)
    assert not is_view(np.diag([3.0, 0.3, 1.0]), pixels)  # 3 mm to the pixel
    assert not is_view(np.diag([0.3, 0.001, 1.0]), pixels)
    assert not is_view(np.array([[0.3, 0, 0], [0, 0.3, 0], [-1 / 300, 0, 1]]), pixels)  # a horizon in the picture
    assert not is_view(np.full((3, 3), np.nan), pixels)


def test_misfit_is_the_distance_from_the_nearest_edge(edges: Edges) -> None:
    random = np.random.default_rng(2)
    pixels, shift = random.uniform(0, 300, (50, 2)), random.uniform(-5, 5, (50, 2))
    matrix = np.diag([0.3, 0.3, 1.0])
    points = 0.3 * pixels - shift
    index, off, along = nearest_edge(edges, points)
    beyond = np.maximum(np.maximum(-along, along - edges.length[index]), 0.0)
    expected = np.mean(np.minimum(np.hypot(off, beyond), 7.0))
    assert misfits(matrix[np.newaxis], pixels, shift, edges, 7.0) == pytest.approx([expected])

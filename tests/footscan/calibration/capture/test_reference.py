"""Edges of a reference object."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from footscan.calibration.capture.reference import edges_of, nearest_edge, placement_doubts

Floats = NDArray[np.float64]

NOTCHED = [[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [20.0, 30.0], [20.0, 10.0], [0.0, 10.0]]
"""An L: 40 mm wide, its foot 10 mm high, a column of 20 x 30 mm on the right."""


@pytest.mark.parametrize("profile", [NOTCHED, NOTCHED[::-1]], ids=["as it is", "backwards"])
def test_edges_run_counter_clockwise_and_their_normals_point_out(profile: list[list[float]]) -> None:
    edges = edges_of(profile)
    first = int(np.flatnonzero((edges.start == [0, 0]).all(axis=1))[0])
    order = np.roll(np.arange(6), -first)
    np.testing.assert_array_equal(edges.start[order], NOTCHED)
    np.testing.assert_array_equal(edges.end[order], NOTCHED[1:] + NOTCHED[:1])
    np.testing.assert_array_equal(edges.normal[order], [[0, -1], [1, 0], [0, 1], [-1, 0], [0, 1], [-1, 0]])
    np.testing.assert_array_equal(edges.offset[order], [0, 40, 30, -20, 10, 0])
    np.testing.assert_array_equal(edges.length[order], [40, 30, 20, 20, 20, 10])


def test_a_slanted_edge() -> None:
    # A triangle of sides 3, 4, 5, ten times: the hypotenuse runs from (40, 0) to (0, 30).
    edges = edges_of([[0, 0], [40, 0], [0, 30]])
    np.testing.assert_allclose(edges.normal[1], [0.6, 0.8], atol=1e-15)
    assert edges.offset[1] == pytest.approx(24.0)  # the height over the hypotenuse, 30 * 40 / 50
    assert edges.length[1] == pytest.approx(50.0)


def test_edges_in_one_line_are_joined() -> None:
    # One corner more in the middle of a side, two in another, and the first corner is none.
    profile = [[20, 0], [40, 0], [40, 10.1], [40, 20.3], [40, 30], [0, 30], [0, 0]]
    edges = edges_of(profile)
    np.testing.assert_array_equal(edges.start, [[40, 0], [40, 30], [0, 30], [0, 0]])
    np.testing.assert_array_equal(edges.length, [40 - 10, 40, 30, 40])


def test_nearest_edges_of_single_points() -> None:
    edges = edges_of(NOTCHED)
    points = np.array(
        [
            [10.0, -3.0],  # below the bottom
            [10.0, 1.0],  # inside, above the bottom
            [43.0, 5.0],  # right of the column
            [18.0, 25.0],  # in the notch, beside the column
            [5.0, 12.0],  # over the foot
            [50.0, -1.0],  # beyond a corner: the line of the right side is nearer than the corner
            [-2.0, 4.0],  # left
        ]
    )
    index, distance, along = nearest_edge(edges, points)
    np.testing.assert_array_equal(np.delete(index, 5), [0, 0, 1, 3, 4, 5])
    np.testing.assert_allclose(np.delete(distance, 5), [3, -1, 3, 2, 2, 2])
    np.testing.assert_allclose(np.delete(along, 5), [10, 10, 5, 5, 15, 6])
    corner = {0: (1.0, 50.0), 1: (10.0, -1.0)}[int(index[5])]
    assert (distance[5], along[5]) == pytest.approx(corner)


def test_a_point_that_is_not_finite_has_no_distance() -> None:
    index, distance, along = nearest_edge(edges_of(NOTCHED), np.array([[np.nan, 0.0], [np.inf, 1.0], [10.0, -1.0]]))
    assert ((index >= 0) & (index < 6)).all()
    assert np.isnan(distance[0])
    assert not np.isfinite(distance[:2]).any()
    assert not np.isfinite(along[0])
    assert distance[2] == 1.0


def test_no_points() -> None:
    assert [part.shape for part in nearest_edge(edges_of(NOTCHED), np.empty((0, 2)))] == [(0,)] * 3


@given(
    seed=st.integers(0, 2**32 - 1),
    radii=st.lists(st.floats(10.0, 200.0), min_size=3, max_size=15),
    count=st.sampled_from([1, 7, 1024, 1025, 2500]),
)
def test_as_found_point_by_point(seed: int, radii: list[float], count: int) -> None:
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    edges = edges_of(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]).tolist())
    points = np.random.default_rng(seed).uniform(-250.0, 250.0, (count, 2))
    index, distance, along = nearest_edge(edges, points)
    to_each = np.array([_distances(a, b, points) for a, b in zip(edges.start, edges.end, strict=True)])
    np.testing.assert_allclose(to_each[index, np.arange(count)], to_each.min(axis=0), atol=1e-9)
    feet = edges.start[index] + (along / edges.length[index])[:, np.newaxis] * (edges.end - edges.start)[index]
    np.testing.assert_allclose(feet + distance[:, np.newaxis] * edges.normal[index], points, atol=1e-9)


def test_strided_points_and_single_ones_give_the_same() -> None:
    edges = edges_of(NOTCHED)
    points = np.random.default_rng(3).uniform(-50.0, 80.0, (3000, 2))
    whole = nearest_edge(edges, points)
    for part, same in zip(whole, nearest_edge(edges, np.asfortranarray(points)), strict=True):
        np.testing.assert_array_equal(part, same)
    for part, same in zip(whole, nearest_edge(edges, points[2999:]), strict=True):
        assert part[2999] == same[0]


def _distances(start: Floats, end: Floats, points: Floats) -> Floats:
    """(N,) from each point to the piece of line: the foot of the perpendicular, held between the ends."""
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, np.newaxis] * way, axis=1))


def test_an_object_in_the_glass_or_far_off_is_doubted() -> None:
    square = [[-50, 0], [50, 0], [50, 90], [-50, 90]]
    assert placement_doubts(square, [[0, 0], [40, 14]]) == []
    assert placement_doubts(square, [[0, 0], [0, -3]]) == [
        "placement 1 reaches down to Z = -3 mm, below the glass at 0"
    ]
    assert placement_doubts(square, [[500, 0]]) == ["placement 0 reaches out to 550 mm, far from where feet stand"]

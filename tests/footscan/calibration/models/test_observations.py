"""Observations: two for a control point, one for a point of the stripe."""

import numpy as np

from footscan.calibration.models.observations import Observations, of_points

PIXELS = np.array([[30.0, 10.0], [10.0, 20.0], [20.0, 5.0]])
WORLD = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])


def test_control_points() -> None:
    observations = of_points(PIXELS, WORLD, np.array([7, 7, 8]))
    assert (len(observations), observations.independent, observations.points) == (6, 6, 3)
    np.testing.assert_array_equal(observations.pixels, np.concatenate([PIXELS, PIXELS]))
    np.testing.assert_array_equal(observations.normals, [[1, 0]] * 3 + [[0, 1]] * 3)
    assert observations.offsets.tolist() == [1, 3, 5, 2, 4, 6]
    assert observations.group.tolist() == [7, 7, 8, 7, 7, 8]


def test_errors_of_y_and_z_are_one_distance() -> None:
    observations = of_points(PIXELS, WORLD, np.arange(3))
    distances = observations.distances(np.array([3.0, 0.0, -5.0, 4.0, -2.0, 12.0]))
    np.testing.assert_allclose(distances, [5, 2, 13], rtol=1e-15)


def test_part_keeps_what_belongs_together() -> None:
    observations = of_points(PIXELS, WORLD, np.array([0, 1, 1]))
    part = observations.part(observations.group == 1)
    assert (part.points, part.independent) == (2, 4)
    assert part.offsets.tolist() == [3, 5, 4, 6]
    # numbers are kept, and a distance is that of the part's own points
    assert part.point.tolist() == [1, 2, 1, 2]
    np.testing.assert_allclose(part.distances(np.array([3.0, 0.0, 4.0, 1.0])), [5, 1], rtol=1e-15)


def test_sorted_is_the_same_for_every_order() -> None:
    observations = of_points(PIXELS, WORLD, np.arange(3))
    generator = np.random.default_rng(1)
    first = observations.sorted()
    assert first.pixels[:, 0].tolist() == [10, 10, 20, 20, 30, 30]
    for _ in range(10):
        again = observations.part(generator.permutation(6)).sorted()
        for name in ("pixels", "normals", "offsets", "point", "block", "group"):
            np.testing.assert_array_equal(getattr(again, name), getattr(first, name))


def test_a_block_counts_once() -> None:
    stripe = Observations(
        pixels=np.column_stack([np.arange(10.0), np.zeros(10)]),
        normals=np.tile([0.0, 1.0], (10, 1)),
        offsets=np.zeros(10),
        point=np.arange(10),
        block=np.arange(10) // 4,
        group=np.zeros(10, np.intp),
    )
    assert (len(stripe), stripe.points, stripe.independent) == (10, 10, 3)


def test_errors_of_a_control_point_are_its_own_and_those_of_an_edge_lie_across_it() -> None:
    chart = of_points(np.array([[1.0, 2.0], [3.0, 4.0]]), np.zeros((2, 2)), np.arange(2))
    pixels, errors = chart.errors(np.array([0.1, 0.2, -0.3, 0.4]))  # Y of both, then Z of both
    np.testing.assert_allclose(pixels, [[1, 2], [3, 4]])
    np.testing.assert_allclose(errors, [[0.1, -0.3], [0.2, 0.4]], atol=1e-12)

    slanted = np.array([0.6, 0.8])
    edge = Observations(
        np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0]]),
        np.tile(slanted, (3, 1)), np.zeros(3), np.arange(3), np.array([0, 0, 1]), np.zeros(3, np.intp),
    )  # fmt: skip
    pixels, errors = edge.errors(np.array([1.0, 3.0, 5.0]))
    np.testing.assert_allclose(pixels, [[1, 0], [9, 9]])
    np.testing.assert_allclose(errors, [2 * slanted, 5 * slanted], atol=1e-12)

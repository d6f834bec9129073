import numpy as np
import pytest

from footscan.cloud.fusion.motion import MOST_TERMS
from footscan.cloud.fusion.pair_least_squares import INDEPENDENT, PRIOR_MM, Forms, solve, squares, sum_up

CAMERAS, STRETCHES = 3, 4
RANDOM = np.random.default_rng(5)
COUNT = 400
ROWS = RANDOM.normal(size=(COUNT, MOST_TERMS))
DISTANCES = RANDOM.normal(size=COUNT)
WEIGHTS = RANDOM.uniform(1, 1000, COUNT)
PAIRS = np.array([RANDOM.permutation(CAMERAS)[:2] for _ in range(COUNT)])
STRETCH = RANDOM.integers(0, STRETCHES, COUNT)


def forms() -> Forms:
    return sum_up(ROWS, DISTANCES, WEIGHTS, np.full(COUNT, 0.5), PAIRS, STRETCH, STRETCHES, CAMERAS)


def left(coefficients: np.ndarray) -> np.ndarray:
    """The residual of each comparison under the coefficients."""
    apart = coefficients[PAIRS[:, 0]] - coefficients[PAIRS[:, 1]]
    return np.asarray(DISTANCES - np.sum(ROWS * apart, axis=1))


def test_squares_are_those_of_all_comparisons() -> None:
    coefficients = RANDOM.normal(size=(CAMERAS, MOST_TERMS))
    found = squares(forms(), coefficients, np.ones(STRETCHES, np.bool_))
    weighted = WEIGHTS * left(coefficients) ** 2
    for n in range(STRETCHES):
        assert found[n].sum() == pytest.approx(weighted[n == STRETCH].sum())
        assert forms().expected[n].sum() == pytest.approx(0.5 * WEIGHTS[n == STRETCH].sum())
        mine = (n == STRETCH) & (np.sort(PAIRS, axis=1) == [0, 2]).all(axis=1)
        assert found[n, 0, 2] == pytest.approx(weighted[mine].sum())


def test_the_solution_is_that_of_least_squares() -> None:
    terms = np.array([3, 0, 12])
    stretches = np.array([True, False, True, True])
    found = solve(forms(), stretches, terms)
    free = np.flatnonzero((np.arange(MOST_TERMS) < terms[:, np.newaxis]).ravel())
    design = np.zeros((COUNT, CAMERAS, MOST_TERMS))
    design[np.arange(COUNT), PAIRS[:, 0]] += ROWS
    design[np.arange(COUNT), PAIRS[:, 1]] -= ROWS
    use = stretches[STRETCH]
    root = np.sqrt(INDEPENDENT * WEIGHTS[use])
    rows = np.concatenate([design.reshape(COUNT, -1)[use][:, free] * root[:, np.newaxis], np.eye(len(free)) / PRIOR_MM])
    expected = np.linalg.lstsq(rows, np.concatenate([DISTANCES[use] * root, np.zeros(len(free))]))[0]
    np.testing.assert_allclose(found.ravel()[free], expected, rtol=1e-8)
    assert np.count_nonzero(found) == 15


def test_what_pairs_leave_open_is_held_to_nothing() -> None:
    found = solve(forms(), np.ones(STRETCHES, np.bool_), np.full(CAMERAS, 3))
    np.testing.assert_allclose(found.sum(axis=0), 0.0, atol=1e-6)

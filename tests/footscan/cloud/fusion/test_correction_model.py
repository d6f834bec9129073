import numpy as np

from footscan.cloud.fusion.correction_model import STRETCHES, choose_terms, hold_the_middle
from footscan.cloud.fusion.motion import MOST_TERMS
from footscan.cloud.fusion.pair_least_squares import Forms, sum_up

CAMERAS = 4
ENOUGH = np.ones(CAMERAS, np.bool_)


def compared(truth: np.ndarray, noise: float = 0.02) -> Forms:
    """4000 comparisons of all pairs whose cameras stand off by the coefficients (4, 12)."""
    random = np.random.default_rng(8)
    count = 4000
    pairs = np.array([random.permutation(CAMERAS)[:2] for _ in range(count)])
    rows = random.uniform(-1, 1, (count, MOST_TERMS))
    distances = np.sum(rows * (truth[pairs[:, 0]] - truth[pairs[:, 1]]), axis=1) + random.normal(0, noise, count)
    variances = np.full(count, noise**2)
    return sum_up(
        rows, distances, 1 / variances, variances, pairs, random.integers(0, STRETCHES, count), STRETCHES, CAMERAS
    )


def off(**terms: float) -> np.ndarray:
    """Coefficients by camera and term: c1t2 is the third of the second camera."""
    truth = np.zeros((CAMERAS, MOST_TERMS))
    for name, coefficient in terms.items():
        camera, term = name[1:].split("t")
        truth[int(camera), int(term)] = coefficient
    return truth


def test_noise_moves_no_camera() -> None:
    assert choose_terms(compared(off()), ENOUGH, 0.0).tolist() == [0, 0, 0, 0]


def test_each_camera_gets_the_terms_that_it_needs() -> None:
    assert choose_terms(compared(off(c1t2=0.1)), ENOUGH, 0.02).tolist() == [0, 3, 0, 0]
    assert choose_terms(compared(off(c2t0=-0.1, c2t4=0.1)), ENOUGH, 0.02).tolist() == [0, 0, 6, 0]
    assert choose_terms(compared(off(c3t9=0.15)), ENOUGH, 0.02).tolist() == [0, 0, 0, 12]


def test_what_is_too_small_or_too_little_seen_stays() -> None:
    assert choose_terms(compared(off(c1t2=0.1)), ENOUGH, 0.2).tolist() == [0, 0, 0, 0]
    few = np.array([True, False, True, True])
    assert choose_terms(compared(off(c1t2=0.1)), few, 0.02)[1] == 0


def test_the_middle_of_all_motions_is_taken_off() -> None:
    coefficients, terms = off(c0t0=0.1, c1t0=0.3, c2t0=0.2), np.array([3, 3, 3, 0])
    before = coefficients.copy()
    hold_the_middle(coefficients, terms, ENOUGH)
    assert terms.tolist() == [3, 3, 3, 3]
    np.testing.assert_allclose(np.diff(coefficients, axis=0), np.diff(before, axis=0), atol=1e-12)
    assert np.count_nonzero(coefficients[:, 0] > 0) == np.count_nonzero(coefficients[:, 0] < 0) == 2


def test_where_most_stay_they_all_do() -> None:
    coefficients, terms = off(c0t0=0.1), np.array([3, 0, 0, 0])
    hold_the_middle(coefficients, terms, ENOUGH)
    np.testing.assert_array_equal(coefficients, off(c0t0=0.1))
    assert terms.tolist() == [3, 0, 0, 0]

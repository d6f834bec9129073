import numpy as np
import pytest
from scipy.sparse import csr_array

from footscan.measure.quantity import Quantity, combined

LENGTH = Quantity(100.0, np.array([0.5, 0.5, 0.0]), "a doubt")
BREADTH = Quantity(40.0, np.array([0.0, 0.0, 2.0]))


def test_independent_errors_add_by_their_squares() -> None:
    assert LENGTH.sd(np.array([0.3, 0.4, 9.0])) == pytest.approx(0.25)
    assert BREADTH.sd(np.full(3, 0.1)) == pytest.approx(0.2)


def test_vertices_share_errors() -> None:
    errors, shares = np.array([0.3, 0.4, 9.0]), csr_array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    assert LENGTH.sd(errors, shares) == pytest.approx(0.5 * 0.3 + 0.5 * 0.4)
    assert Quantity(0.0, np.array([1.0, -1.0, 0.0])).sd(np.ones(3), shares) == 0.0


def test_a_difference_has_the_errors_and_doubts_of_both() -> None:
    difference = LENGTH.minus(BREADTH)
    assert difference.value == 60.0
    assert difference.doubt == "a doubt"
    assert difference.sd(np.array([0.3, 0.4, 0.1])) == pytest.approx(np.hypot(0.25, 0.2))


def test_common_errors_cancel() -> None:
    assert LENGTH.minus(LENGTH).sd(np.ones(3)) == 0.0


def test_a_ratio_by_its_derivatives() -> None:
    ratio = combined(0.4, (1 / 100, BREADTH), (-0.4 / 100, LENGTH))
    np.testing.assert_allclose(ratio.gradient, [-0.002, -0.002, 0.02])


def test_how_far_it_rests_on_filled_surface() -> None:
    assert LENGTH.share(np.array([True, False, True])) == 0.5
    assert BREADTH.share(np.array([True, True, False])) == 0.0
    assert Quantity(1.0, np.zeros(3)).share(np.ones(3, np.bool_)) == 0.0


def test_what_is_not_known_has_no_standard_deviation() -> None:
    unknown = Quantity(1.0, np.array([np.nan, 0.0, 0.0]))
    assert unknown.sd(np.ones(3)) is None
    assert combined(2.0, (1.0, LENGTH), (0.0, unknown)).sd(np.ones(3)) is None

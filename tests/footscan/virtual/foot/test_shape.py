"""The sampler against ANSUR II's printed table."""

import numpy as np
import pytest

from footscan.virtual.foot.shape import FootShape, sample_pair, sample_shape

N = 300
# Mean and standard deviation, mm.
MEN = {"foot_length": (271.2, 13.1), "ball_length": (200.9, 10.5), "foot_breadth": (101.9, 5.2),
       "heel_breadth": (72.5, 5.5), "ball_girth": (252.0, 12.9), "ankle_girth": (229.3, 14.6),
       "ankle_breadth": (74.8, 4.1), "malleolus_height": (72.9, 5.7), "instep_height": (68.0, 5.0),
       "arch_height": (14.0, 4.0), "hallux_height": (24.0, 2.5)}  # fmt: skip
WOMEN = {"foot_length": (246.3, 12.4), "ball_length": (182.1, 9.6), "foot_breadth": (92.7, 4.8),
         "heel_breadth": (67.2, 5.2), "ball_girth": (228.1, 11.8), "ankle_girth": (215.7, 14.9),
         "ankle_breadth": (67.0, 3.5), "malleolus_height": (62.7, 5.1), "instep_height": (61.0, 4.0),
         "arch_height": (12.5, 4.0), "hallux_height": (22.0, 2.0)}  # fmt: skip


def values(shapes: list[FootShape], name: str) -> np.ndarray:
    return np.array([getattr(shape, name) for shape in shapes])


@pytest.mark.parametrize(("sex", "table"), [("male", MEN), ("female", WOMEN)])
def test_draws_follow_the_table(sex: str, table: dict[str, tuple[float, float]]) -> None:
    rng = np.random.default_rng(20)
    shapes = [sample_shape(rng, "male" if sex == "male" else "female") for _ in range(N)]
    for name, (mean, deviation) in table.items():
        drawn = values(shapes, name)
        assert drawn.mean() == pytest.approx(mean, abs=3.3 * deviation / np.sqrt(N)), name
        assert drawn.std(ddof=1) == pytest.approx(deviation, rel=3.3 / np.sqrt(2 * N)), name
        assert np.abs(drawn - mean).max() <= 3 * deviation, name
    breadth, girth, length = (values(shapes, name) for name in ("foot_breadth", "ball_girth", "foot_length"))
    # Standard error of a correlation r: (1 - r^2) / sqrt(n).
    assert np.corrcoef(breadth, girth)[0, 1] == pytest.approx(0.87, abs=0.06)
    assert np.corrcoef(length, girth)[0, 1] == pytest.approx(0.60, abs=0.13)
    assert np.corrcoef(length, values(shapes, "arch_height"))[0, 1] == pytest.approx(0.0, abs=0.2)


def test_left_and_right_differ_as_published() -> None:
    rng = np.random.default_rng(21)
    pairs = [sample_pair(rng, "male") for _ in range(N)]
    differences = np.array([left.foot_length - right.foot_length for left, right in pairs])
    assert differences.mean() == pytest.approx(-0.37, abs=3.3 * 3.05 / np.sqrt(N))
    assert differences.std(ddof=1) == pytest.approx(3.05, rel=3.3 / np.sqrt(2 * N))
    ratio = [left.ball_length / left.foot_length - right.ball_length / right.foot_length for left, right in pairs]
    assert np.abs(ratio).max() < 1e-12


def test_a_seed_draws_the_same_foot() -> None:
    assert sample_shape(np.random.default_rng(3), "female") == sample_shape(np.random.default_rng(3), "female")


def test_longest_toe_is_the_first_or_the_second() -> None:
    rng = np.random.default_rng(22)
    toes = np.array([sample_shape(rng, "male").toe_lengths for _ in range(N)])
    np.testing.assert_array_equal(toes[:, :2].max(axis=1), 1.0)
    assert np.mean(toes[:, 0] == 1.0) == pytest.approx(0.75, abs=3.3 * np.sqrt(0.75 * 0.25 / N))

"""The parameters of a foot, and their distribution over the population."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

Sex = Literal["male", "female"]


@dataclass(frozen=True)
class FootShape:
    """The measures of a foot; lengths in mm. The default is the mean man of ANSUR II at 0.966 of his size."""

    foot_length: float = 262.0
    """Pternion to the tip of the longest toe, parallel to the axis pternion - tip of toe 2."""
    ball_length: float = 194.0
    """X of metatarsale tibiale."""
    lateral_ball_length: float = 167.5
    """X of metatarsale fibulare."""
    foot_breadth: float = 98.5
    """Y from metatarsale fibulare to metatarsale tibiale."""
    ball_girth: float = 243.5
    """Tape around the vertical plane through both metatarsal points."""
    heel_breadth: float = 70.0
    """Largest width within 0.10 to 0.20 of the length."""
    instep_height: float = 65.7
    """Highest point above the floor at half the length."""
    arch_height: float = 13.5
    """Largest height of the sole within 0.30 to 0.60 of the length, a third of the width from the medial edge."""
    hallux_height: float = 23.2
    """Highest point of the section 12.5 mm behind the tip of toe 1."""
    toe_lengths: tuple[float, float, float, float, float] = (1.0, 0.985, 0.952, 0.910, 0.858)
    """X of the tips of toes 1 to 5 as parts of the foot length; the largest is 1, and is that of toe 1 or 2."""
    toe_gap: float = 1.8
    """Between neighbouring toe pads."""
    ankle_breadth: float = 72.0
    """About the width over the malleoli."""
    ankle_girth: float = 221.5
    """About the girth of the leg above the malleoli."""
    malleolus_height: float = 70.0
    """Z of the lateral malleolus; the medial one is 0.03 of the foot length higher."""
    scan_height: float = 108.0
    """Where the leg is cut flat; the scan volume is 114 mm high."""
    ankle_swelling: float = 0.0
    """How far the malleoli stand out more than usual."""
    hammer_toes: float = 0.0
    """Rise of the small toes' knuckles, as a part of twice their height."""
    missing_toes: tuple[int, ...] = ()
    """Numbers of the toes, 1 to 5, that are missing."""
    amputated_at: float | None = None
    """Part of the length at which the forefoot ends."""


DRAWN = (
    "foot_length", "ball_length", "foot_breadth", "heel_breadth", "ball_girth", "ankle_girth", "ankle_breadth",
    "malleolus_height", "instep_height", "arch_height", "hallux_height",
)  # fmt: skip
# Means and standard deviations, mm: ANSUR II (US Army, 2012; 4,082 men and 1,986 women), computed from its raw table.
# The last three are not in ANSUR: defaults from the literature, of low confidence.
MEANS = {
    "male": (271.2, 200.9, 101.9, 72.5, 252.0, 229.3, 74.8, 72.9, 68.0, 14.0, 24.0),
    "female": (246.3, 182.1, 92.7, 67.2, 228.1, 215.7, 67.0, 62.7, 61.0, 12.5, 22.0),
}
DEVIATIONS = {
    "male": (13.1, 10.5, 5.2, 5.5, 12.9, 14.6, 4.1, 5.7, 5.0, 4.0, 2.5),
    "female": (12.4, 9.6, 4.8, 5.2, 11.8, 14.9, 3.5, 5.1, 4.0, 4.0, 2.0),
}
# ANSUR II's correlations with the foot length and, measured or by way of the ball girth, of pairs; the instep height's
# are assumed. A pair that is not named gets the product of its correlations with the length.
WITH_LENGTH = (1.0, 0.93, 0.59, 0.48, 0.60, 0.49, 0.60, 0.33, 0.30, 0.0, 0.0)
PAIRS = {
    ("foot_breadth", "ball_girth"): 0.87, ("ball_girth", "ankle_girth"): 0.68,
    ("foot_breadth", "ankle_girth"): 0.59, ("ball_girth", "heel_breadth"): 0.47, ("ball_girth", "instep_height"): 0.50,
}  # fmt: skip
LEFT_LONGER = {"male": (-0.37, 3.05), "female": (-0.05, 3.05)}  # left - right, mean and sd, from SATRA 2018 (n = 2,890)
LEFT_DEVIATIONS = {"foot_breadth": 1.8, "ball_girth": 4.0, "instep_height": 2.0}
HALLUX_LONGEST = 0.75  # part of the population; toe 2 is the longest of the others


def sample_shape(rng: np.random.Generator, sex: Sex) -> FootShape:
    """A right foot drawn from the population: normal with the figures above, drawn again if one is over 3 sd away.

    Length is then clipped to 200..320 mm and breadth to 75..125 mm, so every foot fits the scan volume of 140 x 114 x
    380 mm as it is: nothing is scaled, the leg is always cut at 108 mm.
    """
    deviations = np.array(DEVIATIONS[sex])
    covariance = _correlations() * np.outer(deviations, deviations)
    drawn = _within_three_sd(rng, np.array(MEANS[sex]), covariance)
    values = dict(zip(DRAWN, drawn.tolist(), strict=True))
    values["foot_length"] = float(np.clip(values["foot_length"], 200.0, 320.0))
    values["foot_breadth"] = float(np.clip(values["foot_breadth"], 75.0, 125.0))
    lateral = values["foot_length"] * float(np.clip(rng.normal(0.64, 0.008), 0.62, 0.66))
    return FootShape(**values, lateral_ball_length=lateral, toe_lengths=_draw_toes(rng))


def sample_pair(rng: np.random.Generator, sex: Sex) -> tuple[FootShape, FootShape]:
    """The (left, right) feet of one person; their differences are drawn independently of each other, within 3 sd."""
    right = sample_shape(rng, sex)
    mean, deviation = LEFT_LONGER[sex]
    names = ("foot_length", *LEFT_DEVIATIONS)
    sizes = np.array([deviation, *LEFT_DEVIATIONS.values()])
    change = _within_three_sd(rng, np.array([mean, 0.0, 0.0, 0.0]), np.diag(sizes**2))
    left = {name: getattr(right, name) + step for name, step in zip(names, change.tolist(), strict=True)}
    scale = left["foot_length"] / right.foot_length
    left |= {name: scale * getattr(right, name) for name in ("ball_length", "lateral_ball_length")}
    return replace(right, **left), right


def _correlations() -> npt.NDArray[np.float64]:
    matrix = np.outer(WITH_LENGTH, WITH_LENGTH)
    for (one, other), value in PAIRS.items():
        a, b = DRAWN.index(one), DRAWN.index(other)
        matrix[a, b] = matrix[b, a] = value
    np.fill_diagonal(matrix, 1.0)
    return matrix


def _within_three_sd(
    rng: np.random.Generator, mean: npt.NDArray[np.float64], covariance: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    while True:
        drawn = rng.multivariate_normal(mean, covariance, method="cholesky").round(6)  # mm; BLAS differs far behind
        if np.all(np.abs(drawn - mean) <= 3 * np.sqrt(np.diag(covariance))):
            return drawn


def _draw_toes(rng: np.random.Generator) -> tuple[float, float, float, float, float]:
    hallux_longest = rng.random() < HALLUX_LONGEST
    shorter = 1.0 - rng.uniform(0.003, 0.025)
    first, second = (1.0, shorter) if hallux_longest else (shorter, 1.0)
    third, fourth, fifth = (np.array([0.952, 0.910, 0.858]) + rng.uniform(-0.008, 0.008)).tolist()
    return first, second, third, fourth, fifth

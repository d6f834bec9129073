"""The tips of the toes, separated by the outline of the forefoot seen from above.

All functions take a right foot in its own frame: mm, toes towards +X, medial side towards +Y.
"""

from collections.abc import Collection, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from footscan.measure.landmarks.extreme import Floats, Point, Summit, highest_of_each, summit
from footscan.mesh.rigid_transform import points_within

FOREFOOT = 0.74
"""Share of the length ahead of which the toes lie; chosen by hand."""
STRIP_MM = 1.0
"""Breadth of the strips along X in which the outline is taken."""
PROMINENCE_MM = 0.6
"""Least distance of a tip ahead of the cleft beside it; chosen by hand."""
SPACING_MM = 5.0
"""Least distance of two tips; chosen by hand."""
CLEFT = 0.12
"""Surface farther behind the curve of the tips than this share of the length belongs to no tip; chosen by hand."""
DEPTH_MM = 1.0
"""Depth of the cap that is fitted to a tip; chosen by hand."""
TOES = (1, 2, 3, 4, 5)
ACROSS = (0.23, 0.465, 0.625, 0.775, 0.93)
"""Usual places of the tips as shares of the way from the first to the fifth metatarsal's side. With `AHEAD` they number
the toes if not all five are seen. Chosen by hand."""
AHEAD = (1.0, 0.985, 0.95, 0.91, 0.86)
"""Usual places of the tips as shares of the length; chosen by hand."""
ACROSS_SCATTER, AHEAD_SCATTER = 0.08, 0.03
"""Usual scatter of these places; chosen by hand."""
MISSED = 4.0
"""Cost of a tip that gets no number, in scatters from a toe's place; chosen by hand."""


class ToeTips(NamedTuple):
    """The foremost points of the toes."""

    tips: dict[int, Summit]
    """Tips of the toes that were separated, by the number of the toe, 1 to 5."""
    is_whole: bool
    """True if five toes were seen; otherwise their numbers are inferred from their places."""


def toe_tips(
    dense: Floats,
    points: Floats,
    length: float,
    low: float,
    sides: tuple[float, float],
    wanted: Collection[int] = TOES,
) -> ToeTips:
    """Find the tips of the toes.

    Parameters
    ----------
    dense : (M, 3) mm, points of the surface, dense enough that each strip of `STRIP_MM` holds some
    points : (N, 3) mm, points of the surface by which tips are placed; denser ones would pull them inwards on large
        triangles
    length : mm, of the foot
    low : mm, height below which there is no leg
    sides : mm, Y of the heads of the first and fifth metatarsal
    wanted : numbers of the toes whose tips are computed
    """
    outline, toes = (points_within(of, x=(FOREFOOT * length, np.inf), z=(-np.inf, low)) for of in (dense, points))
    if not len(outline):
        return ToeTips({}, False)
    peaks = sorted(_peaks(outline, length, sides), key=lambda peak: -float(peak[0][1]))
    numbers = _numbers([peak for peak, _, _ in peaks], length, sides)
    tips = {number: _placed(toes, *peaks[k]) for number, k in numbers.items() if number in wanted}
    return ToeTips(tips, len(peaks) == len(TOES))


def _placed(toes: Floats, peak: Point, left: float, right: float) -> Summit:
    """The tip between two clefts at Y = `left` and `right`."""
    window = ((left, right), (-np.inf, np.inf))
    tip = summit(points_within(toes, y=(left, right)), 0, 1, window, DEPTH_MM)
    # The foremost place of a toe that points aside lies beside its tip.
    return Summit(peak, 0.0, True) if tip is None or tip.at_border else tip


def tip_near(points: Floats, tip: Point) -> Summit | None:
    """The tip of a toe that was at `tip` before the foot was turned a little; None without surface."""
    near = np.all(np.abs(points - tip) < 2 * SPACING_MM, axis=1)
    window = ((float(tip[1]) - SPACING_MM / 2, float(tip[1]) + SPACING_MM / 2), (-np.inf, np.inf))
    return summit(points[near], 0, 1, window, DEPTH_MM)


def _peaks(toes: Floats, length: float, sides: tuple[float, float]) -> list[tuple[Point, float, float]]:
    """Returns each peak of the outline above the curve of the tips, and Y of the clefts beside it."""
    medial, lateral = sides
    curve = np.interp((medial - toes[:, 1]) / (medial - lateral), ACROSS, AHEAD)
    rise = toes[:, 0] - curve * length
    toes, rise = toes[rise > -CLEFT * length], rise[rise > -CLEFT * length]
    if not len(toes):  # no surface is near the curve of the tips: a long lump stretches the length
        return []
    lowest = float(toes[:, 1].min())
    strip = 1 + ((toes[:, 1] - lowest) / STRIP_MM).astype(np.intp)
    foremost = highest_of_each(strip, rise, int(strip.max()) + 2)
    seen = np.flatnonzero(foremost >= 0)
    outline = np.interp(np.arange(len(foremost)), seen, rise[foremost[seen]])
    outline[[0, -1]] = -CLEFT * length
    smooth = np.convolve(np.pad(outline, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    peaks = []
    for k in _prominent(smooth):
        nearest = seen[np.argmin(np.abs(seen - k))]
        right, left = (lowest + (_cleft(smooth, k, step) - 0.5) * STRIP_MM for step in (-1, 1))
        peaks.append((toes[foremost[nearest]], right, left))
    return peaks


def _prominent(outline: Floats) -> list[int]:
    """Returns the places of peaks that rise `PROMINENCE_MM` above the saddle towards a higher one."""
    peaks: list[int] = []
    for k in np.argsort(-outline, kind="stable").tolist():
        if not (0 < k < len(outline) - 1 and outline[k] >= max(outline[k - 1], outline[k + 1])):
            continue
        if all(
            abs(k - other) * STRIP_MM >= SPACING_MM
            and outline[min(k, other) : max(k, other) + 1].min() <= outline[k] - PROMINENCE_MM
            for other in peaks
        ):
            peaks.append(k)
    return sorted(peaks)


def _cleft(outline: Floats, peak: int, step: int) -> int:
    """Lowest place of the outline, followed from a peak, before it rises by `PROMINENCE_MM`."""
    lowest = place = peak
    while 0 <= place < len(outline):
        if outline[place] < outline[lowest]:
            lowest = place
        if outline[place] > outline[lowest] + PROMINENCE_MM:
            break
        place += step
    return lowest


def _numbers(tips: list[Point], length: float, sides: tuple[float, float]) -> Mapping[int, int]:
    """Returns, by the number of the toe, which of the tips (sorted from the medial side) it is."""
    if len(tips) == len(TOES):
        return dict(zip(TOES, range(len(TOES)), strict=True))
    medial, lateral = sides
    misplaced = np.array(
        [
            [
                abs((medial - tip[1]) / (medial - lateral) - across) / ACROSS_SCATTER
                + abs(tip[0] / length - ahead) / AHEAD_SCATTER
                for across, ahead in zip(ACROSS, AHEAD, strict=True)
            ]
            for tip in tips[: 2 * len(TOES)]
        ]
    )
    best: dict[int, int] = {}
    least = np.inf
    for count in range(min(len(misplaced), len(TOES)) + 1):
        for toes in combinations(range(len(TOES)), count):
            for chosen in combinations(range(len(misplaced)), count):
                cost = sum(misplaced[k, toe] for k, toe in zip(chosen, toes, strict=True))
                cost += MISSED * (len(misplaced) - count)
                if cost < least:
                    least, best = cost, {toe + 1: k for toe, k in zip(toes, chosen, strict=True)}
    return best

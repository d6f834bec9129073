"""First places of the heads: by trial of their offsets, then by the likeliest origin of each comparison.

Where two laser planes are apart, cameras see two stripes on the skin that both lasers reach. Which of them a comparison
is of is not known at first. Most comparisons are explained by the right offset.
"""

import numpy as np

from footscan.cloud.fusion.stripes import Floats
from footscan.cloud.heads.comparisons import HEAD_TERMS, Comparisons
from footscan.cloud.heads.equations import (
    FoundPlaces,
    HeadFit,
    likeliest,
    merged_lines,
    own_lines,
    same_line,
    solve,
    spread_unmoved,
    strays,
    unmoved_heads,
)

FARTHEST_MM, CELL_MM = 8.0, 0.05
"""Range of the offsets that are tried, and the distance from one to the next. Chosen by hand."""
SPREAD_MM = 0.06
"""Standard deviation of a comparison that is explained. Chosen by hand."""
ROUNDS = 6
"""Rounds in which comparisons are assigned to their likeliest origin: a bound of time."""


def first_places(comparisons: Comparisons, known: Floats, cameras: int) -> FoundPlaces:
    """Find places of the heads from comparisons of points whose laser is not known.

    Where the offsets are about equal, all origins explain a comparison alike: each of them is tried first, and the
    places that explain most are taken.

    known : (H, 4) places by the calibration, from which the search starts; if they are 0, offsets are tried
    """
    distance, heads = comparisons.distance, len(known)
    calibrated = unmoved_heads(known, cameras)
    start = calibrated
    if not known.any():
        start = unmoved_heads(np.zeros((heads, HEAD_TERMS)), cameras)
        start.places[:, 0] = _offsets(comparisons, heads)
    lines = [same_line(comparisons, head, heads) for head in comparisons.heads.T]
    lines += [same_line(comparisons, np.full(len(distance), head), heads) for head in range(heads)]
    origins = [merged_lines(comparisons, heads), *lines, own_lines(comparisons, heads)]
    firsts = [likeliest(comparisons, origins, distance, start)] if known.any() else origins[:3]
    fits: list[tuple[HeadFit, Floats]] = []
    for first in firsts:
        change, fit = first, solve(comparisons, first, distance, start)
        for _ in range(ROUNDS):
            change = likeliest(comparisons, origins, distance, fit)
            fit = solve(comparisons, change, distance, fit)
        fits.append((fit, change))
    change = likeliest(comparisons, origins, distance, calibrated)
    unmoved_mm = spread_unmoved(comparisons, change, distance, known, cameras)
    best, explained = min(fits, key=lambda found: found[0].spread_mm)
    return FoundPlaces(best, unmoved_mm, strays(comparisons, explained, distance, best))


def _offsets(comparisons: Comparisons, heads: int) -> Floats:
    """Offsets (H,) with mean 0, mm, by what explains most comparisons of each pair of heads."""
    offsets = np.arange(-FARTHEST_MM, FARTHEST_MM + CELL_MM / 2, CELL_MM)
    rows, right = [np.ones(heads)], [0.0]
    for first in range(heads):
        for second in range(first + 1, heads):
            explained = _explained(comparisons, first, second, offsets)
            if not explained.any():
                continue
            best = int(np.argmax(explained))
            weight = np.sqrt(explained[best])
            row = np.zeros(heads)
            row[first], row[second] = -weight, weight
            rows.append(row)
            right.append(weight * float(offsets[best]))
    return np.asarray(np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0])


def _explained(comparisons: Comparisons, first: int, second: int, offsets: Floats) -> Floats:
    """(K,) number of comparisons of two heads that offsets (K,) of the second head from the first explain."""
    explained = np.zeros(len(offsets))
    for heads, sign in (((first, second), 1.0), ((second, first), -1.0)):
        chosen = np.all(comparisons.heads == heads, axis=1)
        left = [
            comparisons.distance[chosen] - sign * offsets[:, None] * sight
            for sight in comparisons.along_sight[chosen].T
        ]
        nearest = np.minimum(*np.abs(left))
        explained += np.exp(-0.5 * (nearest / SPREAD_MM) ** 2).sum(axis=1)
    return explained

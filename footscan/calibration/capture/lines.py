"""Straight pieces of the stripe in one frame, and the corners in which they meet.

The constants are chosen by hand, unless another reason is given.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.robust import MAD_TO_SD

Floats = NDArray[np.float64]

SHORTEST_PX = 12.0
"""Length up to which a piece is dropped."""
TOLERANCE_PX = (0.4, 1.2)
"""Bounds of the distance of a point from its piece's parabola; between them, the limit is four times the spread."""
NOISE_PX = 0.1
"""Lower bound of the standard deviation of a piece's points across the stripe, far from corners."""
HUBER = 1.345
"""Residual, in standard deviations, beyond which points lose weight (Huber 1964, doi:10.1214/aoms/1177703732)."""
BEND_PER_PX = 6e-5
"""Prior standard deviation of the parabola's square coefficient, by lens distortion: a sagitta of 1 px over 250 px.
Long pieces with several times as much keep it, short ones stay straight."""
END_PX = 4.0
"""Length of each end that is not fitted: at a corner, a contour or a shadow the stripe's centre is biased."""
SEED_PX, STEP_PX = 8.0, 8.0
"""Radius around a point within which a piece starts, and longest gap across which it grows."""
JOIN_PX, JOIN_STEP_PX = 40.0, 0.4
"""Longest gap across which two pieces are joined, and their largest distance from their common parabola."""
CORNER_REACH_PX, OVERSHOOT_PX = 15.0, 6.0
"""Largest gap between a piece and its corner, and largest length of a piece beyond its corner."""
SMALLEST_ANGLE = np.radians(12.0)
"""Smallest angle of a corner: with less, the pieces are one bent piece, or lie side by side."""
CORRELATION_PX = 4.0
"""Factor on the variance of a fit: so many points in a row, whose profiles share pixels, count as one."""
GROWTHS, REWEIGHTINGS, NEWTON_STEPS = 40, 3, 5
"""Iterations of the growth of a piece, of robust least squares, and of an intersection: bounds of time."""


@dataclass(frozen=True)
class ImageLine:
    """A straight piece of the stripe, slightly bent by the lens."""

    points: NDArray[np.intp]
    """(n,) indices of the input points on it, in order along it, including those near its ends."""
    normal: Floats
    """(2,) unit, image frame (i, j)."""
    offset: float
    """normal . (i, j) = offset, px: the line of total least squares."""
    middle: float
    """Position along the line, px, of the middle between the ends; origin of `bend`."""
    bend: Floats
    """(3,) c0, c1, c2: the distance of the piece from the line, in the direction of the normal, is c0 + c1 s + c2 s^2
    px, s px from the middle along `along`."""
    ends: Floats
    """(2, 2) px: its first and its last point, projected onto the parabola."""
    rms_px: float
    """Root mean square distance of its points from the parabola."""

    @property
    def along(self) -> Floats:
        """(2,) unit direction from the first end to the last."""
        return np.array([self.normal[1], -self.normal[0]])

    @property
    def length(self) -> float:
        """Distance of the ends, px."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))

    def positions(self, pixels: Floats) -> Floats:
        """Positions (N,) px along the line from the middle, of `pixels` (N, 2)."""
        return np.asarray(pixels @ self.along - self.middle)

    def distances(self, pixels: Floats) -> Floats:
        """Signed distances (N,) px of `pixels` (N, 2) from the parabola, positive in the direction of the normal."""
        s = self.positions(pixels)
        return np.asarray(pixels @ self.normal - self.offset - np.vander(s, 3, increasing=True) @ self.bend)


@dataclass(frozen=True)
class ImageCorner:
    """The corner in which two neighbouring pieces of the stripe meet."""

    position: Floats
    """(2,) px."""
    lines: tuple[int, int]
    """Indices of the two pieces."""
    sigma_px: float
    """Standard deviation of the position, root mean square of its two axes, without the bias of the stripe."""


def find_lines(pixels: Floats) -> list[ImageLine]:
    """Find the straight pieces of the stripe in one frame, longest first.

    A piece starts where points are straightest and grows along the stripe as long as points lie on its parabola. A
    prior keeps the bend as small as that of lenses: a short piece is a line.

    Parameters
    ----------
    pixels : (N, 2) float64, px: column i and row j of the stripe's points, in any order.

    Returns
    -------
    Pieces of more than 12 px, fitted without 4 px at both ends, where the stripe's centre is biased. A point belongs to
    one piece at most, at a corner to the nearer one. Pieces on one parabola are joined if the gap is below 40 px.
    A straight reflection or a glint is a piece too; only the known cross-section shows what belongs to the object.

    Examples
    --------
    >>> [line] = find_lines(np.column_stack([np.arange(50.0), np.full(50, 20.0)]))
    >>> print(len(line.points), round(line.length, 3), round(abs(line.offset), 3))
    50 49.0 20.0
    """
    pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
    if len(pixels) < 3:
        return []
    order = np.lexsort((pixels[:, 1], pixels[:, 0]))  # the same pieces whatever the order of the points
    ordered = pixels[order]
    pieces = _share(ordered, _join(ordered, _grow_all(ordered)))
    lines = [_line(ordered, members) for members in pieces]
    lines = [line for line in lines if line.length > SHORTEST_PX]
    lines.sort(key=lambda line: (-line.length, *line.ends[0]))
    return [replace(line, points=order[line.points]) for line in lines]


def find_corners(lines: list[ImageLine], pixels: Floats, leave_out_px: float = 5.0) -> list[ImageCorner]:
    """Find the corners in which neighbouring pieces of the stripe meet, those with the shortest gap first.

    A corner is the intersection of two parabolas. An end of a piece meets one other piece at most. Two pieces of which
    one hides the other may seem to meet as well.

    Parameters
    ----------
    lines : the result of `find_lines` for `pixels` (N, 2).
    leave_out_px : distance from the corner within which points are ignored; the stripe's centre is biased there.
    """
    pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
    meetings = []
    for a, b in combinations(range(len(lines)), 2):
        position = _meet(lines[a], lines[b])
        if position is not None:
            gap = max(_gap(lines[a], position), _gap(lines[b], position))
            meetings.append((gap, a, b, position))
    corners: list[ImageCorner] = []
    taken: set[tuple[int, bool]] = set()
    for _, a, b, position in sorted(meetings, key=lambda meeting: meeting[:3]):
        ends = {(n, bool(lines[n].positions(position[None])[0] > 0)) for n in (a, b)}
        if taken.isdisjoint(ends):
            taken |= ends
            corners.append(_corner(lines, (a, b), pixels, position, leave_out_px))
    return corners


def _grow_all(pixels: Floats) -> list[NDArray[np.intp]]:
    """The members of each piece, starting at the straightest places."""
    straightness, angle = _local_lines(pixels)
    near = cKDTree(pixels)
    free = np.ones(len(pixels), np.bool_)
    tried = ~np.isfinite(straightness)
    pieces = []
    for seed in np.argsort(straightness, kind="stable"):
        if tried[seed] or not free[seed]:
            continue
        around = np.array(near.query_ball_point(pixels[seed], SEED_PX, return_sorted=True))
        normal = np.array([-np.sin(angle[seed]), np.cos(angle[seed])])
        on_it = np.abs((pixels[around] - pixels[around].mean(axis=0)) @ normal) < TOLERANCE_PX[1]
        members = _grow(pixels, around[on_it & free[around]], free)
        tried[seed] = tried[members] = True
        if len(members) >= 0.5 * SHORTEST_PX and _extent(pixels[members]) > SHORTEST_PX:
            free[members] = False
            pieces.append(members)
    return pieces


def _local_lines(pixels: Floats) -> tuple[Floats, Floats]:
    """Distance of the points around each point from a line (N,) px, infinite for a blot, and the line's angle (N,)."""
    pairs = cKDTree(pixels).query_pairs(SEED_PX, output_type="ndarray")
    here, there = np.concatenate([pairs, pairs[:, ::-1]]).T
    d_i, d_j = (pixels[there] - pixels[here]).T

    def mean(values: Floats) -> Floats:
        return np.bincount(here, values, minlength=len(pixels)) / count

    count = np.bincount(here, minlength=len(pixels)) + 1.0
    mean_i, mean_j = mean(d_i), mean(d_j)
    ii, jj, ij = mean(d_i * d_i) - mean_i**2, mean(d_j * d_j) - mean_j**2, mean(d_i * d_j) - mean_i * mean_j
    root = np.hypot(0.5 * (ii - jj), ij)
    least, most = 0.5 * (ii + jj) - root, 0.5 * (ii + jj) + root
    straight = (count >= 0.5 * SEED_PX) & (most > 9.0 * np.maximum(least, 0.0))
    off = np.sqrt(np.maximum(least, 0.0) / count)  # prefers, of two equally straight places, the one with more points
    return np.where(straight, off, np.inf), 0.5 * np.arctan2(2.0 * ij, ii - jj)


def _grow(pixels: Floats, members: NDArray[np.intp], free: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Grow the piece that starts with `members`, over free points."""
    candidates = np.flatnonzero(free)
    for _ in range(GROWTHS):
        if len(members) < 4:
            return members
        line = _line(pixels, members)
        s = line.positions(pixels[candidates])
        half = 0.5 * line.length
        # A short piece does not predict places far beyond its ends.
        off = np.abs(line.distances(pixels[candidates]))
        near = (np.abs(s) < 2.0 * half + STEP_PX) & (off < _tolerance(pixels, line))
        inside, where = candidates[near], s[near]
        order = np.argsort(where, kind="stable")
        grown = inside[order][_unbroken(where[order])]
        if np.array_equal(np.sort(grown), np.sort(members)):
            break
        members = grown
    return members


def _tolerance(pixels: Floats, line: ImageLine) -> float:
    """The largest distance of a point from a piece, px, by the median of its points."""
    spread = _spread(np.abs(line.distances(pixels[line.points])))
    return min(max(4.0 * spread, TOLERANCE_PX[0]), TOLERANCE_PX[1])


def _unbroken(s: Floats) -> slice:
    """The run of sorted positions `s` without a gap that is nearest to 0."""
    if not len(s):
        return slice(0, 0)
    breaks = np.flatnonzero(np.diff(s) > STEP_PX)
    centre = int(np.argmin(np.abs(s)))
    before, after = breaks[breaks < centre], breaks[breaks >= centre]
    return slice(int(before[-1]) + 1 if len(before) else 0, int(after[0]) + 1 if len(after) else len(s))


def _join(pixels: Floats, pieces: list[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    """Join pieces on one parabola with a short gap between them, the nearest first."""
    pieces = list(pieces)
    while True:
        lines = [_line(pixels, members) for members in pieces]
        joins = []
        for a, b in combinations(range(len(lines)), 2):
            gap = np.linalg.norm(lines[a].ends[:, None] - lines[b].ends, axis=2).min()
            if gap < JOIN_PX and _on_one_parabola(pixels, lines[a], lines[b]):
                joins.append((float(gap), a, b))
        if not joins:
            return pieces
        _, a, b = min(joins)
        pieces[a] = np.concatenate([pieces[a], pieces[b]])
        del pieces[b]


def _on_one_parabola(pixels: Floats, a: ImageLine, b: ImageLine) -> bool:
    """True if two pieces lie on one parabola, one behind the other."""
    if abs(a.normal @ b.normal) < np.cos(SMALLEST_ANGLE):
        return False
    s = a.positions(b.ends)
    if abs(s.mean()) < 0.5 * max(a.length, b.length):  # side by side
        return False
    both = _line(pixels, np.concatenate([a.points, b.points]))
    for piece in (a, b):
        off = both.distances(pixels[piece.points])
        if np.abs(np.median(off)) > JOIN_STEP_PX or np.sqrt(np.mean(off**2)) > piece.rms_px + JOIN_STEP_PX:
            return False
    return True


def _share(pixels: Floats, pieces: list[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    """Assign each point to the nearest of the pieces to which it may belong."""
    if not pieces:
        return []
    lines = [_line(pixels, members) for members in pieces]
    off = np.full((len(lines), len(pixels)), np.inf)
    for row, line in zip(off, lines, strict=True):
        beside = np.abs(line.positions(pixels)) <= 0.5 * line.length + 1.0
        distances = np.abs(line.distances(pixels[beside]))
        row[beside] = np.where(distances < _tolerance(pixels, line), distances, np.inf)
    nearest = np.where(np.isfinite(off.min(axis=0)), off.argmin(axis=0), -1)
    shared = [np.flatnonzero(nearest == n) for n in range(len(lines))]
    return [members for members in shared if len(members) >= 0.5 * SHORTEST_PX]


def _line(pixels: Floats, members: NDArray[np.intp]) -> ImageLine:
    """The piece of `pixels[members]`, fitted without its ends."""
    points = pixels[members]
    s = points @ _direction(points)
    low, high = s.min(), s.max()
    end = _end(high - low)
    inner = members[(s >= low + end) & (s <= high - end)]
    return _fit(pixels, members, inner if len(inner) >= 3 else members)


def _end(length: float) -> float:
    """The length of each end of a piece that is not fitted, px."""
    return min(END_PX, 0.2 * length)


def _fit(pixels: Floats, members: NDArray[np.intp], fitted: NDArray[np.intp]) -> ImageLine:
    """The line of total least squares through `pixels[fitted]`, and the parabola along it, from end to end."""
    inner = pixels[fitted]
    along = _direction(inner)
    normal = np.array([-along[1], along[0]])
    s = pixels[members] @ along
    order = np.argsort(s, kind="stable")
    reach = s[order[[0, -1]]]
    middle = 0.5 * float(reach.sum())
    offset = float(inner.mean(axis=0) @ normal)
    bend, _, rms = _parabola(inner @ along - middle, inner @ normal - offset)
    departures = np.vander(reach - middle, 3, increasing=True) @ bend
    ends = reach[:, None] * along + (offset + departures)[:, None] * normal
    return ImageLine(members[order], normal, offset, middle, bend, ends, rms)


def _direction(points: Floats) -> Floats:
    """Unit vector (2,) along which `points` (n, 2) have the largest spread."""
    away = points - points.mean(axis=0)
    (ii, ij), (_, jj) = away.T @ away
    angle = 0.5 * np.arctan2(2.0 * ij, ii - jj)
    return np.array([np.cos(angle), np.sin(angle)])


def _parabola(s: Floats, off: Floats) -> tuple[Floats, Floats, float]:
    """Robust parabola through `off` (n,) px at `s` (n,) px: its coefficients (3,), their covariance, the rms, px."""
    matrix = np.vander(s, 3, increasing=True)
    prior = np.diag([0.0, NOISE_PX**2, (NOISE_PX / BEND_PER_PX) ** 2])  # the slope is relative to the line
    weights = np.ones(len(s))
    for _ in range(REWEIGHTINGS):
        normal_matrix = (matrix.T * weights) @ matrix + prior
        bend = np.asarray(np.linalg.solve(normal_matrix, (matrix.T * weights) @ off), np.float64)
        residuals = np.abs(off - matrix @ bend)
        spread = max(NOISE_PX, _spread(residuals))
        weights = HUBER * spread / np.maximum(residuals, HUBER * spread)
    covariance = np.asarray(CORRELATION_PX * spread**2 * np.linalg.inv(normal_matrix), np.float64)
    return bend, covariance, float(np.sqrt(residuals @ residuals / len(s)))


def _spread(residuals: Floats) -> float:
    """Standard deviation by the (upper) median of absolute residuals, as of a normal distribution."""
    middle = len(residuals) // 2
    return MAD_TO_SD * float(np.partition(residuals, middle)[middle])


def _extent(points: Floats) -> float:
    return float(np.hypot(*np.ptp(points, axis=0)))


def _meet(a: ImageLine, b: ImageLine) -> Floats | None:
    """The place in which two neighbouring pieces meet, (2,) px; None if they do not meet."""
    if abs(a.normal @ b.normal) > np.cos(SMALLEST_ANGLE):
        return None
    straight = np.linalg.solve(np.array([a.normal, b.normal]), np.array([a.offset, b.offset]))
    if max(_gap(a, straight), _gap(b, straight)) > 2.0 * CORNER_REACH_PX:
        return None
    position = _intersection(a, b)
    gaps = (_gap(a, position), _gap(b, position))
    return position if all(-OVERSHOOT_PX < gap < CORNER_REACH_PX for gap in gaps) else None


def _gap(line: ImageLine, position: Floats) -> float:
    """Distance of a position beyond the nearer end of the piece, px; negative within the piece."""
    return float(abs(line.positions(position[None])[0])) - 0.5 * line.length


def _intersection(a: ImageLine, b: ImageLine) -> Floats:
    """Intersection (2,) px of two parabolas, by Newton's method from that of the lines."""
    position = np.linalg.solve(np.array([a.normal, b.normal]), np.array([a.offset, b.offset]))
    for _ in range(NEWTON_STEPS):
        off = np.array([line.distances(position[None])[0] for line in (a, b)])
        position = position - np.linalg.solve(np.array([_gradient(line, position) for line in (a, b)]), off)
    return position


def _gradient(line: ImageLine, position: Floats) -> Floats:
    """Gradient (2,) of the distance from the parabola."""
    s = line.positions(position[None])[0]
    return np.asarray(line.normal - (line.bend[1] + 2.0 * line.bend[2] * s) * line.along)


def _corner(
    lines: list[ImageLine], pair: tuple[int, int], pixels: Floats, position: Floats, leave_out_px: float
) -> ImageCorner:
    """The corner near `position`, from the points that are not too near to it."""
    refits, variances = [], []
    for line in (lines[n] for n in pair):
        points = pixels[line.points]
        towards = np.sign(line.positions(position[None])[0])
        far = towards * line.positions(points) < _end(line.length) - 0.5 * line.length
        fitted = line.points[(np.linalg.norm(points - position, axis=1) >= leave_out_px) & ~far]
        fitted = fitted if len(fitted) >= 0.5 * SHORTEST_PX else line.points
        refit = _fit(pixels, line.points, fitted)
        s = refit.positions(pixels[fitted])
        _, covariance, _ = _parabola(s, pixels[fitted] @ refit.normal - refit.offset)
        at = np.vander(refit.positions(position[None]), 3, increasing=True)[0]
        refits.append(refit)
        variances.append(float(at @ covariance @ at))
    position = _intersection(*refits)
    inverse = np.linalg.inv(np.array([_gradient(line, position) for line in refits]))
    sigma = float(np.sqrt(0.5 * np.sum(inverse**2 * variances)))
    return ImageCorner(position, pair, sigma)

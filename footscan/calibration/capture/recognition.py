"""Recognition of the reference object: the first map of a camera, from the straight pieces of its stripe.

Four lines of the image and four lines of the cross-section, no three of which meet in one point, determine a
homography. All assignments of edges to four pieces are tried. Few are possible, since a camera sees only edges that
face it. The right one explains the stripe in all placements. A symmetric object looks the same from several sides;
placements that break the symmetry, or else the mounting of the camera, decide between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_correspondence import can_be_seen, facing_names, is_view, misfits, named_maps
from footscan.calibration.capture.edge_points import edge_distances
from footscan.calibration.capture.lines import ImageLine, find_lines
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.homography import algebraic_homography, project
from schemas.mounting import Mounting, Sign

Floats = NDArray[np.float64]

SHORTEST_LINE_PX = 25.0
"""Length from which a piece of the stripe is used. Chosen by hand."""
LINES_A_FRAME = 6
"""Number of the longest pieces of a frame that are used. Chosen by hand."""
QUADRUPLES = 16
"""Number of sets of four pieces that are tried, the best conditioned first: a bound of time."""
TRIED_BEFORE_STOPPING, GOOD_SCORE = 4, 0.85
"""Number of sets that are tried at least, and the score of a map above which no further sets are tried. Chosen by
hand."""
SAMPLE = 120
"""Points of a frame by which maps are judged: a bound of time."""
REACH_MM = 4.0
"""Bound of a point's distance from the nearest edge in the misfit of a map without distortion. Chosen by hand."""
REFINED = 12
"""Number of maps that are refined: a bound of time."""
GATES_MM = (4.0, 3.0, 2.0, 1.5, 1.5)
"""Distances from an edge within which points are used, in each step of the refinement. Chosen by hand."""
FEWEST_POINTS = 12
"""Points that a refinement needs. Chosen by hand."""
EXPLAINED_MM = 1.5
"""Distance from an edge up to which a point is explained by a map without distortion. Chosen by hand."""
STRAY_SHARE = 0.1
"""Share of points that may be nearest to a hidden edge, at a corner or by chance. Chosen by hand."""
SHARP_MM = 0.75
"""Distance from an edge at which a point no longer adds to a map's score. Chosen by hand."""
FEWEST_EXPLAINED = 0.4
"""Least score of a map. Chosen by hand."""
AS_GOOD = 0.9
"""Ratio to the best score from which a map may be the right one. Chosen by hand."""
LEVEL = 0.15
"""Least mean component of the seen edges' normals that shows the side from which they are seen. Chosen by hand."""
UNKNOWN = Mounting(0, 0, 0)
"""No side is known."""
APART_MM = 5.0
"""Distance from which two maps place a point differently; maps differ if more than `STRAY_SHARE` of the points do.
Chosen by hand."""
FROM_PAIR, FROM_ALL = 3, 8
"""Number of the longest pieces of each of two frames, and of all frames, from which sets are formed if single frames
give too few: a bound of time."""


@dataclass(frozen=True)
class FirstMap:
    """A homography without distortion, accurate to a millimetre or two."""

    matrix: Floats
    """(3, 3) from (i, j, 1) to (Y, Z, 1), mm."""
    explained: Floats
    """(K,) share of the stripe in each placement that lies near an edge; NaN for a placement without stripe."""
    score: float
    """Explained share of the stripe, over all placements; points count less with their distance from the edge."""
    seen_from: Mounting = UNKNOWN
    """The side from which the camera sees the object."""

    def world(self, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2)."""
        return project(self.matrix, pixels)[0]


class UnrecognisedError(Exception):
    """The object cannot be recognised."""


def recognise(stripes: Sequence[Floats], edges: Edges, placements: Floats, mounting: Mounting) -> FirstMap:
    """Find the first map of a camera from the stripe over the reference object.

    Parameters
    ----------
    stripes : for each of K placements the points (N, 2) of the stripe, px, N >= 0.
    edges : the E edges of the object's cross-section.
    placements : (K, 2) shift of the object in each placement, mm.
    mounting : where the camera is mounted; it decides between maps that explain the stripe equally well.

    Raises
    ------
    UnrecognisedError
        There are too few straight pieces, or no map explains them, or several do.
    """
    lines = [[line for line in find_lines(s) if line.length >= SHORTEST_LINE_PX][:LINES_A_FRAME] for s in stripes]
    pieces = [(placement, line) for placement, of_frame in enumerate(lines) for line in of_frame]
    if len(pieces) < 4:
        raise UnrecognisedError(f"{len(pieces)} straight pieces of the stripe in all frames, expected at least four")
    frames = _Frames.of(stripes, edges, placements)
    candidates: list[FirstMap] = []
    names = facing_names(edges)
    for number, quadruple in enumerate(_quadruples(pieces)):
        four = [pieces[k][1] for k in quadruple]
        seen_in = np.array([pieces[k][0] for k in quadruple])
        image_lines = np.array([[*line.normal, line.offset] for line in four])
        ends = np.concatenate([line.ends for line in four])
        maps = named_maps(names, image_lines, ends, seen_in, placements[seen_in], edges)
        candidates += _refined(maps, frames)
        if number + 1 >= TRIED_BEFORE_STOPPING and candidates and max(m.score for m in candidates) > GOOD_SCORE:
            break
    if not candidates:
        raise UnrecognisedError("no view of the object explains the stripe")
    best = max(candidates, key=lambda m: m.score)
    if best.score < FEWEST_EXPLAINED:
        raise UnrecognisedError(f"the best view of the object explains {best.score:.0%} of the stripe")
    chosen = _decide([m for m in candidates if m.score >= AS_GOOD * best.score], frames, mounting)
    return replace(chosen, seen_from=_seen_from(chosen, frames))


@dataclass(frozen=True)
class _Frames:
    """A sample of the stripe's points in all placements."""

    pixels: Floats
    """(N, 2) px."""
    placement: NDArray[np.intp]
    """(N,) number of the placement."""
    shift: Floats
    """(N, 2) of the object, mm."""
    edges: Edges
    count: int
    """Number of placements."""

    @staticmethod
    def of(stripes: Sequence[Floats], edges: Edges, placements: Floats) -> "_Frames":
        """Draw an evenly spread sample of each stripe."""
        chosen = []
        for stripe in stripes:
            order = np.lexsort((stripe[:, 1], stripe[:, 0]))
            chosen.append(stripe[order[:: max(1, -(-len(stripe) // SAMPLE))]])
        placement = np.repeat(np.arange(len(stripes)), [len(s) for s in chosen])
        return _Frames(np.concatenate(chosen), placement, placements[placement], edges, len(stripes))

    def distances(self, matrix: Floats) -> tuple[NDArray[np.intp], Floats]:
        """The nearest edge (N,) and the distance from it (N,), mm, under a map (3, 3)."""
        return edge_distances(self.edges, project(matrix, self.pixels)[0] - self.shift)


def _quadruples(pieces: list[tuple[int, ImageLine]]) -> list[tuple[int, ...]]:
    """Choose sets of four pieces, of one frame if possible, best conditioned first: no three meet in one point."""
    ends = np.array([end for _, line in pieces for end in line.ends])
    middle, reach = ends.mean(axis=0), float(np.linalg.norm(ends.std(axis=0)))
    rows = np.array([[*line.normal, (line.normal @ middle - line.offset) / reach] for _, line in pieces])
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    by_frame: dict[int, list[int]] = {}
    for k, (placement, _) in enumerate(pieces):
        by_frame.setdefault(placement, []).append(k)
    sets: list[tuple[int, ...]] = [q for members in by_frame.values() for q in combinations(members, 4)]
    if len(sets) < QUADRUPLES:
        frames = list(by_frame.values())
        for a, b in combinations(range(len(frames)), 2):
            from_a, from_b = (combinations(frames[k][:FROM_PAIR], 2) for k in (a, b))
            sets += [(*p, *q) for p, q in product(from_a, from_b)]
    if not sets:
        sets = list(combinations(range(min(len(pieces), FROM_ALL)), 4))

    def quality(members: tuple[int, ...]) -> float:
        volumes = [abs(float(np.linalg.det(rows[list(three)]))) for three in combinations(members, 3)]
        return min(volumes) * min(pieces[k][1].length for k in members)

    return sorted(sets, key=lambda q: (-quality(q), q))[:QUADRUPLES]


def _refined(maps: Floats, frames: _Frames) -> list[FirstMap]:
    """Refine the best of `maps` (M, 3, 3) on all points that they explain."""
    misfit = misfits(maps, frames.pixels, frames.shift, frames.edges, REACH_MM)
    refined = [_refine(maps[k], frames) for k in np.argsort(misfit, kind="stable")[:REFINED]]
    return [candidate for candidate in refined if candidate is not None]


def _refine(matrix: Floats, frames: _Frames) -> FirstMap | None:
    """Fit a map (3, 3) to the points near edges, again and again; None if it is not a possible view."""
    for gate in GATES_MM:
        index, distance = frames.distances(matrix)
        near = distance < gate
        if near.sum() < FEWEST_POINTS:
            return None
        normals = frames.edges.normal[index[near]]
        offsets = frames.edges.offset[index[near]] + np.sum(normals * frames.shift[near], axis=1)
        matrix = algebraic_homography(frames.pixels[near], normals, offsets)
        if not is_view(matrix, frames.pixels[near]):
            return None
    index, distance = frames.distances(matrix)
    near = distance < EXPLAINED_MM
    seen = np.bincount(index[near], minlength=len(frames.edges.length)) > STRAY_SHARE * near.sum()
    if not seen.any() or not can_be_seen(frames.edges, seen):
        return None
    with np.errstate(invalid="ignore"):
        shares = np.bincount(frames.placement, near, minlength=frames.count) / np.bincount(
            frames.placement, minlength=frames.count
        )
    return FirstMap(matrix, shares, float(np.mean(np.clip(1.0 - (distance / SHARP_MM) ** 2, 0.0, None))))


def _decide(candidates: list[FirstMap], frames: _Frames, mounting: Mounting) -> FirstMap:
    """Choose among good maps: if they differ, the one that fits the mounting best."""
    kept: list[FirstMap] = []
    for candidate in sorted(candidates, key=lambda m: -m.score):
        explained = frames.pixels[frames.distances(candidate.matrix)[1] < EXPLAINED_MM]
        places = candidate.world(explained)
        apart = [np.linalg.norm(places - other.world(explained), axis=1) > APART_MM for other in kept]
        if all(far.mean() > STRAY_SHARE for far in apart):
            kept.append(candidate)
    if len(kept) == 1:
        return kept[0]
    ranks = [_agreement(_seen_from(candidate, frames), mounting) for candidate in kept]
    best = max(ranks)
    if ranks.count(best) > 1:
        raise UnrecognisedError(
            f"{ranks.count(best)} views of the object explain the stripe equally well; "
            "state where the camera stands, or add a placement in which the views differ"
        )
    return kept[ranks.index(best)]


def _agreement(seen_from: Mounting, mounting: Mounting) -> tuple[int, int]:
    """Rank the agreement with the mounting: by the side from which the edges are seen, then that of the laser plane."""
    side = int(seen_from.y * mounting.y > 0) + int(seen_from.z * mounting.z > 0)
    return side, int(seen_from.x * mounting.x > 0)


def _seen_from(candidate: FirstMap, frames: _Frames) -> Mounting:
    """The side from which the edges are seen, and the side of the laser plane.

    Seen from +X with Z up, Y points to the right. In an image i points to the right and j down, so that the map of a
    camera at +X changes the orientation.
    """
    index, distance = frames.distances(candidate.matrix)
    facing = frames.edges.normal[index[distance < EXPLAINED_MM]].mean(axis=0)
    middle = frames.pixels.mean(axis=0)
    corner = candidate.world(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    (a, b), (c, d) = corner[1:] - corner[0]
    return Mounting(_sign(b * c - a * d, 0.0), _sign(facing[0], LEVEL), _sign(facing[1], LEVEL))


def _sign(value: float, level: float) -> Sign:
    """The sign of a value; 0 up to `level`."""
    if abs(value) <= level:
        return 0
    return 1 if value > 0 else -1

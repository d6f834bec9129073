"""Which edge of the reference object each straight piece of the stripe lies on: the first map of a camera, unaided.

Four lines of the image and four of the cross-section, no three of them through one point, determine a homography. All
ways to name four pieces are tried; a camera sees only edges that face it, which leaves few. The right one explains the
stripe in all placements. An object that is symmetric looks the same from several sides; which of them it is, placements
that break the symmetry tell, or else where the camera stands.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

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
LINES_A_FRAME = 6
"""The longest pieces of a frame are those of the object."""
QUADRUPLES = 16
"""So many sets of four pieces are tried, the best conditioned first."""
TRIED_BEFORE_STOPPING = 4
SAMPLE = 120
"""Points of a frame by which a map is judged before it is refined."""
REACH_MM = 4.0
"""A point farther from every edge than this is not explained at all: lens distortion is not known yet."""
REFINED = 12
"""So many maps are refined."""
GATES_MM = (4.0, 3.0, 2.0, 1.5, 1.5)
EXPLAINED_MM = 1.5
"""A point as near to an edge as this is explained by a homography that knows of no distortion."""
STRAY_SHARE = 0.1
"""So many points may be nearest to an edge that the camera does not see, at a corner or by chance."""
SHARP_MM = 0.75
"""At this distance a point speaks no more for a map: what lies near an edge, not on it, does so by chance."""
FEWEST_EXPLAINED = 0.4
"""A map with a lower score is none."""
AS_GOOD = 0.9
"""A map with this share of the best one's score may be the right one."""
LEVEL = 0.15
"""Edges that face a side by less, in the mean, do not say that they are seen from there."""
UNKNOWN = Mounting(0, 0, 0)
APART_MM = 5.0
"""Maps that place more than stray points farther apart than this are two."""


@dataclass(frozen=True)
class FirstMap:
    """A homography that knows of no distortion, good to a millimetre or two."""

    matrix: Floats
    """(3, 3) from (i, j, 1) to (Y, Z, 1), mm."""
    explained: Floats
    """(K,) share of the stripe in each placement that lies near an edge; NaN where there is no stripe."""
    score: float
    """Share of the stripe that is explained, over all placements; a point counts less the farther off it lies."""
    seen_from: Mounting = UNKNOWN
    """Where the camera stands by what it sees."""

    def world(self, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2)."""
        return project(self.matrix, pixels)[0]


class UnrecognisedError(Exception):
    """The object is not to be recognised."""


def recognise(stripes: Sequence[Floats], edges: Edges, placements: Floats, mounting: Mounting) -> FirstMap:
    """The first map of a camera from the stripe over the reference object.

    Parameters
    ----------
    stripes : for each of K placements the stripe's points (N, 2), px; empty where there are none.
    edges : of the object's cross-section, E of them.
    placements : (K, 2) shift of the object in each placement, mm.
    mounting : where the camera stands; it decides where the stripe alone cannot.

    Raises
    ------
    UnrecognisedError
        Too few straight pieces, or no map explains them, or several do.
    """
    lines = [[line for line in find_lines(s) if line.length >= SHORTEST_LINE_PX][:LINES_A_FRAME] for s in stripes]
    pieces = [(placement, line) for placement, found in enumerate(lines) for line in found]
    if len(pieces) < 4:
        raise UnrecognisedError(f"{len(pieces)} straight pieces of the stripe in all frames, expected at least four")
    frames = _Frames.of(stripes, edges, placements)
    found: list[FirstMap] = []
    names = facing_names(edges)
    for number, quadruple in enumerate(_quadruples(pieces)):
        four = [pieces[k][1] for k in quadruple]
        seen_in = np.array([pieces[k][0] for k in quadruple])
        image_lines = np.array([[*line.normal, line.offset] for line in four])
        ends = np.concatenate([line.ends for line in four])
        maps = named_maps(names, image_lines, ends, seen_in, placements[seen_in], edges)
        found += _refined(maps, frames)
        if number + 1 >= TRIED_BEFORE_STOPPING and found and max(m.score for m in found) > 0.85:
            break
    if not found:
        raise UnrecognisedError("no view of the object explains the stripe")
    best = max(found, key=lambda m: m.score)
    if best.score < FEWEST_EXPLAINED:
        raise UnrecognisedError(f"the best view of the object explains {best.score:.0%} of the stripe")
    chosen = _decide([m for m in found if m.score >= AS_GOOD * best.score], frames, mounting)
    return replace(chosen, seen_from=_seen_from(chosen, frames))


@dataclass(frozen=True)
class _Frames:
    """A sample of the stripe's points in all placements."""

    pixels: Floats
    """(N, 2)."""
    placement: NDArray[np.intp]
    """(N,)."""
    shift: Floats
    """(N, 2) of the object, mm."""
    edges: Edges
    count: int

    @staticmethod
    def of(stripes: Sequence[Floats], edges: Edges, placements: Floats) -> "_Frames":
        chosen = []
        for stripe in stripes:
            order = np.lexsort((stripe[:, 1], stripe[:, 0]))
            chosen.append(stripe[order[:: max(1, -(-len(stripe) // SAMPLE))]])
        placement = np.repeat(np.arange(len(stripes)), [len(s) for s in chosen])
        return _Frames(np.concatenate(chosen), placement, placements[placement], edges, len(stripes))

    def distances(self, matrix: Floats) -> tuple[NDArray[np.intp], Floats]:
        """The nearest edge (N,), and the distance from it (N,)."""
        return edge_distances(self.edges, project(matrix, self.pixels)[0] - self.shift)


def _quadruples(pieces: list[tuple[int, ImageLine]]) -> list[tuple[int, ...]]:
    """Sets of four pieces, of which no three meet in one point, the best conditioned first; within a frame if any."""
    middle = np.array([320.0, 240.0])
    rows = np.array([[*line.normal, (line.normal @ middle - line.offset) / 200.0] for _, line in pieces])
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    by_frame: dict[int, list[int]] = {}
    for k, (placement, _) in enumerate(pieces):
        by_frame.setdefault(placement, []).append(k)
    sets: list[tuple[int, ...]] = [q for members in by_frame.values() for q in combinations(members, 4)]
    if len(sets) < QUADRUPLES:
        frames = list(by_frame.values())
        for a, b in combinations(range(len(frames)), 2):
            sets += [
                (*p, *q) for p in combinations(frames[a][:3], 2) for q in combinations(frames[b][:3], 2)
            ]  # fmt: skip
    if not sets:
        sets = list(combinations(range(min(len(pieces), 8)), 4))

    def quality(members: tuple[int, ...]) -> float:
        volumes = [abs(float(np.linalg.det(rows[list(three)]))) for three in combinations(members, 3)]
        return min(volumes) * min(pieces[k][1].length for k in members)

    return sorted(sets, key=lambda q: (-quality(q), q))[:QUADRUPLES]


def _refined(maps: Floats, frames: _Frames) -> list[FirstMap]:
    """Those of `maps` (M, 3, 3) that explain most, each fitted to all the points that it explains."""
    misfit = misfits(maps, frames.pixels, frames.shift, frames.edges, REACH_MM)
    found = []
    for k in np.argsort(misfit, kind="stable")[:REFINED]:
        refined = _refine(maps[k], frames)
        if refined is not None:
            found.append(refined)
    return found


def _refine(matrix: Floats, frames: _Frames) -> FirstMap | None:
    for gate in GATES_MM:
        index, distance = frames.distances(matrix)
        near = distance < gate
        if near.sum() < 12:
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


def _decide(found: list[FirstMap], frames: _Frames, mounting: Mounting) -> FirstMap:
    """The best of maps that differ; where several explain the stripe as well, the one that fits the mounting."""
    kept: list[FirstMap] = []
    for candidate in sorted(found, key=lambda m: -m.score):
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
            f"{ranks.count(best)} views of the object explain the stripe as well; "
            "say where the camera stands, or add a placement that tells them apart"
        )
    return kept[ranks.index(best)]


def _agreement(seen_from: Mounting, mounting: Mounting) -> tuple[int, int]:
    """How well a map fits the mounting: the side from which the edges are seen, then the side of the laser's plane."""
    side = int(seen_from.y * mounting.y > 0) + int(seen_from.z * mounting.z > 0)
    return side, int(seen_from.x * mounting.x > 0)


def _seen_from(candidate: FirstMap, frames: _Frames) -> Mounting:
    """The side from which the edges are seen, and the side of the laser's plane.

    Seen from +X with Z up, Y runs to the right; i runs to the right and j down, so the map turns the image over.
    """
    index, distance = frames.distances(candidate.matrix)
    facing = frames.edges.normal[index[distance < EXPLAINED_MM]].mean(axis=0)
    middle = frames.pixels.mean(axis=0)
    corner = candidate.world(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    (a, b), (c, d) = corner[1:] - corner[0]
    return Mounting(_sign(b * c - a * d, 0.0), _sign(facing[0], LEVEL), _sign(facing[1], LEVEL))


def _sign(value: float, level: float) -> Sign:
    if abs(value) <= level:
        return 0
    return 1 if value > 0 else -1

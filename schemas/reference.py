"""The reference object and the capture of it that a calibration is made from."""

from itertools import pairwise
from math import hypot
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from schemas.base.model import Document, RelativePath
from schemas.calibration import view_name, view_number
from schemas.mounting import CaptureCamera
from schemas.scan import each_once

EXTENT_MM = (10.0, 1000.0)
FARTHEST_MM = 1000.0
LEAST_AREA_MM2 = 1.0

Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Shift = Annotated[list[Annotated[float, Field(ge=-FARTHEST_MM, le=FARTHEST_MM)]], Field(min_length=2, max_length=2)]


def _simple_polygon(corners: list[Pair]) -> list[Pair]:
    """`corners`, if they bound one area of the size of a reference object; ValueError says what does not."""
    _check_size(corners)
    for number, (corner, following) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        if corner == following:
            again = "repeats the first one" if number == len(corners) - 1 else f"and corner {number + 1} are one"
            raise ValueError(f"corner {number} {again}, expected each corner once: the profile closes by itself")
    if _on_one_line(corners):
        raise ValueError("all corners lie on one line, expected a polygon")
    if (touching := _touching_edges(corners)) is not None:
        ends = " and ".join(f"{_written(corners[k])} to {_written(corners[k + 1 - len(corners)])}" for k in touching)
        raise ValueError(f"the edges {ends} cross or touch, expected a polygon that does not meet itself")
    area = abs(sum(_cross(corners[0], a, b) for a, b in pairwise(corners))) / 2.0
    if area < LEAST_AREA_MM2:
        raise ValueError(f"encloses {area:.3g} mm2, expected at least {LEAST_AREA_MM2:g}; is it in millimetres?")
    return corners


def _each_once(placements: list[Shift]) -> list[Shift]:
    first: dict[tuple[float, ...], int] = {}
    for number, placement in enumerate(placements):
        known = first.setdefault(tuple(placement), number)
        if known != number:
            raise ValueError(f"placement {number} repeats placement {known}, expected each placement once")
    return placements


class ReferenceObject(Document):
    """A straight prism along X whose cross-section is known exactly. Its corners are control points."""

    format: Literal["footscan.reference/1"]
    profile_mm: Annotated[list[Pair], Field(min_length=3, max_length=1000), AfterValidator(_simple_polygon)]
    """(Y, Z) of the corners, a closed polygon that does not meet itself; the last corner joins the first."""
    placements_mm: Annotated[list[Shift], Field(min_length=1, max_length=10_000), AfterValidator(_each_once)]
    """(dY, dZ) of each placement, one captured frame each."""


class Capture(Document):
    """The content of capture.yaml: frame k of a camera shows placement k."""

    format: Literal["footscan.capture/1"]
    reference: RelativePath
    x_mm: float
    """Where the laser plane stands; that of the first laser, of heads that have two."""
    cameras: Annotated[list[CaptureCamera], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        each_once([view_name(view_number(camera.id, camera.laser)) for camera in self.cameras])
        return self

    def ahead_mm(self, camera: CaptureCamera) -> float:
        """X of the plane of a film's laser minus X of the first one."""
        return 0.0 if camera.x_mm is None else camera.x_mm - self.x_mm


def _check_size(corners: list[Pair]) -> None:
    extent = max(max(values) - min(values) for values in zip(*corners, strict=True))
    if not EXTENT_MM[0] <= extent <= EXTENT_MM[1]:
        expected = f"expected {EXTENT_MM[0]:g} to {EXTENT_MM[1]:g}; is it in millimetres?"
        raise ValueError(f"its largest extent is {extent:g} mm, {expected}")
    for corner in corners:
        if max(abs(corner[0]), abs(corner[1])) > FARTHEST_MM:
            raise ValueError(f"corner {_written(corner)} is out of reach, expected -{FARTHEST_MM:g} to {FARTHEST_MM:g}")


def _on_one_line(corners: list[Pair]) -> bool:
    first = corners[0]
    farthest = max(corners, key=lambda corner: hypot(corner[0] - first[0], corner[1] - first[1]))
    length = hypot(farthest[0] - first[0], farthest[1] - first[1])
    return all(abs(_cross(first, farthest, corner)) < 1e-9 * length * length for corner in corners)


def _touching_edges(corners: list[Pair]) -> tuple[int, int] | None:
    """Two edges that share a point and are no neighbours; edge k runs from corner k to the next.

    Where neighbours do, because one folds back on the other, an edge beside them touches one of the two.
    """
    count = len(corners)
    edges = [(corners[k], corners[k + 1 - count]) for k in range(count)]
    by_y = sorted(range(count), key=lambda k: min(edges[k][0][0], edges[k][1][0]))
    for place, k in enumerate(by_y):
        reach = max(edges[k][0][0], edges[k][1][0])
        for other in by_y[place + 1 :]:
            if min(edges[other][0][0], edges[other][1][0]) > reach:
                break
            a, b = sorted((k, other))
            if b - a not in (1, count - 1) and _meet(*edges[a], *edges[b]):
                return a, b
    return None


def _meet(a: Pair, b: Pair, c: Pair, d: Pair) -> bool:
    """Whether the pieces of line a-b and c-d share a point."""
    sides = [_cross(a, b, c), _cross(a, b, d), _cross(c, d, a), _cross(c, d, b)]
    if sides[0] * sides[1] < 0.0 and sides[2] * sides[3] < 0.0:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(side == 0.0 and _between(*end) for side, end in zip(sides, ends, strict=True))


def _between(a: Pair, b: Pair, point: Pair) -> bool:
    """Whether `point`, on the line a-b, lies within the box around a and b."""
    return all(min(p, q) <= value <= max(p, q) for p, q, value in zip(a, b, point, strict=True))


def _cross(a: Pair, b: Pair, c: Pair) -> float:
    """Twice the area of the triangle a, b, c; positive if it runs counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _written(corner: Pair) -> str:
    return f"[{corner[0]:g}, {corner[1]:g}]"

"""The footprint and its indices, from the section of the foot just above the floor.

The contact is the section of the foot at the height CONTACT_MM. Sections of the print run across the axis.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_surface import CLOSED_GAP_MM, UP, FootSurface
from footscan.measure.hull import hull_corners
from footscan.measure.outline import Outline, Plane, polygon_area
from footscan.measure.quantity import NotMeasurable, Quantity, combined

Floats = NDArray[np.float64]

CONTACT_MM = 1.0
"""Height above the floor up to which the skin counts as touching it; part of the definition of the print."""
STEP_MM = 0.5
"""Distance between the sections of the print."""
LEAST_SECTIONS = 6
"""Each third of a print has at least two sections."""
APEX_MM = 10.0
"""A parabola is fitted to the print's border this far to both sides of the arch's deepest point; chosen by hand."""
LEAST_POINTS, LEAST_SLOPE = 5, 1e-6
"""Least number of points for that parabola; least slope of the line through the metatarsal heads, against rounding."""
LEAST_MM2 = 20.0
"""Smaller spots are dust or noise; chosen by hand."""
TOES, MERGED = 0.13, 0.18
"""Shares of the length. A part of the print that begins farther than the first ahead of the line through the metatarsal
heads is a toe. If another part reaches farther than the second, toes have merged with it, and it is cut at the first.
Chosen by hand."""


class Print(NamedTuple):
    """A footprint without its toes."""

    outlines: list[Outline]
    """Its borders, mm, in the axes of the foot"""
    stations: Floats
    """(S,) X of its sections, mm, about STEP_MM apart, in the middle of strips that cover the print"""
    widths: Floats
    """(S,) width of the print at each section, mm"""
    rear: float
    """X of its rear end, mm."""
    front: float
    """X of its foremost point, mm."""
    doubt: str | None


def footprint(foot: FootSurface) -> Print:
    """Compute the contact of the foot with the floor, without its toes.

    Raises
    ------
    NotMeasurable
        The surface has a gap at the sole, or does not reach the floor.
    """
    plane = Plane.across(np.array([0.0, 0.0, CONTACT_MM]), UP)
    loops = foot.sections(plane)
    if any(loop.gap >= CLOSED_GAP_MM for loop in loops):
        raise NotMeasurable("the surface has a gap at the sole")
    outlines = [foot.smooth(loop, plane) for loop in loops]
    ball = _BallLine(foot)
    outlines = [
        outline
        for outline in outlines
        if abs(polygon_area(outline.points)) >= LEAST_MM2 and ball.ahead(outline.points).min() < TOES * foot.length_mm
    ]
    if not outlines:
        raise NotMeasurable("the foot does not reach the floor")
    points = np.concatenate([outline.points for outline in outlines])
    merged = bool(np.any(ball.ahead(points) > MERGED * foot.length_mm))
    limit = TOES * foot.length_mm if merged else np.inf
    behind = points[ball.ahead(points) <= limit]
    rear, front = float(behind[:, 0].min()), float(behind[:, 0].max())
    count = int(np.ceil((front - rear) / STEP_MM))
    if count < LEAST_SECTIONS:
        raise NotMeasurable("the foot reaches the floor with its toes only")
    stations = rear + (np.arange(count) + 0.5) * (front - rear) / count
    widths = _widths(outlines, stations, ball, limit)
    return Print(outlines, stations, widths, rear, front, "toes run into the print" if merged else None)


def arch_index(foot: FootSurface) -> Quantity:
    """Area of the middle third of the print over the whole.

    P. Cavanagh and M. Rodgers, "The arch index: a useful measure from footprints", J. Biomech. 20(5), 1987,
    doi:10.1016/0021-9290(87)90255-7.
    """
    contact = foot.once(footprint)
    third = (contact.front - contact.rear) / 3
    half = (contact.front - contact.rear) / len(contact.stations) / 2
    starts = np.maximum(contact.stations - half, contact.rear + third)
    stops = np.minimum(contact.stations + half, contact.rear + 2 * third)
    in_middle = np.maximum(stops - starts, 0.0) / (2 * half)
    index = float(in_middle @ contact.widths / contact.widths.sum())
    area = float(contact.widths.mean()) * (contact.front - contact.rear)
    ends = (_end(foot, contact, -1.0), _end(foot, contact, 1.0))
    gradient = np.zeros(len(foot.normals))
    for outline in contact.outlines:
        x = outline.points[:, 0]
        middle = (x > contact.rear + third) & (x <= contact.rear + 2 * third)
        gradient += foot.gradient(outline, _outwards(outline.points) * ((middle - index) / area)[:, None])
    first, second = (float(np.interp(contact.rear + k * third, contact.stations, contact.widths)) for k in (1, 2))
    gradient += (second - 2 * first) / (3 * area) * ends[0] + (2 * second - first) / (3 * area) * ends[1]
    return Quantity(index, gradient, contact.doubt, note=_HEIGHT)


def chippaux_smirak(foot: FootSurface) -> Quantity:
    """Least width of the middle third over the greatest of the front third."""
    return _ratio(foot, foot.once(footprint), 2)


def staheli(foot: FootSurface) -> Quantity:
    """Least width of the middle third over the greatest of the rear third."""
    return _ratio(foot, foot.once(footprint), 0)


def clarke_angle(foot: FootSurface) -> Quantity:
    """Angle in degrees between the medial tangent of the print and a line to the deepest point of the arch.

    The line starts on the tangent beside the head of the first metatarsal.
    """
    contact = foot.once(footprint)
    largest = max(contact.outlines, key=lambda outline: abs(polygon_area(outline.points)))
    points, thirds = largest.points, contact.rear + (contact.front - contact.rear) * np.array([1 / 3, 2 / 3])
    if not (points[:, 0].min() < thirds[0] and points[:, 0].max() > thirds[1]):
        raise NotMeasurable("the print is in two parts: its medial border does not run from heel to ball")
    corners = hull_corners(points)
    start, end = points[corners], points[np.roll(corners, -1)]
    middle = np.mean(thirds)
    over = np.flatnonzero((np.minimum(start[:, 0], end[:, 0]) < middle) & (np.maximum(start[:, 0], end[:, 0]) > middle))
    medial = max(over, key=lambda edge: float(start[edge, 1] + end[edge, 1]))
    heel, ball = sorted((int(corners[medial]), int(np.roll(corners, -1)[medial])), key=lambda k: float(points[k, 0]))
    tibiale = foot.place("metatarsale_tibiale").x
    forwards = (points[ball] - points[heel]) / np.linalg.norm(points[ball] - points[heel])
    inwards = np.array([forwards[1], -forwards[0]])
    corner = points[heel] + forwards * (tibiale.value - points[heel, 0]) / forwards[0]
    along, depth = (corner - points) @ forwards, (points - corner) @ inwards
    between = (points[:, 0] > points[heel, 0]) & (points[:, 0] < points[ball, 0])
    between &= points[:, 1] > (points[[heel, ball], 1].min() + points[:, 1].min()) / 2  # not the lateral border
    if not between.any():
        raise NotMeasurable("the print has no arch")
    place = along - along[np.argmax(np.where(between, depth, -np.inf))]
    near = np.flatnonzero(between & (np.abs(place) <= APEX_MM))
    weights = np.linalg.pinv(np.column_stack([place[near] ** k for k in range(3)]))
    level, slope, bend = weights @ depth[near]
    if len(near) < LEAST_POINTS or bend >= 0:
        raise NotMeasurable("the print has no arch")
    apex = float(np.clip(-slope / (2 * bend), -APEX_MM, APEX_MM))
    run, rise = float((along - place)[0]) + apex, float(level + apex * (slope + apex * bend))
    factor = np.rad2deg(1.0 / (run**2 + rise**2))
    by_points = np.zeros_like(points)
    by_points[near] = np.outer(factor * (run * weights[0] + rise * weights[1] / (2 * bend)), inwards)
    arch = Quantity(0.0, foot.gradient(largest, by_points), contact.doubt)
    degrees = float(np.rad2deg(np.arctan2(rise, run)))
    return combined(degrees, (1.0, arch), (-factor * rise, tibiale))._replace(note=_HEIGHT)


_HEIGHT = f"contact is up to {CONTACT_MM:g} mm above the floor"


class _BallLine:
    """The line through both metatarsal heads, on the floor."""

    def __init__(self, foot: FootSurface) -> None:
        self.medial = foot.place("metatarsale_tibiale").point[:2]
        self.lateral = foot.place("metatarsale_fibulare").point[:2]
        along, across = self.medial - self.lateral
        self.slope = max(along, LEAST_SLOPE * across) / across  # the first head is ahead of the fifth

    def ahead(self, points: Floats) -> Floats:
        """Returns (N,) distances in mm along X by which (N, 2) points lie ahead of the line."""
        x: Floats = points[:, 0] - self.lateral[0] - self.slope * (points[:, 1] - self.lateral[1])
        return x


def _widths(outlines: list[Outline], stations: Floats, ball: _BallLine, limit: float) -> Floats:
    """Returns (S,) widths of the print at (S,) even `stations`, up to `limit` mm ahead of the ball.

    The borders cross a station in alternating directions: the width is the sum of Y with the sign of the direction.
    """
    widths = np.zeros(len(stations))
    step = stations[1] - stations[0]
    for outline in outlines:
        start = outline.points
        end = np.roll(start, -1, axis=0)
        bounds = np.sort(np.column_stack([start[:, 0], end[:, 0]]), axis=1)
        first, last = np.clip(np.ceil((bounds - stations[0]) / step), 0, len(stations)).astype(np.int64).T
        side = np.repeat(np.arange(len(start)), last - first)
        station = np.arange(len(side)) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
        station += first[side]
        x = stations[station]
        along = end[side, 0] - start[side, 0]
        y = start[side, 1] + (x - start[side, 0]) / along * (end[side, 1] - start[side, 1])
        if np.isfinite(limit):
            border = ball.lateral[1] + (x - limit - ball.lateral[0]) / ball.slope  # by `limit` ahead of the ball
            y = np.maximum(y, border)
        widths += np.bincount(station, -np.sign(along) * np.sign(polygon_area(start)) * y, len(stations))
    return widths


def _ratio(foot: FootSurface, contact: Print, third: int) -> Quantity:
    bounds = np.linspace(contact.rear, contact.front, 4)
    middle = (contact.stations > bounds[1]) & (contact.stations <= bounds[2])
    other = (contact.stations > bounds[third]) & (contact.stations <= bounds[third + 1])
    least = _side_quantity(foot, contact, int(np.argmin(np.where(middle, contact.widths, np.inf))))
    most = _side_quantity(foot, contact, int(np.argmax(np.where(other, contact.widths, -np.inf))))
    ratio = least.value / most.value
    quantity = combined(ratio, (1 / most.value, least), (-ratio / most.value, most))
    return quantity._replace(doubt=contact.doubt, note=_HEIGHT)


def _end(foot: FootSurface, contact: Print, sign: float) -> Floats:
    """Returns (V,) derivatives of X at the rear (`sign` -1) or front (1) end of the print."""
    outline = max(contact.outlines, key=lambda outline: float((sign * outline.points[:, 0]).max()))
    by_points = np.zeros_like(outline.points)
    by_points[np.argmax(sign * outline.points[:, 0]), 0] = 1.0
    return foot.gradient(outline, by_points)


def _side_quantity(foot: FootSurface, contact: Print, station: int) -> Quantity:
    """The width of the print at one of its stations."""
    gradient = np.zeros(len(foot.normals))
    x = contact.stations[station]
    for outline in contact.outlines:
        points, ahead = outline.points, np.roll(outline.points, -1, axis=0)
        spans = np.flatnonzero((points[:, 0] > x) != (ahead[:, 0] > x))
        outwards = _outwards(points)
        by_points = np.zeros_like(points)
        by_points[spans, 1] = np.sign(outwards[spans, 1])
        if len(spans):
            gradient += foot.gradient(outline, by_points)
    return Quantity(float(contact.widths[station]), gradient)


def _outwards(polygon: Floats) -> Floats:
    """Returns (N, 2) derivatives of the polygon's area by its points."""
    chord = np.roll(polygon, -1, axis=0) - np.roll(polygon, 1, axis=0)
    outwards: Floats = 0.5 * np.sign(polygon_area(polygon)) * np.column_stack([chord[:, 1], -chord[:, 0]])
    return outwards

"""Measures and landmarks of a foot from its exact surface, by rays and plane sections of the field; no mesh takes part.

====================  ==============================================================================================
measure               definition (canonical frame: pternion at X = 0, axis pternion - tip of toe 2 along X, floor Z = 0)
====================  ==============================================================================================
foot_length           X of the tip of the longest toe
ball_length           X of metatarsale tibiale, the most medial point within 0.66 to 0.80 of the length, Z <= 45
lateral_ball_length   X of metatarsale fibulare, the most lateral point within 0.56 to 0.72 of the length, Z <= 40
foot_breadth          Y from metatarsale fibulare to metatarsale tibiale
heel_breadth          largest Y - smallest Y within 0.10 to 0.20 of the length, Z <= 40
instep_height         largest Z of the section at half the length
toe_height            largest Z of toe 1 in the section 12.5 mm behind its tip
arch_height           largest Z of the sole within 0.30 to 0.60 of the length, on the line parallel to the axis that
                      lies a third of the midfoot's width (section at half the length) from its medial edge
ball_girth            vertical plane through both metatarsal points
instep_girth          plane across the axis at half the length
waist_girth           plane across the axis midway between half the length and the middle of the metatarsal points
heel_girth            plane through landing point and junction point, containing the Y direction
arch_index            contact (Z <= 1) of the middle third over the whole contact without toes, whose length is divided
                      in three (Cavanagh and Rodgers 1987); a ratio
scan_height           Z of the flat cut through the leg
====================  ==============================================================================================

A girth is what a tape reads: the perimeter of the section's convex hull. The landing point is the middle of the heel's
contact (Z <= 1, X within 0.05 to 0.25 of the length); the junction point is the point of the side view's outline, with
X > 50 and 20 < Z < 100, that is nearest to (50, 20); on a foot shorter than 200 these lengths shrink in proportion, and
so do the heights up to which the metatarsal points lie.
"""

import math

import numpy as np
from scipy.spatial import ConvexHull

from footscan.virtual.foot.field import Field, Floats, field_values, first_hits, without_toes

Point = tuple[float, float, float]

OUTSIDE_MM = 90.0
"""Farther from the axis than any point of a foot."""
CONTACT_MM = 1.0
"""The sole touches the floor up to this height: part of the definitions above."""
ALONG_MM = 0.1
"""Length of the cells of a print that is divided in three: with 0.5 the arch index jumps by 0.002."""
ADULT_MM = 200.0
"""Length of a foot below which windows shrink: part of the definitions above."""
RAYS = 1440
"""Rays of a girth; four times as many change no girth by 0.002 mm."""


def known_landmarks(field: Field, length: float) -> dict[str, Point]:
    """Metatarsal, landing and junction point, (X, Y, Z), extremes to 0.001 along their own direction.

    Here and below, lengths are those of the field: mm over its size.
    """
    tibiale, fibulare = metatarsal_points(field, length)
    return {
        "metatarsale_tibiale": tibiale,
        "metatarsale_fibulare": fibulare,
        "landing_point": _landing_point(field, length),
        "junction_point": _junction_point(field, length),
    }


def known_measures(
    field: Field, length: float, toe1_tip: Point | None, landmarks: dict[str, Point]
) -> dict[str, float]:
    """The table's measures but scan_height: lengths and heights to 0.001, girths to 0.01, arch index to 0.001.

    Without toe 1 there is no `toe_height`.
    """
    tibiale, fibulare = landmarks["metatarsale_tibiale"], landmarks["metatarsale_fibulare"]
    waist_x = 0.5 * (0.5 * length + 0.5 * (tibiale[0] + fibulare[0]))
    return {
        "foot_length": length,
        "ball_length": tibiale[0],
        "lateral_ball_length": fibulare[0],
        "foot_breadth": tibiale[1] - fibulare[1],
        "heel_breadth": heel_breadth(field, length),
        "instep_height": instep_height(field, length),
        **({} if toe1_tip is None else {"toe_height": toe_height(field, toe1_tip)}),
        "arch_height": arch_height(field, length),
        "ball_girth": ball_girth(field, tibiale, fibulare),
        "instep_girth": girth(field, (0.5 * length, 0.0, 25.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        "waist_girth": girth(field, (waist_x, 0.0, 20.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        "heel_girth": _heel_girth(field, landmarks["landing_point"], landmarks["junction_point"]),
        "arch_index": arch_index(field, length),
    }


def metatarsal_points(field: Field, length: float) -> tuple[Point, Point]:
    """Metatarsale tibiale and fibulare, see the table."""
    shrunk = _shrunk(field, length)
    tibiale = most_medial(field, (0.66 * length, 0.80 * length), 45.0 * shrunk)
    return tibiale, most_lateral(field, (0.56 * length, 0.72 * length), 40.0 * shrunk)


def arch_index(field: Field, length: float) -> float:
    """See the table."""
    x, _ = _contact(without_toes(field), 0.0, length, ALONG_MM)
    rear, third = x.min(), (x.max() - x.min()) / 3
    return float(np.mean((x > rear + third) & (x <= rear + 2 * third)))


def most_medial(field: Field, x_range: tuple[float, float], z_max: float) -> Point:
    """The surface point of largest Y with X in `x_range` and 2 mm <= Z <= `z_max`, mm."""
    return _extreme_side(field, x_range, z_max / field.size, 1.0)


def most_lateral(field: Field, x_range: tuple[float, float], z_max: float) -> Point:
    """The surface point of smallest Y, likewise."""
    return _extreme_side(field, x_range, z_max / field.size, -1.0)


def foremost_x(field: Field, beyond: float) -> float:
    """The largest X of the surface with 2 mm <= Z <= 60 mm; `beyond` lies in front of all of it."""
    y_low, y_high, z_low, z_high, largest = -70.0, 70.0, 2.0, 60.0, 0.0
    for zoom in range(8):
        nodes = 41 if zoom == 0 else 9
        y, z = (
            grid.ravel() for grid in np.meshgrid(np.linspace(y_low, y_high, nodes), np.linspace(z_low, z_high, nodes))
        )
        origins = np.column_stack([np.full(len(y), beyond), y, z])
        x = beyond - first_hits(origins, np.tile([-1.0, 0.0, 0.0], (len(y), 1)), beyond, field)
        best = int(np.argmax(x))
        largest = float(x[best])
        y_step, z_step = 1.2 * (y_high - y_low) / (nodes - 1), 1.2 * (z_high - z_low) / (nodes - 1)
        y_low, y_high = y[best] - y_step, y[best] + y_step
        z_low, z_high = max(z[best] - z_step, 2.0), min(z[best] + z_step, 60.0)
    return largest


def heel_breadth(field: Field, length: float) -> float:
    """See the table."""
    window = (0.10 * length, 0.20 * length)
    return most_medial(field, window, 40.0)[1] - most_lateral(field, window, 40.0)[1]


def instep_height(field: Field, length: float) -> float:
    """See the table."""
    return top_height(field, 0.5 * length, (-40.0, 40.0))


def top_height(field: Field, x: float, y_range: tuple[float, float]) -> float:
    """The largest Z of the section at `x`, Y within `y_range`."""
    low, high = y_range
    for _ in range(7):
        y = np.linspace(low, high, 17)
        z = _drop(field, np.full_like(y, x), y)
        best, step = y[np.argmax(z)], y[1] - y[0]
        low, high = best - 1.5 * step, best + 1.5 * step
    return float(z.max())


def toe_height(field: Field, toe1_tip: Point) -> float:
    """See the table."""
    return top_height(field, toe1_tip[0] - 12.5 / field.size, (toe1_tip[1] - 8.0, toe1_tip[1] + 8.0))


def arch_height(field: Field, length: float) -> float:
    """See the table."""
    middle = (0.5 * length, 0.5 * length)
    medial, lateral = most_medial(field, middle, 60.0)[1], most_lateral(field, middle, 60.0)[1]
    y = medial - (medial - lateral) / 3
    low, high = 0.30 * length, 0.60 * length
    for _ in range(6):
        x = np.linspace(low, high, 17)
        z = _rise(field, x, np.full_like(x, y))
        best, step = x[np.argmax(z)], x[1] - x[0]
        low, high = max(best - 1.5 * step, 0.30 * length), min(best + 1.5 * step, 0.60 * length)
    return float(z.max())


def ball_girth(field: Field, tibiale: Point, fibulare: Point) -> float:
    """See the table."""
    middle = (0.5 * (tibiale[0] + fibulare[0]), 0.5 * (tibiale[1] + fibulare[1]), 15.0)
    across = np.array([tibiale[0] - fibulare[0], tibiale[1] - fibulare[1], 0.0])
    across /= np.sqrt((across**2).sum())
    return girth(field, middle, (across[0], across[1], 0.0), (0.0, 0.0, 1.0))


def girth(field: Field, inside: Point, first: Point, second: Point) -> float:
    """Perimeter of the convex hull of the section in the plane of two unit vectors through a point of the foot, mm.

    Rays come from outside, so they find every point of the hull whatever the section's shape.
    """
    angles = np.linspace(0, 2 * np.pi, RAYS, endpoint=False)
    turns = np.array([(math.cos(angle), math.sin(angle)) for angle in angles])
    spokes = turns[:, :1] * np.array(first) + turns[:, 1:] * np.array(second)
    distances = OUTSIDE_MM - first_hits(np.array(inside) + OUTSIDE_MM * spokes, -spokes, OUTSIDE_MM, field)
    section = distances[:, None] * turns
    return float(ConvexHull(section).area)  # in two dimensions the area of the hull's border is its length


def _extreme_side(field: Field, x_range: tuple[float, float], z_max: float, sign: float) -> Point:
    lowest = 2.0 / field.size
    x_low, x_high, z_low, z_high = *x_range, lowest, z_max
    best = (0.0, 0.0, 0.0)
    for zoom in range(10):
        nodes = 13 if zoom == 0 else 7
        x, z = np.meshgrid(np.linspace(x_low, x_high, nodes), np.linspace(z_low, z_high, nodes))
        origins = np.column_stack([x.ravel(), np.full(x.size, sign * OUTSIDE_MM), z.ravel()])
        directions = np.tile([0.0, -sign, 0.0], (x.size, 1))
        distances = first_hits(origins, directions, OUTSIDE_MM, field)
        k = int(np.argmin(distances))
        best = (float(origins[k, 0]), sign * (OUTSIDE_MM - float(distances[k])), float(origins[k, 2]))
        x_step, z_step = (x_high - x_low) / (nodes - 1), (z_high - z_low) / (nodes - 1)
        x_low, x_high = max(best[0] - 1.2 * x_step, x_range[0]), min(best[0] + 1.2 * x_step, x_range[1])
        z_low, z_high = max(best[2] - 1.2 * z_step, lowest), min(best[2] + 1.2 * z_step, z_max)
    return best


def _landing_point(field: Field, length: float) -> Point:
    x, y = _contact(field, 0.05 * length, 0.25 * length)
    return (float(x.mean()), float(y.mean()), 0.0)


def _contact(field: Field, x_low: float, x_high: float, along: float = 0.5) -> tuple[Floats, Floats]:
    """X and Y of the cells of `along` x 0.5 where the sole is at most CONTACT_MM high: there the foot holds that
    height."""
    x, y = np.meshgrid(np.arange(x_low, x_high, along) + along / 2, np.arange(-OUTSIDE_MM, OUTSIDE_MM, 0.5) + 0.25)
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, CONTACT_MM / field.size)])
    inside = field_values(points, field) <= 0
    return points[inside, 0], points[inside, 1]


def _shrunk(field: Field, length: float) -> float:
    """By how much windows shrink on a small foot."""
    return min(1.0, length * field.size / ADULT_MM)


def _junction_point(field: Field, length: float) -> Point:
    best = (0.0, 0.0, 0.0)
    unit = _shrunk(field, length) / field.size
    y_low, y_high, z_low, z_high = -25.0, 25.0, 40.0 * unit, 99.0 * unit
    for _ in range(8):
        z = np.linspace(z_low, z_high, 13)
        y = np.linspace(y_low, y_high, 9)
        yy, zz = np.meshgrid(y, z)
        origins = np.column_stack([np.full(yy.size, 320.0), yy.ravel(), zz.ravel()])
        x = 320.0 - first_hits(origins, np.tile([-1.0, 0.0, 0.0], (yy.size, 1)), 320.0, field).reshape(yy.shape)
        outline = x.max(axis=1)
        row = int(np.argmin((outline - 50.0 * unit) ** 2 + (z - 20.0 * unit) ** 2))
        column = int(np.argmax(x[row]))
        best = (float(x[row, column]), float(y[column]), float(z[row]))
        y_step, z_step = y[1] - y[0], z[1] - z[0]
        y_low, y_high = best[1] - 1.5 * y_step, best[1] + 1.5 * y_step
        z_low, z_high = best[2] - 1.5 * z_step, best[2] + 1.5 * z_step
    return best


def _heel_girth(field: Field, landing: Point, junction: Point) -> float:
    middle = (0.5 * (landing[0] + junction[0]), 0.0, 0.5 * (landing[2] + junction[2]))
    up = np.array([junction[0] - landing[0], 0.0, junction[2] - landing[2]])
    up /= np.sqrt((up**2).sum())
    return girth(field, middle, (0.0, 1.0, 0.0), (up[0], 0.0, up[2]))


def _drop(field: Field, x: Floats, y: Floats) -> Floats:
    """Z where a ray from above meets the foot."""
    origins = np.column_stack([x, y, np.full_like(x, 115.0)])
    distances: Floats = first_hits(origins, np.tile([0.0, 0.0, -1.0], (len(x), 1)), 125.0, field)
    return 115.0 - distances


def _rise(field: Field, x: Floats, y: Floats) -> Floats:
    """Z where a ray from below meets the foot."""
    origins = np.column_stack([x, y, np.full_like(x, -1.0)])
    distances: Floats = first_hits(origins, np.tile([0.0, 0.0, 1.0], (len(x), 1)), 125.0, field)
    return distances - 1.0

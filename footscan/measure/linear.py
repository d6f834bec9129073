"""Lengths, breadths, heights and angles of a foot in its own frame, in mm and degrees."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_surface import ACROSS, UP, FootSurface, LandmarkQuantities, nearest_loop
from footscan.measure.girths import upright_plane
from footscan.measure.outline import Outline, Plane
from footscan.measure.quantity import NotMeasurable, Quantity, combined

Floats = NDArray[np.float64]

LOW_MM = 60.0
"""Height below which the midfoot's breadth is taken; part of its definition."""
HALLUX_STATION_MM = 12.5
"""Distance behind the tip of the big toe, about at its nail; part of the definition of the toe height."""
HALLUX_HALF_BREADTH_MM = 8.0
"""Half the breadth of the big toe in which its height is taken, since toes may be merged; chosen by hand."""
LEAST_TOE_MM = 20.0
"""Shorter loops are no section of a big toe; chosen by hand."""
BREADTH_WINDOW = (0.55, 0.85)
"""Shares of the length between which the largest breadth is taken; part of its definition."""
HEEL_WINDOW, HEEL_HEIGHT_MM = (0.10, 0.20), 40.0
"""Shares of the length and height in which the heel's breadth is taken; part of its definition."""
LIFTED_MM = 5.0
"""A section whose lowest point is higher does not stand on the floor. Chosen by hand."""
CUT_OFF = "the foot is lifted here, and broadest at the height up to which its breadth is taken"
"""Doubt about a breadth: a heel that is lifted by 25 mm is 1 mm too narrow below 40 mm, one by 30 mm 3.5 mm."""
STATION_SHARE = 0.01
"""Distance between the sections of a window, as a share of the length."""
STATIONS_NEAR = 5
"""Sections on either side of the broadest one to which a cubic is fitted; chosen by hand."""
ARCH_WINDOW = (0.30, 0.60)
"""Shares of the length between which the arch is taken; part of its definition."""
TOE_REGION = 0.12
"""Length of a toe's side behind its tip, as a share of the foot length; chosen by hand."""
TOE_HEIGHT_MM = 35.0
"""Height below which a toe's side lies; chosen by hand."""
TOE_FROM_BALL_MM = 5.0
"""A toe's side begins at least this far ahead of the metatarsal head; chosen by hand."""
HEEL_LEVELS = (0.06, 0.20)
"""Heights of the middle of the heel's rear, as shares of the length; the upper one is at the Achilles tendon. Part of
the definition of the heel angle."""
HEEL_DEPTH_MM = 15.0
"""Distance ahead of the heel's rear at which its middle is taken; chosen by hand."""
HEEL_SEED = 0.15
"""Share of the length at which a point within the heel lies."""


def foot_length(foot: FootSurface) -> Quantity:
    """Length from the rearmost heel point to the longest toe, along the axis."""
    whole, heel = foot.station(1.0), foot.station(0.0)
    return Quantity(foot.length_mm, whole.gradient - heel.gradient)


def along_axis(foot: FootSurface, name: str) -> Quantity:
    """Length from the rearmost heel point to a landmark, along the axis."""
    return foot.place(name).x.minus(foot.station(0.0))


def toe_length(foot: FootSurface) -> Quantity:
    """Length from the head of the first metatarsal to the longest toe, along the axis."""
    return foot.station(1.0).minus(foot.place("metatarsale_tibiale").x)


def across_axis(foot: FootSurface, medial: str, lateral: str) -> Quantity:
    """Horizontal distance of two landmarks across the axis."""
    return foot.place(medial).y.minus(foot.place(lateral).y)


def height(foot: FootSurface, name: str) -> Quantity:
    """Height of a landmark above the floor."""
    return foot.place(name).z


def foot_breadth_diagonal(foot: FootSurface) -> Quantity:
    """Horizontal distance of both metatarsal heads."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    along, across = (medial.point - lateral.point)[:2]
    length = float(np.hypot(along, across))
    x, y = medial.x.minus(lateral.x), medial.y.minus(lateral.y)
    return combined(length, (along / length, x), (across / length, y))


def foot_breadth_max(foot: FootSurface) -> Quantity:
    """Breadth between the tangents parallel to the axis that touch the foot between 0.55 and 0.85 of its length."""
    inside = (foot.place("metatarsale_tibiale").point + foot.place("metatarsale_fibulare").point) / 2
    return _broadest(foot, BREADTH_WINDOW, inside, np.inf)


def heel_breadth(foot: FootSurface) -> Quantity:
    """Breadth of the heel across the axis, from its most medial to its most lateral point.

    If one of these landmarks was set by hand, the breadth is that between the landmarks.
    """
    landmarks = foot.landmarks
    if any(name in landmarks and landmarks[name].method == "manual" for name in ("heel_medial", "heel_lateral")):
        return across_axis(foot, "heel_medial", "heel_lateral")
    return _broadest(foot, HEEL_WINDOW, np.array([0.0, 0.0, HEEL_HEIGHT_MM / 2]), HEEL_HEIGHT_MM)


def midfoot_breadth(foot: FootSurface) -> Quantity:
    """Breadth of the section at half the foot length."""
    medial, lateral = foot.once(_midfoot_sides)
    return combined(medial.value + lateral.value, (1.0, medial), (1.0, lateral))


def ball_angle(foot: FootSurface) -> Quantity:
    """Angle between the line through both metatarsal heads and the axis; 90 degrees if the line is straight across."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    return _angle(lateral, medial)


def ball_height(foot: FootSurface) -> Quantity:
    """Height of the section through both metatarsal heads."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")

    def top(medial_x: float, lateral_x: float) -> Quantity:
        first, second = (np.array([x, *place.point[1:]]) for x, place in ((medial_x, medial), (lateral_x, lateral)))
        plane, inside = upright_plane(first, second)
        return farthest(foot, foot.outline(plane, inside), 1, 1.0, plane.point[2])

    at = medial.x.value, lateral.x.value
    highest = top(*at)
    slopes = _slope(lambda x: top(x, at[1]).value, at[0]), _slope(lambda x: top(at[0], x).value, at[1])
    return combined(highest.value, (1.0, highest), (slopes[0], medial.x), (slopes[1], lateral.x))


def instep_height(foot: FootSurface) -> Quantity:
    """Height of the section at half the foot length."""
    inside = foot.midfoot.plane.point
    slope = _slope(lambda x: float(_across(foot, x, inside).points[:, 1].max()), inside[0])
    top = farthest(foot, foot.midfoot, 1, 1.0, inside[2])
    return combined(top.value, (1.0, top), (slope, foot.station(0.5)))


def arch_height_index(foot: FootSurface) -> Quantity:
    """Instep height over the length from the heel to the head of the first metatarsal."""
    top, length = foot.once(instep_height), along_axis(foot, "metatarsale_tibiale")
    index = top.value / length.value
    return combined(index, (1 / length.value, top), (-index / length.value, length))


def toe_height(foot: FootSurface) -> Quantity:
    """Height of the big toe, 12.5 mm behind its tip."""
    tip = foot.place("toe_1_tip")

    def top(x: float) -> Quantity:
        at = np.array([x, tip.y.value, 0.5 * tip.z.value])
        plane = Plane.across(at, ACROSS)
        loop = nearest_loop(foot.sections(plane), plane, at, LEAST_TOE_MM)
        if loop is None or loop.gap > 0:
            raise NotMeasurable("the surface has a gap at the big toe")
        outline = foot.smooth(loop, plane)
        middle = np.abs(outline.points[:, 0]) <= HALLUX_HALF_BREADTH_MM  # merged toes are broader
        return farthest(foot, outline, 1, 1.0, at[2], among=middle)

    x = tip.x.value - HALLUX_STATION_MM
    highest = top(x)
    return combined(highest.value, (1.0, highest), (_slope(lambda at: top(at).value, x), tip.x))


def arch_height(foot: FootSurface) -> Quantity:
    """Height of the sole on the line parallel to the axis, a third of the midfoot's breadth from its medial edge."""
    medial, lateral = foot.once(_midfoot_sides)
    inside = foot.midfoot.plane.point
    y = medial.value - (medial.value + lateral.value) / 3
    at = np.array([inside[0], y, inside[2]])
    plane = Plane.across(at, np.array([0.0, 1.0, 0.0]))
    outline = foot.outline(plane, at)
    x, z = plane.solid(outline.points)[:, 0] / foot.length_mm, outline.points[:, 1] + at[2]
    window = (x >= ARCH_WINDOW[0]) & (x <= ARCH_WINDOW[1]) & (z < inside[2])
    if not window.any():
        raise NotMeasurable("the surface has no sole here")
    return farthest(foot, outline, 1, 1.0, at[2], among=window)


def toe_1_angle(foot: FootSurface) -> Quantity:
    """Angle of the big toe's medial side against the line from heel to head of the first metatarsal.

    Positive where the toe turns to the lateral side (hallux valgus).
    """
    return _toe_angle(foot, "heel_medial", "metatarsale_tibiale", "toe_1_tip", 1.0)


def toe_5_angle(foot: FootSurface) -> Quantity:
    """Angle of the little toe's lateral side against the line from heel to head of the fifth metatarsal.

    Positive where the toe turns to the medial side.
    """
    return _toe_angle(foot, "heel_lateral", "metatarsale_fibulare", "toe_5_tip", -1.0)


def heel_angle(foot: FootSurface) -> Quantity:
    """Angle of the heel against the vertical, seen from behind.

    The angle is that of the line through the middle of the heel's rear at two heights, positive where the heel leans to
    the medial side upwards (valgus).
    """
    low, high = (_heel_middle(foot, share * foot.length_mm) for share in HEEL_LEVELS)
    rise = (HEEL_LEVELS[1] - HEEL_LEVELS[0]) * foot.length_mm
    lean = high.value - low.value
    degrees = np.rad2deg(rise / (rise**2 + lean**2))
    return combined(float(np.rad2deg(np.arctan2(lean, rise))), (degrees, high), (-degrees, low))


def scan_height(foot: FootSurface) -> Quantity:
    """Height of the highest point of the surface."""
    return Quantity(foot.top, np.full(len(foot.normals), np.nan))  # the noise of a rim is unknown


def farthest(
    foot: FootSurface,
    outline: Outline,
    axis: int,
    sign: float,
    origin: float = 0.0,
    among: NDArray[np.bool_] | None = None,
) -> Quantity:
    """Reach of an outline along `sign` times one of its two axes, from the plane's point, plus `origin`; mm.

    Parameters
    ----------
    among : (N,) points of the outline that are considered; default: all

    Raises
    ------
    NotMeasurable
        No point is considered.
    """
    if among is not None and not among.any():
        raise NotMeasurable("the surface is not where this section is measured")
    reach = sign * outline.points[:, axis]
    point = int(np.argmax(reach if among is None else np.where(among, reach, -np.inf)))
    by_points = np.zeros_like(outline.points)
    by_points[point, axis] = sign
    return Quantity(float(reach[point]) + origin, foot.gradient(outline, by_points))


def _across(foot: FootSurface, x: float, inside: Floats) -> Outline:
    at = np.array([x, inside[1], inside[2]])
    return foot.outline(Plane.across(at, ACROSS), at)


def _broadest(foot: FootSurface, window: tuple[float, float], inside: Floats, height: float) -> Quantity:
    """Breadth from the most medial to the most lateral point, up to a height in mm.

    Parameters
    ----------
    window : shares of the length along X
    inside : (3,) mm, a point within the foot, whose X is not used
    """
    count = round((window[1] - window[0]) / STATION_SHARE) + 1
    outlines = [_across(foot, float(x), inside) for x in np.linspace(*window, count) * foot.length_mm]
    sides = [_farthest_of(foot, outlines, sign, height - inside[2]) for sign in (1.0, -1.0)]
    return combined(sides[0].value + sides[1].value, (1.0, sides[0]), (1.0, sides[1]))


def _farthest_of(foot: FootSurface, outlines: list[Outline], sign: float, height: float) -> Quantity:
    """Reach to one side of the farthest of evenly spaced sections.

    A cubic is fitted to the sections near it, since noise puts the farthest of many sections too far out.
    """
    reach = [_reach(outline, sign, height) for outline in outlines]
    best = int(np.argmax([section.most for section in reach]))
    near = np.arange(max(best - STATIONS_NEAR, 0), min(best + STATIONS_NEAR + 1, len(outlines)))
    terms = np.vander((near - best) / STATIONS_NEAR, 4)
    hat = terms @ np.linalg.pinv(terms)
    fitted = hat @ [reach[k].most for k in near]
    weights = hat[np.argmax(fitted)]
    gradient = np.zeros(len(foot.normals))
    for k, weight in zip(near, weights, strict=True):
        by_points = np.zeros_like(outlines[k].points)
        by_points[reach[k].point, 0] = sign * weight
        gradient += foot.gradient(outlines[k], by_points)
    return Quantity(float(fitted.max()), gradient, CUT_OFF if reach[best].is_cut_off else None)


class _Reach(NamedTuple):
    """How far an outline reaches to one side."""

    most: float
    """mm"""
    point: int
    """The number of the point there"""
    is_cut_off: bool
    """It is lifted, and reaches farther above that height"""


def _reach(outline: Outline, sign: float, height: float) -> _Reach:
    """The reach of an outline to one side up to a height in its plane."""
    across, up = sign * outline.points[:, 0], outline.points[:, 1]
    reach = np.where(up <= height, across, -np.inf)
    ahead = np.roll(np.arange(len(up)), -1)
    spans = np.flatnonzero((up > height) != (up[ahead] > height))
    share = (height - up[spans]) / (up[ahead[spans]] - up[spans])
    crossing = across[spans] + share * (across[ahead[spans]] - across[spans])
    reach[spans] = np.maximum(reach[spans], crossing)
    most = int(np.argmax(reach))
    if np.isinf(reach[most]):
        raise NotMeasurable("the surface does not reach down to where its breadth is taken")
    is_lifted = up.min() + outline.plane.point[2] > LIFTED_MM
    return _Reach(float(reach[most]), most, bool(is_lifted and crossing.max(initial=-np.inf) >= reach[most]))


def _slope(function: Callable[[float], float], at: float) -> float:
    return (function(at + 1.0) - function(at - 1.0)) / 2


def _midfoot_sides(foot: FootSurface) -> tuple[Quantity, Quantity]:
    """Returns Y of the medial end of the section at half the foot length, and -Y of its lateral end."""
    outline, inside = foot.midfoot, foot.midfoot.plane.point
    low = outline.points[:, 1] + inside[2] <= LOW_MM

    def side(sign: float) -> Quantity:
        reach = farthest(foot, outline, 0, sign, sign * inside[1], among=low)
        return reach._replace(doubt=CUT_OFF) if _reach(outline, sign, LOW_MM - inside[2]).is_cut_off else reach

    return side(1.0), side(-1.0)


def _angle(start: LandmarkQuantities, end: LandmarkQuantities) -> Quantity:
    """Horizontal angle of the line between two points against the axis, degrees."""
    along, across = (end.point - start.point)[:2]
    factor = float(np.rad2deg(1.0 / (along**2 + across**2)))
    x, y = end.x.minus(start.x), end.y.minus(start.y)
    return combined(float(np.rad2deg(np.arctan2(across, along))), (factor * along, y), (-factor * across, x))


def _toe_angle(foot: FootSurface, heel: str, ball: str, tip: str, medial: float) -> Quantity:
    """Angle between the line from heel to ball and the tangent from the ball to the side of a toe, degrees.

    Parameters
    ----------
    medial : 1 on the medial side of the foot, -1 on the lateral side
    """
    base = _angle(foot.place(heel), foot.place(ball))
    ball_place, end = foot.place(ball), foot.place(tip).x.value
    x, y, z = foot.mesh.vertices.T
    is_toe = (x > end - TOE_REGION * foot.length_mm) & (x > ball_place.x.value + TOE_FROM_BALL_MM)
    toe = np.flatnonzero(is_toe & (z < TOE_HEIGHT_MM))
    if not len(toe):
        raise NotMeasurable("the surface has no toe here")
    along, across = x[toe] - ball_place.x.value, medial * (y[toe] - ball_place.y.value)
    steepness = across / along
    touching = int(np.argmax(steepness))
    leans = medial * float(np.rad2deg(np.arctan(steepness[touching])))
    toe_gradient = np.zeros(len(x))
    toe_gradient[toe[touching]] = 1.0
    factor = float(np.rad2deg(1.0 / (along[touching] ** 2 + across[touching] ** 2))) * along[touching]
    value = medial * (base.value - leans)
    return combined(value, (medial, base), (-factor, Quantity(0.0, toe_gradient)), (medial * factor, ball_place.y))


def _heel_middle(foot: FootSurface, level: float) -> Quantity:
    """Y midway between the sides of the heel at the height `level` in mm, 15 mm ahead of its rear there."""
    seed = np.array([HEEL_SEED * foot.length_mm, 0.0, level])
    heel = foot.outline(Plane.across(seed, UP), seed)  # the axes of this plane are those of the foot
    points, ahead = heel.points, np.roll(heel.points, -1, axis=0)
    x = float(points[:, 0].min()) + HEEL_DEPTH_MM
    spans = np.flatnonzero((points[:, 0] > x) != (ahead[:, 0] > x))
    if not len(spans):
        raise NotMeasurable("the surface has no heel here")
    share = (x - points[spans, 0]) / (ahead[spans, 0] - points[spans, 0])
    y = points[spans, 1] + share * (ahead[spans, 1] - points[spans, 1])
    by_points = np.zeros_like(points)
    for end in (int(np.argmin(y)), int(np.argmax(y))):
        by_points[spans[end], 1] += 0.5 * (1 - share[end])
        by_points[(spans[end] + 1) % len(points), 1] += 0.5 * share[end]
    return Quantity(float(y.min() + y.max()) / 2, foot.gradient(heel, by_points))

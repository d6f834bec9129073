"""Lengths, breadths, heights and angles of a foot, in its own frame: mm, degrees."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_surface import ACROSS, UP, FootSurface, Place, nearest_loop
from footscan.measure.girths import upright_plane
from footscan.measure.outline import Outline, Plane
from footscan.measure.quantity import NotThere, Quantity, combined

Floats = NDArray[np.float64]

LOW_MM = 60.0
"""Up to here there is foot, and no leg."""
HALLUX_STATION_MM = 12.5
"""Behind the tip of the big toe: about its nail."""
HALLUX_HALF_BREADTH_MM = 8.0
LEAST_TOE_MM = 20.0
BREADTH_WINDOW = (0.55, 0.85)
HEEL_WINDOW, HEEL_HEIGHT_MM = (0.10, 0.20), 40.0
STATION_SHARE = 0.01
"""Of the foot length: between the sections of a window."""
STATIONS_NEAR = 5
ARCH_WINDOW = (0.30, 0.60)
TOE_REGION = 0.12
"""Of the foot length: how far behind its tip a toe's side is looked at."""
TOE_HEIGHT_MM = 35.0
HEEL_LEVELS = (0.06, 0.20)
"""Of the foot length: heights at which the middle of the heel's rear is taken; the upper is at the Achilles tendon."""
HEEL_DEPTH_MM = 15.0


def foot_length(foot: FootSurface) -> Quantity:
    """From the rearmost heel point to the longest toe, along the axis."""
    whole, heel = foot.station(1.0), foot.station(0.0)
    return Quantity(foot.length_mm, whole.gradient - heel.gradient)


def along_axis(foot: FootSurface, name: str) -> Quantity:
    """From the rearmost heel point to a landmark, along the axis."""
    return foot.place(name).x.minus(foot.station(0.0))


def toe_length(foot: FootSurface) -> Quantity:
    """From the head of the first metatarsal to the longest toe, along the axis."""
    return foot.station(1.0).minus(foot.place("metatarsale_tibiale").x)


def across_axis(foot: FootSurface, medial: str, lateral: str) -> Quantity:
    """Between two landmarks, across the axis, on the level."""
    return foot.place(medial).y.minus(foot.place(lateral).y)


def height(foot: FootSurface, name: str) -> Quantity:
    """Of a landmark above the floor."""
    return foot.place(name).z


def foot_breadth_diagonal(foot: FootSurface) -> Quantity:
    """Between both metatarsal heads, on the level."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    along, across = (medial.point - lateral.point)[:2]
    length = float(np.hypot(along, across))
    x, y = medial.x.minus(lateral.x), medial.y.minus(lateral.y)
    return combined(length, (along / length, x), (across / length, y))


def foot_breadth_max(foot: FootSurface) -> Quantity:
    """Between the tangents parallel to the axis, wherever the foot touches them between 0.55 and 0.85 of its length."""
    inside = (foot.place("metatarsale_tibiale").point + foot.place("metatarsale_fibulare").point) / 2
    return _broadest(foot, BREADTH_WINDOW, inside, np.inf)


def heel_breadth(foot: FootSurface) -> Quantity:
    """Between the most medial and the most lateral point of the heel, across the axis; of landmarks where those were
    set by hand."""
    landmarks = foot.landmarks
    if any(name in landmarks and landmarks[name].method == "manual" for name in ("heel_medial", "heel_lateral")):
        return across_axis(foot, "heel_medial", "heel_lateral")
    return _broadest(foot, HEEL_WINDOW, np.array([0.0, 0.0, HEEL_HEIGHT_MM / 2]), HEEL_HEIGHT_MM)


def midfoot_breadth(foot: FootSurface) -> Quantity:
    """Of the section at half the foot length."""
    medial, lateral = foot.once(_midfoot_sides)
    return combined(medial.value + lateral.value, (1.0, medial), (1.0, lateral))


def ball_angle(foot: FootSurface) -> Quantity:
    """Between the line through both metatarsal heads and the axis; 90 where it is straight across."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    return _angle(lateral, medial)


def ball_height(foot: FootSurface) -> Quantity:
    """Of the section through both metatarsal heads."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")

    def top(medial_x: float, lateral_x: float) -> Quantity:
        first, second = (np.array([x, *place.point[1:]]) for x, place in ((medial_x, medial), (lateral_x, lateral)))
        plane, inside = upright_plane(first, second)
        return farthest(foot, foot.outline(plane, inside), 1, 1.0, plane.point[2])

    at = medial.x.value, lateral.x.value
    found = top(*at)
    slopes = _slope(lambda x: top(x, at[1]).value, at[0]), _slope(lambda x: top(at[0], x).value, at[1])
    return combined(found.value, (1.0, found), (slopes[0], medial.x), (slopes[1], lateral.x))


def instep_height(foot: FootSurface) -> Quantity:
    """Of the section at half the foot length."""
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
    """Of the big toe, 12.5 mm behind its tip."""
    tip = foot.place("toe_1_tip")

    def top(x: float) -> Quantity:
        at = np.array([x, tip.y.value, 0.5 * tip.z.value])
        plane = Plane.across(at, ACROSS)
        loop = nearest_loop(foot.sections(plane), plane, at, LEAST_TOE_MM)
        if loop is None or loop.gap > 0:
            raise NotThere("the surface has a gap at the big toe")
        outline = foot.smooth(loop, plane)
        middle = np.abs(outline.points[:, 0]) <= HALLUX_HALF_BREADTH_MM  # more where toes have grown together
        return farthest(foot, outline, 1, 1.0, at[2], among=middle)

    x = tip.x.value - HALLUX_STATION_MM
    found = top(x)
    return combined(found.value, (1.0, found), (_slope(lambda at: top(at).value, x), tip.x))


def arch_height(foot: FootSurface) -> Quantity:
    """Of the sole, on the line parallel to the axis that is a third of the midfoot's breadth from its medial edge."""
    medial, lateral = foot.once(_midfoot_sides)
    inside = foot.midfoot.plane.point
    y = medial.value - (medial.value + lateral.value) / 3
    at = np.array([inside[0], y, inside[2]])
    plane = Plane.across(at, np.array([0.0, 1.0, 0.0]))
    outline = foot.outline(plane, at)
    x, z = plane.solid(outline.points)[:, 0] / foot.length_mm, outline.points[:, 1] + at[2]
    window = (x >= ARCH_WINDOW[0]) & (x <= ARCH_WINDOW[1]) & (z < inside[2])
    if not window.any():
        raise NotThere("the surface has no sole here")
    return farthest(foot, outline, 1, 1.0, at[2], among=window)


def toe_1_angle(foot: FootSurface) -> Quantity:
    """Of the big toe's medial side against the line from heel to head of the first metatarsal, outwards (hallux
    valgus) positive."""
    return _toe_angle(foot, "heel_medial", "metatarsale_tibiale", "toe_1_tip", 1.0)


def toe_5_angle(foot: FootSurface) -> Quantity:
    """Of the little toe's lateral side against the line from heel to head of the fifth metatarsal, inwards positive."""
    return _toe_angle(foot, "heel_lateral", "metatarsale_fibulare", "toe_5_tip", -1.0)


def heel_angle(foot: FootSurface) -> Quantity:
    """Of the line through the middle of the heel's rear at two heights against the vertical, seen from behind; positive
    where the heel leans to the medial side upwards (valgus)."""
    low, high = (_heel_middle(foot, share * foot.length_mm) for share in HEEL_LEVELS)
    rise = (HEEL_LEVELS[1] - HEEL_LEVELS[0]) * foot.length_mm
    lean = high.value - low.value
    degrees = np.rad2deg(rise / (rise**2 + lean**2))
    return combined(float(np.rad2deg(np.arctan2(lean, rise))), (degrees, high), (-degrees, low))


def scan_height(foot: FootSurface) -> Quantity:
    """Of the highest point of the surface."""
    return Quantity(foot.top, np.full(len(foot.normals), np.nan))  # of a rim, whose noise is not known


def farthest(
    foot: FootSurface,
    outline: Outline,
    axis: int,
    sign: float,
    origin: float = 0.0,
    among: NDArray[np.bool_] | None = None,
) -> Quantity:
    """How far the outline reaches along `sign` times one of its two axes, from the plane's point; plus `origin`."""
    reach = sign * outline.points[:, axis]
    point = int(np.argmax(reach if among is None else np.where(among, reach, -np.inf)))
    by_points = np.zeros_like(outline.points)
    by_points[point, axis] = sign
    return Quantity(float(reach[point]) + origin, foot.gradient(outline, by_points))


def _across(foot: FootSurface, x: float, inside: Floats) -> Outline:
    at = np.array([x, inside[1], inside[2]])
    return foot.outline(Plane.across(at, ACROSS), at)


def _broadest(foot: FootSurface, window: tuple[float, float], inside: Floats, height: float) -> Quantity:
    """From the most medial to the most lateral point of a window along X, in shares of the length, up to a height."""
    count = round((window[1] - window[0]) / STATION_SHARE) + 1
    outlines = [_across(foot, float(x), inside) for x in np.linspace(*window, count) * foot.length_mm]
    sides = [_farthest_of(foot, outlines, sign, height - inside[2]) for sign in (1.0, -1.0)]
    return combined(sides[0].value + sides[1].value, (1.0, sides[0]), (1.0, sides[1]))


def _farthest_of(foot: FootSurface, outlines: list[Outline], sign: float, height: float) -> Quantity:
    """How far the farthest of even sections reaches to a side: a cubic through those near it, since of many with noise
    the farthest is too far out."""
    reach = [_reach(outline, sign, height) for outline in outlines]
    best = int(np.argmax([most for most, _ in reach]))
    near = np.arange(max(best - STATIONS_NEAR, 0), min(best + STATIONS_NEAR + 1, len(outlines)))
    terms = np.vander((near - best) / STATIONS_NEAR, 4)
    hat = terms @ np.linalg.pinv(terms)
    fitted = hat @ [reach[k][0] for k in near]
    weights = hat[np.argmax(fitted)]
    gradient = np.zeros(len(foot.normals))
    for k, weight in zip(near, weights, strict=True):
        by_points = np.zeros_like(outlines[k].points)
        by_points[reach[k][1], 0] = sign * weight
        gradient += foot.gradient(outlines[k], by_points)
    return Quantity(float(fitted.max()), gradient)


def _reach(outline: Outline, sign: float, height: float) -> tuple[float, int]:
    """How far the outline reaches to a side up to a height in its plane, and the point there or next to it."""
    across, up = sign * outline.points[:, 0], outline.points[:, 1]
    reach = np.where(up <= height, across, -np.inf)
    ahead = np.roll(np.arange(len(up)), -1)
    spans = np.flatnonzero((up > height) != (up[ahead] > height))
    share = (height - up[spans]) / (up[ahead[spans]] - up[spans])
    reach[spans] = np.maximum(reach[spans], across[spans] + share * (across[ahead[spans]] - across[spans]))
    most = int(np.argmax(reach))
    return float(reach[most]), most


def _slope(function: Callable[[float], float], at: float) -> float:
    return (function(at + 1.0) - function(at - 1.0)) / 2


def _midfoot_sides(foot: FootSurface) -> tuple[Quantity, Quantity]:
    """Y of the section's medial end at half the foot length, and -Y of its lateral end."""
    outline, inside = foot.midfoot, foot.midfoot.plane.point
    low = outline.points[:, 1] + inside[2] <= LOW_MM
    return (
        farthest(foot, outline, 0, 1.0, inside[1], among=low),
        farthest(foot, outline, 0, -1.0, -inside[1], among=low),
    )


def _angle(start: Place, end: Place) -> Quantity:
    """Of the line between two points against the axis, degrees, on the level."""
    along, across = (end.point - start.point)[:2]
    factor = float(np.rad2deg(1.0 / (along**2 + across**2)))
    x, y = end.x.minus(start.x), end.y.minus(start.y)
    return combined(float(np.rad2deg(np.arctan2(across, along))), (factor * along, y), (-factor * across, x))


def _toe_angle(foot: FootSurface, heel: str, ball: str, tip: str, medial: float) -> Quantity:
    """`medial` is 1 on the medial side and -1 on the lateral. The toe's side is where the tangent from the ball touches
    it."""
    base = _angle(foot.place(heel), foot.place(ball))
    ball_place, end = foot.place(ball), foot.place(tip).x.value
    x, y, z = foot.mesh.vertices.T
    toe = np.flatnonzero((x > end - TOE_REGION * foot.length_mm) & (z < TOE_HEIGHT_MM) & (x > ball_place.x.value + 5.0))
    if not len(toe):
        raise NotThere("the surface has no toe here")
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
    """Y midway between the sides of the heel, 15 mm ahead of its rear at this height."""
    seed = np.array([0.15 * foot.length_mm, 0.0, level])
    heel = foot.outline(Plane.across(seed, UP), seed)  # its axes are those of the foot
    points, ahead = heel.points, np.roll(heel.points, -1, axis=0)
    x = float(points[:, 0].min()) + HEEL_DEPTH_MM
    spans = np.flatnonzero((points[:, 0] > x) != (ahead[:, 0] > x))
    share = (x - points[spans, 0]) / (ahead[spans, 0] - points[spans, 0])
    y = points[spans, 1] + share * (ahead[spans, 1] - points[spans, 1])
    by_points = np.zeros_like(points)
    for end in (int(np.argmin(y)), int(np.argmax(y))):
        by_points[spans[end], 1] += 0.5 * (1 - share[end])
        by_points[(spans[end] + 1) % len(points), 1] += 0.5 * share[end]
    return Quantity(float(y.min() + y.max()) / 2, foot.gradient(heel, by_points))

"""Girths: the reading of a tape around a foot, and the length along its skin."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_surface import ACROSS, UP, FootSurface, LandmarkQuantities
from footscan.measure.hull import hull_corners
from footscan.measure.outline import Outline, Plane
from footscan.measure.quantity import NotMeasurable, Quantity, combined

Floats = NDArray[np.float64]

NOISE_MM = 0.01
"""Smaller noise does not lengthen a tape noticeably; chosen by hand."""
TRIALS = 2
"""Bound of time: trials with added noise."""
EXCESS_POWER = 1.7
"""Power of the noise with which the excess of a tape grows, between 1 where the foot is flat and 2 where it is round.
The excess of the skin's area grows with power 2 while noise is small beside the triangles. Chosen by hand."""
STEP_MM = 1.0
"""Step of the numerical derivative of a girth by the place of its plane."""
TILTS_DEG = (-30.0, 30.0)
"""Tilts of the plane among which the least instep girth is sought; part of its definition."""
TILT_ROUNDS = 9
"""Rounds of golden section, which locate the tilt to about 0.1 degrees."""
LIMIT_DEG = 0.5
"""A least girth nearer than this to a limit of the tilt is uncertain."""
INSTEP_DEPTH = 0.4
"""Share of the height of the instep by which a point within the foot lies below it."""
ANKLE_STEP_MM = 2.0
"""Distance of the level sections of the leg."""
ANKLE_CLEARANCE_MM = 10.0
"""The narrowest place of the leg is sought from this height above the medial malleolus; chosen by hand."""
CUT_MARGIN_MM = 3.0
"""The narrowest place of the leg is sought up to this distance below its end; chosen by hand."""
LOW_HEEL_MM = 10.0
"""The rear of the heel on the floor is sought below this height; chosen by hand."""

Cut = Callable[[Floats], tuple[Plane, Floats]]
"""Function from the values of some quantities to a plane and a point within the foot."""


class Tape(NamedTuple):
    """A taut tape around an outline."""

    length: float
    """mm"""
    gradient: Floats
    """(N, 2) derivatives of the length by the outline's points"""
    corners: NDArray[np.integer]
    """(K,) numbers of the points at which the tape touches the outline"""


def ball_girth(foot: FootSurface) -> Quantity:
    """Girth in the upright plane through both metatarsal heads."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")

    def plane(x: Floats) -> tuple[Plane, Floats]:
        return upright_plane(np.array([x[0], *medial.point[1:]]), np.array([x[1], *lateral.point[1:]]))

    return girth(foot, plane, [medial.x, lateral.x])


def straight_ball_girth(foot: FootSurface) -> Quantity:
    """Girth across the axis at the head of the first metatarsal."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    return _across(foot, medial.x, (medial.point + lateral.point) / 2)


def waist_girth(foot: FootSurface) -> Quantity:
    """Girth across the axis, midway between the middle of the ball and half the foot length."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    inside = (medial.point + lateral.point) / 2
    half = foot.station(0.5)
    x = combined((inside[0] + half.value) / 2, (0.25, medial.x), (0.25, lateral.x), (0.5, half))
    return _across(foot, x, inside)


def instep_girth(foot: FootSurface) -> Quantity:
    """Girth across the axis at half the foot length."""
    return _across(foot, foot.station(0.5), foot.midfoot.plane.point)


def instep_girth_min(foot: FootSurface) -> Quantity:
    """Least girth through the instep point, among planes tilted about Y by at most 30 degrees."""
    top = foot.place("instep_point")

    def tilted(degrees: Floats) -> tuple[Plane, Floats]:
        angle = float(np.deg2rad(degrees[0]))
        direction = np.array([np.cos(angle), 0.0, np.sin(angle)])
        inside = top.point - INSTEP_DEPTH * top.z.value * np.array([-np.sin(angle), 0.0, np.cos(angle)])
        return Plane.across(top.point, direction), inside

    def length(degrees: float) -> float:
        plane, inside = tilted(np.array([degrees]))
        return tape(foot.outline(plane, inside)).length

    best = _least(length, *TILTS_DEG, TILT_ROUNDS)
    least = girth(foot, lambda _: tilted(np.array([best])), [])
    doubted = combined(least.value, (1.0, least), (0.0, top.x))
    at_limit = min(best - TILTS_DEG[0], TILTS_DEG[1] - best) < LIMIT_DEG
    doubt = "the least lies at the limit of the tilt" if at_limit else doubted.doubt
    return least._replace(gradient=doubted.gradient, doubt=doubt, note=f"tilted by {best:.0f} degrees")


def heel_girth(foot: FootSurface) -> Quantity:
    """Girth in the plane through the landing point and the junction point that contains Y."""
    junction = foot.place("junction_point")
    return _through(foot, foot.place("landing_point").point, junction)


def long_heel_girth(foot: FootSurface) -> Quantity:
    """Girth in the plane through the rear of the heel on the floor and the instep point that contains Y."""
    landing = foot.place("landing_point").point
    low = foot.mesh.vertices[foot.mesh.vertices[:, 2] < LOW_HEEL_MM]
    rear = np.array([float(low[:, 0].min()), landing[1], 0.0])
    return _through(foot, rear, foot.place("instep_point"))


def ankle_girth(foot: FootSurface) -> Quantity:
    """Least level girth above the malleoli."""
    medial, lateral = foot.place("medial_malleolus"), foot.place("lateral_malleolus")
    low, high = medial.z.value + ANKLE_CLEARANCE_MM, foot.top - CUT_MARGIN_MM
    if high - low < 2 * ANKLE_STEP_MM:
        raise NotMeasurable(f"the surface ends {foot.top - medial.z.value:.0f} mm above the medial malleolus")
    inside = (medial.point + lateral.point) / 2

    def level(height: Floats) -> tuple[Plane, Floats]:
        at = np.array([inside[0], inside[1], height[0]])
        return Plane.across(at, UP), at

    heights = np.append(np.arange(low, high - 0.5 * ANKLE_STEP_MM, ANKLE_STEP_MM), high)
    lengths = np.array([tape(foot.outline(*level(np.array([height])))).length for height in heights])
    best = int(np.argmin(lengths))
    if best == len(heights) - 1:
        station = Quantity(high, np.zeros(len(foot.normals)), "narrowest where the surface ends")
    elif best == 0:
        station = combined(low, (1.0, medial.z))
    else:
        before, at, after = lengths[best - 1 : best + 2]
        height = heights[best] + 0.5 * ANKLE_STEP_MM * (before - after) / (before - 2 * at + after)
        station = Quantity(float(height), np.zeros(len(foot.normals)))
    return girth(foot, level, [station])._replace(note=f"at a height of {heights[best]:.0f} mm")


def girth(foot: FootSurface, cut: Cut, stations: list[Quantity]) -> Quantity:
    """Lay a tape around the foot in the plane that `cut` makes of the values of `stations`.

    Its errors are those of the section and, so far as the girth changes with the plane, those of the stations.

    Raises
    ------
    NotMeasurable
        The surface has no section there, or a gap.
    """
    at = np.array([station.value for station in stations])
    outline = foot.outline(*cut(at))
    around = tape(outline)
    gradient = foot.gradient(outline, around.gradient)
    for number, station in enumerate(stations):
        if np.any(station.gradient):
            step = STEP_MM * (np.arange(len(at)) == number)
            ahead, behind = (tape(foot.outline(*cut(at + sign * step))).length for sign in (1, -1))
            gradient = gradient + (ahead - behind) / (2 * STEP_MM) * station.gradient
    doubts = [station.doubt for station in stations if station.doubt is not None]
    return Quantity(
        around.length - _excess(foot, outline, around.length),
        gradient,
        "; ".join(dict.fromkeys(doubts)) or None,
        surface_length=_length(outline.points),
        plane=(outline.plane.point, outline.plane.normal),
    )


def tape(outline: Outline) -> Tape:
    """Lay a taut tape around the outline: the perimeter of its convex hull, since a tape bridges hollows.

    Raises
    ------
    NotMeasurable
        The outline encloses no area.
    """
    corners = hull_corners(outline.points)
    if len(corners) < 3:
        raise NotMeasurable("the section of the surface holds no area")
    around = outline.points[corners]
    ahead = around[[*range(1, len(around)), 0]] - around
    length = np.hypot(ahead[:, 0], ahead[:, 1])
    direction = ahead / length[:, None]
    gradient = np.zeros_like(outline.points)
    gradient[corners] = direction[[-1, *range(len(around) - 1)]] - direction
    return Tape(float(length.sum()), gradient, corners)


def _excess(foot: FootSurface, outline: Outline, length: float) -> float:
    """Excess length of the tape, mm, which lies on the crests of the noise that is left in the outline.

    Trials double the noise, and the growth of the length is extrapolated to no noise: Cook and Stefanski,
    "Simulation-extrapolation estimation in parametric measurement error models", J. Am. Stat. Assoc. 89, 1994,
    doi:10.1080/01621459.1994.10476871.
    """
    if outline.noise < NOISE_MM:
        return 0.0
    random = np.random.default_rng(0)
    loop, plane = outline.loop, outline.plane
    lengths = []
    for _ in range(TRIALS):
        # The added variance is 3 times that of the noise present, which doubles the standard deviation.
        of_vertices = np.sqrt(3.0) * random.normal(size=len(foot.noise)) * foot.noise
        first, second = (
            share[:, None] * (foot.outwards(plane, vertex) * of_vertices[vertex, None])
            for vertex, share in zip(loop.edges.T, (1 - loop.shares, loop.shares), strict=True)
        )
        waves = outline.smoothed(first + second)
        lengths += [tape(outline._replace(points=outline.points + sign * waves)).length for sign in (1, -1)]
    return (float(np.mean(lengths)) - length) / float(2.0**EXCESS_POWER - 1.0)


def _length(points: Floats) -> float:
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def upright_plane(medial: Floats, lateral: Floats) -> tuple[Plane, Floats]:
    """Returns the upright plane through two points, (3,) mm, and the point midway.

    Examples
    --------
    >>> plane, middle = upright_plane(np.array([0.0, 2, 0]), np.array([0.0, 0, 0]))
    >>> plane.normal.tolist(), middle.tolist()
    ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    """
    middle = (medial + lateral) / 2
    return Plane.across(middle, np.cross(medial - lateral, UP)), middle


def _across(foot: FootSurface, x: Quantity, inside: Floats) -> Quantity:
    def plane(at: Floats) -> tuple[Plane, Floats]:
        middle = np.array([at[0], inside[1], inside[2]])
        return Plane.across(middle, ACROSS), middle

    return girth(foot, plane, [x])


def _through(foot: FootSurface, low: Floats, high: LandmarkQuantities) -> Quantity:
    def plane(at: Floats) -> tuple[Plane, Floats]:
        upper = np.array([at[0], high.y.value, at[1]])
        middle = (low + upper) / 2
        return Plane.across(middle, np.cross(upper - low, [0.0, 1.0, 0.0])), middle

    return girth(foot, plane, [high.x, high.z])


def _least(function: Callable[[float], float], low: float, high: float, rounds: int) -> float:
    """Place between `low` and `high` where the function is least: by a coarse grid, then by golden section."""
    grid = np.linspace(low, high, 7)
    best = int(np.argmin([function(float(at)) for at in grid]))
    low, high = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, 6)])
    golden = (np.sqrt(5.0) - 1) / 2
    left, right = high - golden * (high - low), low + golden * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(rounds):
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - golden * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + golden * (high - low)
            at_right = function(right)
    return float((low + high) / 2)

"""Girths: what a tape reads around a foot, and the length along its skin."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_surface import ACROSS, UP, FootSurface, Place
from footscan.measure.hull import hull_corners
from footscan.measure.outline import Outline, Plane
from footscan.measure.quantity import NotThere, Quantity, combined

Floats = NDArray[np.float64]

NOISE_MM = 0.01
"""Below this a tape is not lengthened by noise to speak of."""
TRIALS = 2
EXCESS_POWER = 1.7
"""With which power of the noise a tape's excess grows: 1 where the foot is flat, 2 where it is round; and that of the
skin's area, 2 while noise is small beside the triangles."""
STEP_MM = 1.0
"""By which a plane is moved to see how its girth follows a landmark."""
TILTS_DEG = (-30.0, 30.0)
TILT_ROUNDS = 9
ANKLE_STEP_MM = 2.0
ANKLE_CLEARANCE_MM = 10.0
"""The narrowest place of the leg is sought from so far above the medial malleolus to so far below the cut."""
CUT_MARGIN_MM = 3.0
LOW_HEEL_MM = 10.0
"""The rear of the heel is sought below."""

Cut = Callable[[Floats], tuple[Plane, Floats]]
"""From the values of some quantities to a plane and a point within the foot."""


class Tape(NamedTuple):
    """A taut tape around an outline."""

    length: float
    """mm"""
    gradient: Floats
    """(N, 2) derivatives by the outline's points."""
    corners: NDArray[np.integer]
    """The points of the outline at which it touches."""


def ball_girth(foot: FootSurface) -> Quantity:
    """In the upright plane through both metatarsal heads."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")

    def plane(x: Floats) -> tuple[Plane, Floats]:
        return upright_plane(np.array([x[0], *medial.point[1:]]), np.array([x[1], *lateral.point[1:]]))

    return girth(foot, plane, [medial.x, lateral.x])


def straight_ball_girth(foot: FootSurface) -> Quantity:
    """Across the axis at the head of the first metatarsal."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    return _across(foot, medial.x, (medial.point + lateral.point) / 2)


def waist_girth(foot: FootSurface) -> Quantity:
    """Across the axis, midway between the middle of the ball and half the foot length."""
    medial, lateral = foot.place("metatarsale_tibiale"), foot.place("metatarsale_fibulare")
    inside = (medial.point + lateral.point) / 2
    half = foot.station(0.5)
    x = combined((inside[0] + half.value) / 2, (0.25, medial.x), (0.25, lateral.x), (0.5, half))
    return _across(foot, x, inside)


def instep_girth(foot: FootSurface) -> Quantity:
    """Across the axis at half the foot length."""
    return _across(foot, foot.station(0.5), foot.midfoot.plane.point)


def instep_girth_min(foot: FootSurface) -> Quantity:
    """The least through the instep point, of planes tilted about Y by at most 30 degrees."""
    top = foot.place("instep_point")

    def tilted(degrees: Floats) -> tuple[Plane, Floats]:
        angle = float(np.deg2rad(degrees[0]))
        direction = np.array([np.cos(angle), 0.0, np.sin(angle)])
        inside = top.point - 0.4 * top.z.value * np.array([-np.sin(angle), 0.0, np.cos(angle)])
        return Plane.across(top.point, direction), inside

    def length(degrees: float) -> float:
        plane, inside = tilted(np.array([degrees]))
        return tape(foot.outline(plane, inside)).length

    best = _least(length, *TILTS_DEG, TILT_ROUNDS)
    found = girth(foot, lambda _: tilted(np.array([best])), [])
    doubted = combined(found.value, (1.0, found), (0.0, top.x))
    found = found._replace(gradient=doubted.gradient, doubt=doubted.doubt)
    at_limit = min(best - TILTS_DEG[0], TILTS_DEG[1] - best) < 0.5
    doubt = "the least lies at the limit of the tilt" if at_limit else found.doubt
    return found._replace(doubt=doubt, note=f"tilted by {best:.0f} degrees")


def heel_girth(foot: FootSurface) -> Quantity:
    """Through the landing point and the junction point, containing Y."""
    junction = foot.place("junction_point")
    return _through(foot, foot.place("landing_point").point, junction)


def long_heel_girth(foot: FootSurface) -> Quantity:
    """Through the rear of the heel where it meets the floor and the instep point, containing Y."""
    landing = foot.place("landing_point").point
    low = foot.mesh.vertices[foot.mesh.vertices[:, 2] < LOW_HEEL_MM]
    rear = np.array([float(low[:, 0].min()), landing[1], 0.0])
    return _through(foot, rear, foot.place("instep_point"))


def ankle_girth(foot: FootSurface) -> Quantity:
    """The least level girth above the malleoli."""
    malleolus, other = foot.place("medial_malleolus"), foot.place("lateral_malleolus")
    low, high = malleolus.z.value + ANKLE_CLEARANCE_MM, foot.top - CUT_MARGIN_MM
    if high - low < 2 * ANKLE_STEP_MM:
        raise NotThere(f"the surface ends {foot.top - malleolus.z.value:.0f} mm above the medial malleolus")
    inside = (malleolus.point + other.point) / 2

    def level(height: Floats) -> tuple[Plane, Floats]:
        at = np.array([inside[0], inside[1], height[0]])
        return Plane.across(at, UP), at

    heights = np.append(np.arange(low, high - 0.5 * ANKLE_STEP_MM, ANKLE_STEP_MM), high)
    lengths = np.array([tape(foot.outline(*level(np.array([height])))).length for height in heights])
    best = int(np.argmin(lengths))
    if best == len(heights) - 1:
        found = girth(foot, level, [Quantity(high, np.zeros(len(foot.normals)), "narrowest where the surface ends")])
    elif best == 0:
        found = girth(foot, level, [combined(low, (1.0, malleolus.z))])
    else:
        before, at, after = lengths[best - 1 : best + 2]
        height = heights[best] + 0.5 * ANKLE_STEP_MM * (before - after) / (before - 2 * at + after)
        found = girth(foot, level, [Quantity(float(height), np.zeros(len(foot.normals)))])
    return found._replace(note=f"at a height of {heights[best]:.0f} mm")


def girth(foot: FootSurface, cut: Cut, stations: list[Quantity]) -> Quantity:
    """The tape around the foot in the plane that `cut` makes of the values of `stations`.

    Its errors are those of the section and, as far as the girth changes with the plane, those of the stations.

    Raises
    ------
    NotThere
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
    """A taut tape around the outline, which bridges hollows: the perimeter of its convex hull.

    Raises
    ------
    NotThere
        The outline holds no area.
    """
    corners = hull_corners(outline.points)
    if len(corners) < 3:
        raise NotThere("the section of the surface holds no area")
    around = outline.points[corners]
    ahead = around[[*range(1, len(around)), 0]] - around
    length = np.hypot(ahead[:, 0], ahead[:, 1])
    direction = ahead / length[:, None]
    gradient = np.zeros_like(outline.points)
    gradient[corners] = direction[[-1, *range(len(around) - 1)]] - direction
    return Tape(float(length.sum()), gradient, corners)


def _excess(foot: FootSurface, outline: Outline, length: float) -> float:
    """By how much what noise is left in the outline makes the tape longer, which lies on its crests, mm.

    The noise is doubled, by trials, and the growth extrapolated to none: Cook and Stefanski, "Simulation-extrapolation
    estimation in parametric measurement error models", J. Am. Stat. Assoc. 89, 1994,
    doi:10.1080/01621459.1994.10476871.
    """
    if outline.noise < NOISE_MM:
        return 0.0
    random = np.random.default_rng(0)
    loop, plane = outline.loop, outline.plane
    lengths = []
    for _ in range(TRIALS):
        of_vertices = np.sqrt(3.0) * random.normal(size=len(foot.noise)) * foot.noise  # sd 2 with what is there
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
    """The upright plane through two points, (3,) mm, and the point midway."""
    middle = (medial + lateral) / 2
    return Plane.across(middle, np.cross(medial - lateral, UP)), middle


def _across(foot: FootSurface, x: Quantity, inside: Floats) -> Quantity:
    def plane(at: Floats) -> tuple[Plane, Floats]:
        middle = np.array([at[0], inside[1], inside[2]])
        return Plane.across(middle, ACROSS), middle

    return girth(foot, plane, [x])


def _through(foot: FootSurface, low: Floats, high: Place) -> Quantity:
    def plane(at: Floats) -> tuple[Plane, Floats]:
        upper = np.array([at[0], high.y.value, at[1]])
        middle = (low + upper) / 2
        return Plane.across(middle, np.cross(upper - low, [0.0, 1.0, 0.0])), middle

    return girth(foot, plane, [high.x, high.z])


def _least(function: Callable[[float], float], low: float, high: float, rounds: int) -> float:
    """Where in a range the function is least: on a coarse grid, then by golden section."""
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

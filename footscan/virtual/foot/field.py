"""The surface of a foot as the zero level of a smooth function, which is about the distance in mm, negative inside.

The foot is a smooth union of tubes (body and five toes), a leg and two malleoli, cut by the floor with a rounded edge.
A section of a tube is a superellipse with an upper and a lower half of different height and exponent; its measures run
along X as C2 splines, and both ends close like ellipsoids:

    rho^2 = (|u|^n + |v|^n)^(2/n) = s(x),   u = (y - centre) / half_width,   v = (z - level) / half_height
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from footscan.compiled import compiled

Floats = npt.NDArray[np.float64]

CENTRE, HALF_WIDTH, LEVEL, UP, DOWN, N_UP, N_DOWN, TILT, LIFT = range(9)
PROFILES = 9
INTERVALS = 32

LEG_X, LEG_Y, LEG_DEPTH, LEG_WIDTH = range(4)

BODY_TOE_BLEND_MM = 6.0
TOE_TOE_BLEND_MM = 1.5
LEG_BLEND_MM = (4.0, 30.0)
"""At the height of the pternion, which no blend may move, and higher up."""
LEG_BLEND_RISE_MM = 35.0
MALLEOLUS_BLEND_MM = 16.0
FLOOR_BLEND_MM = 5.0
CUT_BLEND_MM = 16.0
"""Of the end of an amputated forefoot."""
"""The radii of all blends are chosen by hand."""

CAP_POWER = 2.5
"""s(t) = 1 - (1 - t)^2.5 meets the tube's s = 1 with a continuous curvature."""
LEG_EXPONENT = 2.2
"""Exponent of the leg's superellipse. Chosen by hand."""
ARCH_FULL, ARCH_NONE = 0.08, 0.69
"""Parts of the width from the medial edge: the arch is fully lifted up to the first and flat from the second. Chosen by
hand."""


class Field(NamedTuple):
    """The coefficients of one right foot; mm at size 1, canonical frame (medial is +Y)."""

    splines: Floats
    """(6, INTERVALS, PROFILES, 4): cubic coefficients, highest power first, of the body and of toes 1 to 5."""
    starts: Floats
    """(6,): X of the first knot of each tube."""
    steps: Floats
    """(6,): knot distance of each tube."""
    caps: Floats
    """(6, 5): X of the rear end, length of its cap, X of the front end, length of its cap, the front's shear dX/dY."""
    leg: Floats
    """(INTERVALS, 4, 4): the same for the leg along Z: centre X, centre Y, half depth along X, half width along Y."""
    leg_knots: Floats
    """(5,): Z of the first knot, knot distance, Z of the lower end, length of its cap, Z of the pternion."""
    leg_reach: float
    """Beyond this X the leg is too far away to blend with the body."""
    malleoli: Floats
    """(2, 6): centre and half axes of two ellipsoids."""
    cut_x: float = np.inf
    """X at which the forefoot ends; infinite for a whole foot."""
    size: float = 1.0
    """The foot is so many times as large as the field: a length that a definition gives in mm is divided by it."""


def without_toes(field: Field) -> Field:
    """The same foot, its toes moved out of reach."""
    caps = field.caps.copy()
    caps[1:, 0] = np.inf
    return field._replace(caps=caps)


@compiled
def field_at(x: float, y: float, z: float, field: Field) -> float:
    """The function at one point."""
    toes = 1e3
    for toe in range(1, 6):
        if x > field.caps[toe, 0] - 10:  # further back a toe is too far inside the body to blend with its surface
            toes = _union(toes, _tube(x, y, z, field, toe), TOE_TOE_BLEND_MM)
    foot = _union(_tube(x, y, z, field, 0), toes, BODY_TOE_BLEND_MM)
    if x < field.leg_reach:
        leg = _leg(x, y, z, field)
        for k in range(2):
            leg = _union(leg, _ellipsoid(x, y, z, field.malleoli[k]), MALLEOLUS_BLEND_MM)
        low, high = LEG_BLEND_MM
        rise = _smooth_step((z - field.leg_knots[4]) / LEG_BLEND_RISE_MM)
        foot = _union(foot, leg, low + (high - low) * rise)
    if field.cut_x < np.inf:
        foot = -_union(-foot, field.cut_x - x, CUT_BLEND_MM)
    value: float = -_union(-foot, z, FLOOR_BLEND_MM)
    return value


@compiled
def field_values(points: Floats, field: Field) -> Floats:
    """The function at `points`, shape (N, 3), mm: shape (N,)."""
    values = np.empty(len(points))
    for k in range(len(points)):
        values[k] = field_at(points[k, 0], points[k, 1], points[k, 2], field)
    return values


@compiled
def field_grid(x: Floats, y: Floats, z: Floats, field: Field) -> Floats:
    """The function on the grid of three axes, mm: shape (len(x), len(y), len(z)).

    A block of nodes far from the surface has the value of its middle throughout: where that exceeds four half
    diagonals, the surface, near which the function changes by at most about 3 a mm, cannot reach the block.
    """
    values = np.empty((len(x), len(y), len(z)))
    block = 4
    for a in range(0, len(x), block):
        x_last = min(a + block, len(x)) - 1
        for b in range(0, len(y), block):
            y_last = min(b + block, len(y)) - 1
            for c in range(0, len(z), block):
                z_last = min(c + block, len(z)) - 1
                diagonal = np.sqrt((x[x_last] - x[a]) ** 2 + (y[y_last] - y[b]) ** 2 + (z[z_last] - z[c]) ** 2)
                middle = field_at((x[a] + x[x_last]) / 2, (y[b] + y[y_last]) / 2, (z[c] + z[z_last]) / 2, field)
                near = abs(middle) < 2 * diagonal
                for i in range(a, x_last + 1):
                    for j in range(b, y_last + 1):
                        for k in range(c, z_last + 1):
                            values[i, j, k] = field_at(x[i], y[j], z[k], field) if near else middle
    return values


@compiled
def field_gradients(points: Floats, field: Field) -> Floats:
    """Central differences of the function at `points`, shape (N, 3)."""
    step = 1e-4
    gradients = np.empty((len(points), 3))
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        gradients[k, 0] = field_at(x + step, y, z, field) - field_at(x - step, y, z, field)
        gradients[k, 1] = field_at(x, y + step, z, field) - field_at(x, y - step, z, field)
        gradients[k, 2] = field_at(x, y, z + step, field) - field_at(x, y, z - step, field)
    return gradients / (2 * step)


@compiled
def first_hits(origins: Floats, directions: Floats, reach: float, field: Field) -> Floats:
    """Distance along each ray to the surface from outside, to 1e-7 mm; `reach` where a ray meets nothing.

    origins, directions : (N, 3) float64, mm and unit vectors.
    """
    distances = np.empty(len(origins))
    for k in range(len(origins)):
        near, far = 0.0, 0.0
        outside = inside = _along(origins[k], directions[k], 0.0, field)
        while inside > 0 and far < reach:
            near, outside = far, inside
            far = min(far + max(0.6 * outside, 0.05), reach)
            inside = _along(origins[k], directions[k], far, field)
        if inside > 0:
            distances[k] = reach
            continue
        middle, kept = far, 0
        for _ in range(60):  # false position in the Illinois form
            if far - near < 1e-7:
                break
            middle = far - inside * (far - near) / (inside - outside)
            value = _along(origins[k], directions[k], middle, field)
            if abs(value) < 1e-9:
                break
            if value > 0:
                near, outside = middle, value
                inside, kept = (0.5 * inside, 1) if kept == 1 else (inside, 1)
            else:
                far, inside = middle, value
                outside, kept = (0.5 * outside, -1) if kept == -1 else (outside, -1)
        distances[k] = middle
    return distances


@compiled
def _along(origin: Floats, direction: Floats, t: float, field: Field) -> float:
    value: float = field_at(
        origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2], field
    )
    return value


@compiled
def _tube(x: float, y: float, z: float, field: Field, tube: int) -> float:
    splines = field.splines[tube]
    interval, t = _place(x, field.starts[tube], field.steps[tube])
    dy = y - _cubic(splines, interval, CENTRE, t)
    dz = z - _cubic(splines, interval, LEVEL, t)
    u = dy / _cubic(splines, interval, HALF_WIDTH, t)
    if dz > 0:
        tilt = 1 + _cubic(splines, interval, TILT, t) * min(max(u, -1.5), 1.5)
        v = dz / (_cubic(splines, interval, UP, t) * tilt)
        n = _cubic(splines, interval, N_UP, t)
    else:
        lift = _cubic(splines, interval, LIFT, t) * _arch_part(0.5 - 0.5 * u)
        v = -dz / (_cubic(splines, interval, DOWN, t) - lift)
        n = _cubic(splines, interval, N_DOWN, t)
    rho = (abs(u) ** n + v**n) ** (1 / n)
    caps = field.caps[tube]
    rear, rear_slope = _cap((x - caps[0]) / caps[1], caps[1])
    front, front_slope = _cap((caps[2] + caps[4] * y - x) / caps[3], caps[3])
    value: float = _distance(rho, np.hypot(dy, dz), min(rear, front), rear_slope + front_slope)
    return value


@compiled
def _leg(x: float, y: float, z: float, field: Field) -> float:
    knots = field.leg_knots
    interval, t = _place(z, knots[0], knots[1])
    dx = x - _cubic(field.leg, interval, LEG_X, t)
    dy = y - _cubic(field.leg, interval, LEG_Y, t)
    u = abs(dx) / _cubic(field.leg, interval, LEG_DEPTH, t)
    v = abs(dy) / _cubic(field.leg, interval, LEG_WIDTH, t)
    rho = (u**LEG_EXPONENT + v**LEG_EXPONENT) ** (1 / LEG_EXPONENT)
    closing, slope = _cap((z - knots[2]) / knots[3], knots[3])
    value: float = _distance(rho, np.hypot(dx, dy), closing, slope)
    return value


@compiled
def _ellipsoid(x: float, y: float, z: float, ellipsoid: Floats) -> float:
    dx, dy, dz = x - ellipsoid[0], y - ellipsoid[1], z - ellipsoid[2]
    rho = np.sqrt((dx / ellipsoid[3]) ** 2 + (dy / ellipsoid[4]) ** 2 + (dz / ellipsoid[5]) ** 2)
    value: float = _distance(rho, np.sqrt(dx * dx + dy * dy + dz * dz), 1.0, 0.0)
    return value


@compiled
def _distance(rho: float, radius: float, closing: float, slope: float) -> float:
    """rho^2 - s over the length of its gradient; the small last term keeps it finite in the middle of the tube."""
    boundary = radius / rho if rho > 1e-9 else 1e3
    value: float = (rho * rho - closing) / np.sqrt((4 * rho * rho + 0.1) / (boundary * boundary) + slope * slope)
    return value


@compiled
def _cap(t: float, length: float) -> tuple[float, float]:
    """s and its slope |ds/dx| at the part t of a cap; negative s beyond the end."""
    if t >= 1:
        return 1.0, 0.0
    return 1 - (1 - t) ** CAP_POWER, CAP_POWER * (1 - t) ** (CAP_POWER - 1) / length


@compiled
def _arch_part(from_medial: float) -> float:
    """1 at the medial edge, 0 on the lateral side."""
    part: float = _smooth_step((ARCH_NONE - from_medial) / (ARCH_NONE - ARCH_FULL))
    return part


@compiled
def _smooth_step(t: float) -> float:
    """From 0 at t = 0 to 1 at t = 1, constant beyond, with two continuous derivatives."""
    t = min(max(t, 0.0), 1.0)
    return t * t * t * (10 - 15 * t + 6 * t * t)


@compiled
def _place(at: float, start: float, step: float) -> tuple[int, float]:
    """The spline's interval and the distance into it; the ends go on as constants."""
    place = min(max((at - start) / step, 0.0), INTERVALS - 1e-9)
    return int(place), (place - int(place)) * step


@compiled
def _cubic(splines: Floats, interval: int, profile: int, t: float) -> float:
    c = splines[interval, profile]
    value: float = ((c[0] * t + c[1]) * t + c[2]) * t + c[3]
    return value


@compiled
def _union(a: float, b: float, blend: float) -> float:
    """Smooth minimum with two continuous derivatives; equal to the minimum where |a - b| >= blend."""
    h = max(blend - abs(a - b), 0.0) / blend
    return min(a, b) - h * h * h * blend / 6

"""From stations along the foot to the coefficients of its surface.

Stations follow a parametric foot tuned to ANSUR II's means; between them pchip curves, which do not overshoot, are
sampled at even knots and joined by a C2 cubic spline.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from footscan.virtual.foot.field import (
    CENTRE,
    DOWN,
    HALF_WIDTH,
    INTERVALS,
    LEVEL,
    LIFT,
    N_DOWN,
    N_UP,
    PROFILES,
    TILT,
    UP,
    Field,
    Floats,
)
from footscan.virtual.foot.shape import FootShape

MEDIAL_PART = 0.465
"""Part of the breadth at the ball that lies medial of the axis to toe 2. Chosen by hand."""
TOE_BREADTHS = (0.285, 0.145, 0.137, 0.132, 0.136)
"""Breadths of toes 1 to 5, as parts of the foot breadth. Chosen by hand."""
TOE_HEIGHTS = (0.0, 0.060, 0.057, 0.054, 0.053)
"""Heights of the pads, as parts of the foot length; toe 1 has a parameter of its own. Chosen by hand."""
ROOT_CENTRES = (0.265, 0.065, -0.085, -0.232, -0.385)
"""Y of the metatarsal heads, as parts of the foot breadth. Chosen by hand."""
HEEL_CAP = 0.20
"""Length of the rear cap, as a part of the foot length. Chosen by hand."""


@dataclass(frozen=True)
class Controls:
    """The stations' own sizes, which are solved for until the built foot has the measures of its shape; mm."""

    medial_x: float
    lateral_x: float
    breadth: float
    heel: float
    ball_height: float
    instep_height: float
    arch: float
    hallux_height: float


def first_guess(shape: FootShape) -> Controls:
    """Controls before anything is solved."""
    return Controls(
        medial_x=shape.ball_length,
        lateral_x=shape.lateral_ball_length,
        breadth=shape.foot_breadth,
        heel=shape.heel_breadth,
        ball_height=0.36 * shape.foot_breadth,
        instep_height=shape.instep_height,
        arch=1.2 * shape.arch_height,
        hallux_height=shape.hallux_height,
    )


def build_field(shape: FootShape, controls: Controls) -> Field:
    """The surface that the stations describe."""
    tubes = [_body(shape, controls)] + [_toe(shape, controls, toe) for toe in range(5)]
    leg_start, leg_step, leg = _leg(shape)
    length = shape.foot_length
    return Field(
        splines=np.ascontiguousarray([splines for _, _, splines, _ in tubes]),
        starts=np.array([start for start, _, _, _ in tubes]),
        steps=np.array([step for _, step, _, _ in tubes]),
        caps=np.array([caps for _, _, _, caps in tubes], dtype=np.float64),
        leg=leg,
        leg_knots=np.array([leg_start, leg_step, 0.084 * length, 0.172 * length, _heel_level(shape)]),
        leg_reach=0.58 * length,
        malleoli=_malleoli(shape),
    )


def deformed(field: Field, shape: FootShape) -> Field:
    """The foot of `field` without what `shape` lacks: toes, or the forefoot."""
    caps = field.caps.copy()
    caps[list(shape.missing_toes), 0] = np.inf
    cut_x = np.inf if shape.amputated_at is None else shape.amputated_at * shape.foot_length
    return field._replace(caps=caps, cut_x=cut_x)


def present_tips(shape: FootShape) -> dict[int, tuple[float, float, float]]:
    """The foremost points of the toes that `shape` has, by number."""
    if shape.amputated_at is not None:
        return {}
    return {toe: tip for toe, tip in enumerate(toe_tips(shape), start=1) if toe not in shape.missing_toes}


def toe_tips(shape: FootShape) -> list[tuple[float, float, float]]:
    """The foremost point of each toe, on the exact surface: there the section of its tube shrinks to a point."""
    return [
        (part * shape.foot_length, y, _pad_level(shape, toe))
        for toe, (part, y) in enumerate(zip(shape.toe_lengths, _pad_centres(shape), strict=True))
    ]


def pternion(shape: FootShape) -> tuple[float, float, float]:
    """The rearmost point, on the exact surface."""
    return (0.0, 0.0, _heel_level(shape))


Tube = tuple[float, float, Floats, tuple[float, float, float, float, float]]


def _body(shape: FootShape, controls: Controls) -> Tube:
    length, half_heel = shape.foot_length, controls.heel / 2
    medial = MEDIAL_PART * controls.breadth
    lateral = controls.breadth - medial
    mt, mf = controls.medial_x / length, controls.lateral_x / length
    instep, ball, arch = controls.instep_height, controls.ball_height, controls.arch
    medial_edge = _curve(
        (0.0, 0.10, 0.20, 0.30, 0.40, mt - 0.24, mt - 0.14, mt - 0.06, mt, mt + 0.05, mt + 0.13),
        (
            0.97 * half_heel,
            0.99 * half_heel,
            half_heel,
            0.93 * half_heel,
            0.72 * medial,
            0.73 * medial,
            0.82 * medial,
            0.94 * medial,
            medial,
            0.965 * medial,
            0.87 * medial,
        ),
    )
    lateral_edge = _curve(
        (0.0, 0.10, 0.20, 0.32, mf - 0.20, mf - 0.09, mf, mf + 0.08, mf + 0.15, mf + 0.22),
        (
            0.97 * half_heel,
            0.99 * half_heel,
            half_heel,
            0.98 * half_heel,
            0.82 * lateral,
            0.94 * lateral,
            lateral,
            0.965 * lateral,
            0.88 * lateral,
            0.78 * lateral,
        ),
    )
    heel = _heel_level(shape)
    knots = np.linspace(-0.02, 1.0, INTERVALS + 1)
    left, right = medial_edge(knots), -lateral_edge(knots)
    sines = np.array([math.sin(math.pi * (knot - 0.22) / 0.46) for knot in knots])
    lifted = np.where((knots > 0.22) & (knots < 0.68), sines**2, 0.0)
    level = _curve((0.0, 0.20, 0.45, 0.64, 0.74, 0.90), (heel, heel, 20.0, 0.065 * length, 0.34 * ball, 0.36 * ball))(
        knots
    )
    level = level + 0.75 * arch * lifted
    top = _curve(
        (0.0, 0.20, 0.30, 0.40, 0.50, 0.57, 0.645, 0.74, 0.80, 0.90),
        (
            0.24 * length,
            0.25 * length,
            0.135 * length + 0.54 * instep,
            1.12 * instep,
            0.97 * instep,
            0.63 * instep + 0.37 * ball,
            0.32 * instep + 0.68 * ball,
            0.97 * ball,
            0.83 * ball,
            0.66 * ball,
        ),
    )(knots)
    sink = _curve((0.0, 0.2, 0.45, 0.7, 0.78, 0.90), (7.0, 6.0, 6.0, 4.5, 3.0, -2.0))(knots)
    profiles = np.empty((PROFILES, INTERVALS + 1))
    profiles[CENTRE], profiles[HALF_WIDTH] = (left + right) / 2, (left - right) / 2
    profiles[CENTRE] *= np.clip(knots / 0.1, 0, 1)  # the pternion lies on the axis
    profiles[LEVEL], profiles[UP], profiles[DOWN] = level, top - level, level + sink
    fuller = shape.ball_girth / shape.foot_breadth - 2.47  # than the mean: a squarer section, not only a higher one
    up, down = float(np.clip(2.4 + 3 * fuller, 2.1, 3.0)), float(np.clip(3.0 + 4 * fuller, 2.4, 3.6))
    profiles[N_UP] = _curve((0.0, 0.3, 0.5, 0.74, 0.9), (2.4, 2.3, 2.35, up, up + 0.1))(knots)
    profiles[N_DOWN] = _curve((0.0, 0.3, 0.45, 0.64, 0.74, 0.9), (2.6, 2.8, 2.4, down - 0.2, down, 2.6))(knots)
    profiles[TILT] = _curve((0.0, 0.3, 0.5, 0.64, 0.74, 0.9), (0.0, 0.05, 0.25, 0.30, 0.24, 0.15))(knots)
    profiles[LIFT] = arch * lifted + sink * np.clip(lifted * 4, 0, 1)
    caps = (0.0, HEEL_CAP * length, 0.888 * length, 0.13 * length, 0.42)
    return *_spline(knots * length, _smoothed(profiles)), caps


def _toe(shape: FootShape, controls: Controls, toe: int) -> Tube:
    length, half = shape.foot_length, TOE_BREADTHS[toe] * shape.foot_breadth / 2
    tip = shape.toe_lengths[toe] * length
    root = (0.73, 0.735, 0.72, 0.69, 0.66)[toe] * length
    tall = controls.hallux_height if toe == 0 else TOE_HEIGHTS[toe] * length * 1.15
    knuckle = (1.02, 1.25, 1.28, 1.27, 1.2)[toe] * (1.0 + 0.5 * shape.hammer_toes * (toe > 0))
    knots = np.linspace(root, tip, INTERVALS + 1)
    back = tip - knots  # distance behind the tip
    span = tip - root
    pad, joint = (14.0, 30.0) if toe == 0 else (8.0, 22.0)
    level_tip = _pad_level(shape, toe)
    profiles = np.zeros((PROFILES, INTERVALS + 1))
    centre, root_centre = _pad_centres(shape)[toe], ROOT_CENTRES[toe] * shape.foot_breadth
    profiles[CENTRE] = _curve((0.0, pad, span), (centre, centre, root_centre))(back)
    shaft = 0.96 if toe == 0 else 0.97
    profiles[HALF_WIDTH] = half * _curve((0.0, pad, joint, span), (1.0, 1.0, shaft, 1.0))(back)
    level = _curve((0.0, pad, joint, span), (level_tip, level_tip, level_tip * 1.15, 0.30 * controls.ball_height))(back)
    top = _curve((0.0, pad, joint, span), (0.92 * tall, tall, knuckle * tall, 0.70 * controls.ball_height))(back)
    bottom = _curve((0.0, pad, joint, span), (-2.0, -2.0, 3.5, 3.0))(back)
    profiles[LEVEL], profiles[UP], profiles[DOWN] = level, top - level, level - bottom
    profiles[N_UP], profiles[N_DOWN] = 2.3, 2.3
    return *_spline(knots, profiles), (root, 12.0, tip, 1.25 * half, 0.0)


def _leg(shape: FootShape) -> tuple[float, float, Floats]:
    length = shape.foot_length
    # A superellipse of exponent 2.2 and axis ratio 0.74 goes round 6.40 times its mean half axis.
    mean_half_axis = shape.ankle_girth / 6.40
    depth, width = 1.15 * mean_half_axis, 0.85 * mean_half_axis
    knots = np.linspace(15.0, 125.0, INTERVALS + 1)
    rear = _curve((15.0, 40.0, 75.0, 100.0, 125.0), np.array((0.060, 0.062, 0.070, 0.064, 0.050)) * length)(knots)
    half_depth = depth * _curve((15.0, 50.0, 80.0, 125.0), (1.12, 1.10, 1.03, 0.98))(knots)
    half_width = _curve(
        (15.0, 50.0, 75.0, 125.0),
        (0.40 * shape.ankle_breadth, 0.42 * shape.ankle_breadth, 0.43 * shape.ankle_breadth, width),
    )(knots)
    profiles = np.array([rear + half_depth, np.zeros_like(knots), half_depth, half_width])
    return _spline(knots, profiles)


def _malleoli(shape: FootShape) -> Floats:
    length, half = shape.foot_length, shape.ankle_breadth / 2
    more = shape.ankle_swelling
    medial_axes, lateral_axes = (21.0 + more, 9.5 + more, 23.0 + more), (17.0 + more, 8.5 + more, 22.0 + more)
    medial = (0.245 * length, half - 9.5, shape.malleolus_height + 0.03 * length, *medial_axes)
    lateral = (0.205 * length, -half + 8.5, shape.malleolus_height, *lateral_axes)
    return np.array([medial, lateral])


def _heel_level(shape: FootShape) -> float:
    return 0.092 * shape.foot_length


def _pad_centres(shape: FootShape) -> list[float]:
    """Y of the toe pads, toe 2 on the axis, `toe_gap` between neighbours."""
    half = [0.5 * part * shape.foot_breadth for part in TOE_BREADTHS]
    centres = [half[0] + shape.toe_gap + half[1], 0.0]
    for toe in (2, 3, 4):
        centres.append(centres[-1] - half[toe - 1] - shape.toe_gap - half[toe])
    return centres


def _pad_level(shape: FootShape, toe: int) -> float:
    return 0.42 * (shape.hallux_height if toe == 0 else TOE_HEIGHTS[toe] * shape.foot_length)


def _curve(stations: Sequence[float] | Floats, values: Sequence[float] | Floats) -> PchipInterpolator:
    """Through the stations without overshoot, constant beyond them."""
    stations, values = np.asarray(stations), np.asarray(values)
    return PchipInterpolator(
        np.concatenate([[stations[0] - 1e3], stations, [stations[-1] + 1e3]]),
        np.concatenate([values[:1], values, values[-1:]]),
    )


def _smoothed(profiles: Floats) -> Floats:
    """Rounds the corners that the stations leave, over about two knots; ends stay."""
    for _ in range(4):
        profiles = profiles.copy()
        profiles[:, 1:-1] = (profiles[:, :-2] + 2 * profiles[:, 1:-1] + profiles[:, 2:]) / 4
    return profiles


def _spline(knots: Floats, profiles: Floats) -> tuple[float, float, Floats]:
    """Start, step and coefficients, shape (INTERVALS, profiles, 4), of the C2 splines through even `knots`."""
    coefficients = CubicSpline(knots, profiles, axis=1, bc_type="clamped").c
    return float(knots[0]), float(knots[1] - knots[0]), np.ascontiguousarray(np.transpose(coefficients, (1, 2, 0)))

"""Solves for the stations whose foot has the measures of its shape."""

from dataclasses import replace
from functools import lru_cache

from footscan.virtual.foot import measures as measure
from footscan.virtual.foot.field import Field
from footscan.virtual.foot.form import build_field, first_guess, toe_tips
from footscan.virtual.foot.shape import FootShape
from schemas.base.errors import RefusedInput

TOLERANCE_MM = 0.01
"""Largest error of a measure. Chosen by hand."""
ROUNDS = 30
"""A bound of time: five to ten rounds are enough."""
GOVERNED_BY = {
    "ball_length": ("medial_x", 1.0),
    "lateral_ball_length": ("lateral_x", 1.0),
    "foot_breadth": ("breadth", 1.0),
    "heel_breadth": ("heel", 0.7),
    "ball_girth": ("ball_height", 1.1),
    "instep_height": ("instep_height", 1.0),
    "arch_height": ("arch", 0.65),
    "hallux_height": ("hallux_height", 1.0),
}
"""Each measure's control, and about how much the measure grows with it. Chosen by hand; a poor value
costs rounds."""
PLAUSIBLE = (0.25, 3.0)
"""Range of a control, as a multiple of its first guess. Chosen by hand."""


@lru_cache(maxsize=4)
def solved_field(shape: FootShape) -> Field:
    """The surface of the foot that has the lengths, breadths, heights and ball girth of `shape`, to 0.01 mm.

    Each round adds what is missing from each measure to the control that governs it; five to ten rounds are enough.

    Raises
    ------
    RefusedInput
        No foot has these measures together; names the one that misses most.
    """
    controls = start = first_guess(shape)
    missing: dict[str, float] = {}
    for _ in range(ROUNDS):
        field = build_field(shape, controls)
        missing = {name: getattr(shape, name) - value for name, value in _governed(field, shape).items()}
        if max(map(abs, missing.values())) < TOLERANCE_MM:
            return field
        changed = {
            control: getattr(controls, control) + missing[name] / answer
            for name, (control, answer) in GOVERNED_BY.items()
        }
        if any(not PLAUSIBLE[0] < size / getattr(start, control) < PLAUSIBLE[1] for control, size in changed.items()):
            break
        controls = replace(controls, **changed)
    worst = max(missing, key=lambda name: abs(missing[name]))
    problem = f"expected measures that a foot can have together, found {getattr(shape, worst):.1f} mm"
    raise RefusedInput("foot shape", problem, field=worst)


def _governed(field: Field, shape: FootShape) -> dict[str, float]:
    length = shape.foot_length
    tibiale, fibulare = measure.metatarsal_points(field, length)
    return {
        "ball_length": tibiale[0],
        "lateral_ball_length": fibulare[0],
        "foot_breadth": tibiale[1] - fibulare[1],
        "heel_breadth": measure.heel_breadth(field, length),
        "ball_girth": measure.ball_girth(field, tibiale, fibulare),
        "instep_height": measure.instep_height(field, length),
        "arch_height": measure.arch_height(field, length),
        "hallux_height": measure.toe_height(field, toe_tips(shape)[0]),
    }

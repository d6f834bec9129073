"""Sizes and widths of shoes for a foot, in every system of a table."""

import math
from typing import NamedTuple

from footscan.sizing.readings import UsableMeasure, UsableMeasures, notes, usable_measure
from schemas.feet import Foot
from schemas.sizes import ArchRule, FoundSize, FoundWidth, People, Sizes, SizeScale, SizeTable, WidthScale

NEEDED = ("foot_length", "ball_length", "foot_breadth", "ball_girth")
"""Measures from which sizes and widths are computed"""
NOISE = 1e-9
"""Rounding error of a size, in steps: a size that differs from a step by less is that step."""


def foot_sizes(foot: Foot, table: SizeTable, people: People | None = None) -> Sizes:
    """Compute the sizes and widths of one foot, on the scales for `people` or on all.

    A size that lacks a measure is None, with a note that says why.
    """
    return sizes_of({name: usable_measure(foot, name) for name in NEEDED}, table, people)


def sizes_of(measures: UsableMeasures, table: SizeTable, people: People | None = None) -> Sizes:
    """Compute sizes and widths from measures, which may be those of two feet; `measures` has all of `NEEDED`."""
    sizes = [
        _size(name, scale, measures, table.arch)
        for name, scale in table.sizes.items()
        if people is None or people in scale.people
    ]
    widths = [
        _width(name, scale, measures)
        for name, scale in table.widths.items()
        if people is None or people in scale.people
    ]
    return Sizes(measures_mm={name: measures[name].mm for name in NEEDED}, sizes=sizes, widths=widths)


class _Deciding(NamedTuple):
    """The unrounded size by the length of a foot or by its arch."""

    value: float | None
    measure: str | None
    """The measure that decides the size"""
    note: str | None


def _size(name: str, scale: SizeScale, measures: UsableMeasures, arch: ArchRule) -> FoundSize:
    deciding = _deciding(scale, measures, arch)
    rounded, note = None, deciding.note
    value = deciding.value
    if value is not None:
        rounded = round_size(value, scale)
        limit = _beyond(rounded, scale)
        rounded, note = (None, notes(note, limit)) if limit else (rounded, note)
        if scale.restart and rounded is not None and rounded > scale.restart.after:
            rounded, value = rounded - scale.restart.by, value - scale.restart.by
    size = None if rounded is None else f"{rounded:g}"
    if size is not None and scale.breadth_step_mm:
        breadth = measures["foot_breadth"]
        note = notes(note, breadth.note)
        if breadth.mm is not None:
            size = f"{size}/{_nearest(breadth.mm / scale.breadth_step_mm) * scale.breadth_step_mm:g}"
    return FoundSize(
        system=name,
        label=scale.label,
        people=scale.people,
        size=size,
        unrounded=None if value is None else round(value, 3),
        rounding=f"{scale.step:g}, up beyond {scale.up_beyond:g}",
        decided_by="ball_length" if deciding.measure == "ball_length" else "foot_length" if deciding.measure else None,
        note=note,
        source=scale.source,
        confidence=scale.confidence,
    )


def _deciding(scale: SizeScale, measures: UsableMeasures, arch: ArchRule) -> _Deciding:
    """The size by the length of the foot, or by its arch if the scale has that rule and it gives more (Brannock)."""
    length, ball = measures["foot_length"], measures["ball_length"]
    if length.mm is None:
        return _Deciding(None, None, length.note)
    by_length = unrounded_size(length.mm, scale)
    if not scale.arch_rule:
        return _Deciding(by_length, "foot_length", length.note)
    if ball.mm is None:
        return _Deciding(by_length, "foot_length", notes(length.note, f"without the arch: {ball.note}"))
    by_arch = unrounded_size(ball.mm / arch.ball_share, scale)
    if by_arch - by_length < arch.from_sizes - NOISE:
        return _Deciding(by_length, "foot_length", length.note)
    decided = f"the arch decides: {by_arch - by_length:.2f} sizes above the foot length's"
    return _Deciding(by_arch, "ball_length", notes(length.note, ball.note, decided))


def unrounded_size(length_mm: float, scale: SizeScale) -> float:
    """The unrounded size of a foot length in mm, on the scale without its restart."""
    return (length_mm + scale.allowance_mm) / scale.unit_mm - scale.zero


def round_size(value: float, scale: SizeScale) -> float:
    """Round a size to a step of the scale: down, or up if more than `up_beyond` is left over.

    >>> from footscan.sizing.table import read_table
    >>> uk = read_table().sizes["uk"]
    >>> [round_size(value, uk) for value in (8.0, 8.25, 8.26, 8.75, 8.89)]
    [8.0, 8.0, 8.5, 8.5, 9.0]
    """
    steps = math.floor(value / scale.step + NOISE)
    left_over = value - steps * scale.step
    if left_over > scale.up_beyond + NOISE * scale.step:
        steps += 1
    return round(steps * scale.step, 6)


def _beyond(rounded: float, scale: SizeScale) -> str | None:
    if rounded < scale.smallest:
        return f"below the scale, which begins at {scale.smallest:g}"
    return f"above the scale, which ends at {scale.largest:g}" if rounded > scale.largest else None


def _width(name: str, scale: WidthScale, measures: UsableMeasures) -> FoundWidth:
    length, measured = measures["foot_length"], measures[scale.measure]
    steps = width_steps(length, measured, scale)
    width, limit = (None, None) if steps is None else _name_of(steps, scale)
    if length.mm is not None and not scale.shortest_mm <= length.mm <= scale.longest_mm:
        width, limit = None, f"for feet of {scale.shortest_mm:g} to {scale.longest_mm:g} mm"
    return FoundWidth(
        system=name,
        label=scale.label,
        people=scale.people,
        width=width,
        steps=None if steps is None else round(steps, 3),
        middle=scale.middle,
        measure=scale.measure,
        standard=scale.standard,
        note=notes(length.note, measured.note, limit),
        source=scale.source,
        confidence=scale.confidence,
    )


def width_steps(length: UsableMeasure, measured: UsableMeasure, scale: WidthScale) -> float | None:
    """Unrounded steps from the scale's middle width; None if a measure is missing."""
    if length.mm is None or measured.mm is None:
        return None
    middle = scale.middle_mm + scale.per_mm * (length.mm - scale.at_length_mm)
    return (measured.mm + scale.allowance_mm - middle) / scale.step_mm


def _name_of(steps: float, scale: WidthScale) -> tuple[str | None, str | None]:
    """Returns the nearest width, or the reason why there is none."""
    place = scale.names.index(scale.middle) + _nearest(steps)
    if place < 0:
        return None, f"narrower than {scale.names[0]}"
    if place >= len(scale.names):
        return None, f"wider than {scale.names[-1]}"
    return scale.names[place], None


def _nearest(value: float) -> int:
    """Nearest whole number; the larger of two equally near, as in JIS S 5037 (-3 to +2 mm of a step of 6)."""
    return math.floor(value + 0.5 + NOISE)

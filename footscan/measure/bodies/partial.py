"""Measures of a foot of which a part was not seen or is not there.

What is unknown is varied: the height of the floor below a sole that was not seen, the length and the axis of a foot
whose toes or heel are missing. A measure that stays the same holds all the same. One that changes is uncertain, or
incomplete if it changes by so much that a value says nothing.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.foot_landmarks import find_landmarks
from footscan.measure.frame.foot_frame import FootFrame, foot_frame
from footscan.measure.measures import measure_foot, take_measures
from footscan.measure.raw_mesh import RawMesh
from footscan.mesh.rigid_transform import apply, turn_about_z
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.measures import Axis, Measure, Measures

Floats = NDArray[np.float64]

DEEPER_MM = 5.0
"""The floor may lie this much lower than the rim of a sole that was not seen: depth cameras drop what is nearer than
about this to the floor. Chosen by hand."""
LONGER = (1.2, 1.45, 1.7)
"""Lengths of the whole foot, as multiples of what is there. An amputation through the metatarsals leaves 0.6 of it."""
TURNS_DEG = (-4.0, 4.0)
"""The axis of a foot whose toes or heel are missing may be turned by this much; chosen by hand."""
STEADY = {"mm": 0.3, "deg": 0.3, "1": 0.003, "mm2": 300.0, "mm3": 3000.0}
"""A measure that changes by less holds; by unit of the measure. Chosen by hand."""
SAYS_NOTHING = 0.15
"""A measure that changes by more than this share of its value is incomplete; chosen by hand."""
OF_SOLE = ("arch_height", "arch_index", "chippaux_smirak_index", "staheli_index", "clarke_angle")
"""Measures of the sole itself."""
OF_TOES = ("foot_length", "toe_length", "toe_height", "toe_1_angle", "toe_5_angle")
"""Measures of the toes themselves."""
SOLE_MISSING = "the sole was not seen"


class _Variants(NamedTuple):
    """Measures of the ways in which a foot may be completed."""

    reason: str
    measures: list[Mapping[str, Measure]]
    missing: tuple[str, ...]
    """Measures that cannot be taken"""


def measure_raw(
    mesh: RawMesh, side: Side = "unknown", axis: Axis = "toe2", manual: Mapping[str, Floats] | None = None
) -> Measures:
    """Measure a prepared mesh; parameters as of `measure_foot`.

    Raises
    ------
    Finding
        The surface is no foot.
    """
    is_whole = not mesh.missing
    base = measure_foot(mesh.vertices, mesh.faces, side, axis=axis, manual=manual, is_whole=is_whole)
    measures = dict(base.measures)
    for variants in _variants(mesh, base.side, axis, manual):
        for name, measure in measures.items():
            others = [other[name] for other in variants.measures]
            measures[name] = _judged(measure, others, variants.reason, name in variants.missing)
    if "toes" in mesh.missing and base.measures["foot_length"].value is not None:
        note = "up to where the surface ends: the toes are missing"
        measures["foot_length"] = base.measures["foot_length"].model_copy(update={"status": "uncertain", "note": note})
    return base.model_copy(update={"measures": measures})


def _variants(mesh: RawMesh, side: Side, axis: Axis, manual: Mapping[str, Floats] | None) -> Iterator[_Variants]:
    if mesh.closing is not None:
        deeper = mesh.vertices - DEEPER_MM * np.outer(mesh.closing, mesh.up)
        try:
            taken = measure_foot(deeper, mesh.faces, side, axis=axis, manual=manual, is_whole=not mesh.missing)
            lower = [taken.measures]
        except Finding:
            lower = [{}]
        yield _Variants("the sole was not seen and was closed by the floor", _filled_up(lower), OF_SOLE)
    if mesh.missing:
        foot = foot_frame(mesh.vertices, mesh.faces, side, axis, manual, is_whole=False)
        completed = [_taken(one, manual) for one in _completed(foot, "heel" in mesh.missing)]
        part = " and ".join(mesh.missing)
        verb = "are" if part == "toes" else "is"
        missing = OF_TOES if "toes" in mesh.missing else ()
        yield _Variants(f"the {part} {verb} missing", _filled_up(completed), missing)


class _None(dict[str, Measure]):
    """Measures of a variant that is no foot."""

    def __missing__(self, name: str) -> Measure:
        return Measure(value=None, unit="mm", status="incomplete", definition=name)


def _filled_up(variants: list[dict[str, Measure]]) -> list[Mapping[str, Measure]]:
    return [_None(one) for one in variants]


def _completed(foot: FootFrame, at_heel: bool) -> Iterator[FootFrame]:
    """Yield the foot in the frames that it would have if it were whole."""
    for longer in LONGER:
        length = longer * foot.length
        yield _moved(foot, length, 0.0, length - foot.length if at_heel else 0.0)
    for turn in TURNS_DEG:
        yield _moved(foot, foot.length, turn, 0.0)


def _moved(foot: FootFrame, length: float, turn_deg: float, ahead: float) -> FootFrame:
    motion = turn_about_z(np.deg2rad(turn_deg))
    motion[0, 3] += ahead
    return foot._replace(
        vertices=apply(motion, foot.vertices),
        samples=apply(motion, foot.samples),
        transform=motion @ foot.transform,
        length=length,
    )


def _taken(foot: FootFrame, manual: Mapping[str, Floats] | None) -> dict[str, Measure]:
    try:
        return take_measures(foot, find_landmarks(foot, manual or {}))
    except (Finding, ValueError):  # a window in which a landmark is sought holds no surface
        return {}


def _judged(measure: Measure, others: list[Measure], reason: str, is_missing: bool) -> Measure:
    """The measure, judged by how it changes in other ways to complete the foot."""
    if measure.value is None:
        return measure
    without_value = {"value": None, "uncertainty": None, "status": "incomplete", "surface_length": None, "plane": None}
    values = [measure.value, *(other.value for other in others if other.value is not None)]
    change = float(np.ptp(values))
    if is_missing or len(values) == 1 or change > SAYS_NOTHING * abs(measure.value):
        return measure.model_copy(update={**without_value, "note": reason})
    note = reason if measure.note is None else f"{measure.note}; {reason}"
    if len(values) <= len(others):
        return measure.model_copy(update={"status": "uncertain", "note": note})
    if change <= STEADY[measure.unit]:
        return measure
    sd = float(np.hypot(measure.uncertainty or 0.0, change / 2))
    return measure.model_copy(update={"status": "uncertain", "note": note, "uncertainty": round(sd, 3)})

"""Measures of prepared meshes: of a foot of which a part was not seen or is not there, and of a pair.

What is unknown is varied: the height of the floor below a sole that was not seen, the length and the axis of a foot
whose toes or heel are missing. A measure that stays the same holds all the same. One that changes is uncertain, or
incomplete if it changes by so much that a value says nothing.
"""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.measure.bodies.raw_mesh import RawMesh
from footscan.measure.bodies.shell import continued
from footscan.measure.foot_landmarks import find_landmarks
from footscan.measure.frame.foot_frame import Body, FootFrame, foot_frame
from footscan.measure.measures import measure_foot, take_measures
from footscan.mesh.rigid_transform import apply, turn_about_z
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.measures import Axis, Measure, Measures

Floats = NDArray[np.float64]

DEEPER_MM = 5.0
"""The floor may lie this much lower than the rim of a sole that was not seen: depth cameras drop what is nearer than
about this to the floor. Chosen by hand."""
HIGHER_MM = 5.0
"""By this much the cut through the leg is raised, to see what rests on it; chosen by hand."""
HIGHER_RIM_MM = 5.0, 10.0
"""By so much the skin of a shell goes on beyond its rim: feet are longest and broadest at 10 to 25 mm. Chosen by
hand."""
LEAST_TILT_DEG = 0.05
"""A floor that is known better is not tilted; chosen by hand."""
LONGER = (1.2, 1.45, 1.7)
"""Lengths of the whole foot, as multiples of what is there. An amputation through the metatarsals leaves 0.6 of it."""
TURNS_DEG = (-8.0, 8.0)
"""The axis of a foot whose toes or heel are missing may be turned by this much: the footprint of a foot that is cut off
at 0.62 of its length is turned by 7 degrees. Chosen by hand."""
STEADY = {"mm": 0.3, "deg": 0.3, "1": 0.003, "mm2": 300.0, "mm3": 3000.0}
"""A measure that changes by less holds; by unit of the measure. Chosen by hand."""
SAYS_NOTHING, SAYS_LITTLE = 0.15, {"mm": 6.0, "deg": 6.0}
"""A measure that changes by more than this share of its value, and by more than this many units, is incomplete; chosen
by hand."""
LEG_CUT = "it rests on the cut through the leg"
OF_SOLE = ("arch_height", "arch_index", "chippaux_smirak_index", "staheli_index", "clarke_angle")
"""Measures of the sole itself."""
OF_UPPER_SIDE = ("scan_height", "foot_volume", "foot_surface", "instep_length", "instep_girth_min")
"""Measures that rest on the upper side, whatever they are without it."""
OF_TOES = ("foot_length", "toe_length", "toe_height", "toe_1_angle", "toe_5_angle")
"""Measures of the toes themselves."""
OF_HEEL = (
    *("foot_length", "ball_length", "lateral_ball_length", "instep_length", "arch_height_index"),
    *("heel_breadth", "heel_angle", "heel_girth", "long_heel_girth"),
)
"""Measures of the heel itself."""
ALIKE = 0.7
"""Feet stand side by side if they point the same way by more than this cosine; chosen by hand."""


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
    base = measure_foot(mesh.vertices, mesh.faces, side, axis=axis, manual=manual, body=_body(mesh))
    measures = dict(base.measures)
    for variants in _variants(mesh, base.side, axis, manual):
        for name, measure in measures.items():
            if name == "scan_height" and variants.reason == LEG_CUT:  # it is the height of the cut, by definition
                continue
            others = [other[name] for other in variants.measures]
            measures[name] = _judged(measure, others, variants.reason, name in variants.missing)
    if mesh.missing == ("toes",) and base.measures["foot_length"].value is not None:
        measured = base.measures["foot_length"]
        note = "up to where the surface ends: the toes are missing"
        measures["foot_length"] = measured.model_copy(update={"status": "uncertain", "note": note, "uncertainty": None})
    return base.model_copy(update={"measures": measures})


def measure_pair(
    feet: tuple[RawMesh, RawMesh], axis: Axis = "toe2"
) -> dict[Literal["left", "right"], tuple[RawMesh, Measures]]:
    """Measure both feet. Their sides follow from their form; if both look alike, from their places side by side.

    Raises
    ------
    Finding
        One is no foot, or they are not a left and a right one.
    """
    first, second = (measure_raw(foot, "unknown", axis) for foot in feet)
    if first.side == second.side:
        is_first_right = _lies_right(feet[0], first, feet[1], second)
        if is_first_right is None:
            raise Finding(f"the surface has 2 separate bodies, both like a {first.side} foot, expected a pair")
        if is_first_right == (first.side == "right"):
            second = measure_raw(feet[1], "left" if is_first_right else "right", axis)
        else:
            first = measure_raw(feet[0], "right" if is_first_right else "left", axis)
        for foot in (first, second):
            if foot.side_note is not None:
                raise Finding(f"the surface has 2 separate bodies, and of the {foot.side} one {foot.side_note}")
    of_first, of_second = (feet[0], first), (feet[1], second)
    return {"left": of_first, "right": of_second} if first.side == "left" else {"left": of_second, "right": of_first}


def _lies_right(mesh: RawMesh, measures: Measures, other: RawMesh, of_other: Measures) -> bool | None:
    """True if a foot stands on the right of the other, False if on its left; None if not side by side."""
    transform, second = np.array(measures.transform), np.array(of_other.transform)
    if transform[0, :3] @ second[0, :3] < ALIKE:
        return None
    away = np.mean(apply(transform, other.vertices), axis=0) - np.mean(apply(transform, mesh.vertices), axis=0)
    if abs(away[1]) < abs(away[0]):
        return None
    is_mirrored = np.linalg.det(transform[:3, :3]) < 0
    return bool((away[1] > 0) != is_mirrored)


def _variants(mesh: RawMesh, side: Side, axis: Axis, manual: Mapping[str, Floats] | None) -> Iterator[_Variants]:
    up = mesh.to_floor[2, :3]
    if mesh.closing is not None:
        deeper = mesh._replace(vertices=mesh.vertices - DEEPER_MM * np.outer(mesh.closing, up))
        others = [_measured(deeper, _shifted(DEEPER_MM), side, axis, manual)]
        if mesh.tilt_deg > LEAST_TILT_DEG:
            turns = [_tilted(about, sign * mesh.tilt_deg) for about in ("x", "y") for sign in (-1, 1)]
            others += [_measured(mesh, turn, side, axis, manual) for turn in turns]
        yield _Variants("the sole was not seen and was closed by the floor", _filled_up(others), OF_SOLE)
    if mesh.lid is not None:
        longer = _measured(
            mesh._replace(vertices=mesh.vertices + HIGHER_MM * np.outer(mesh.lid, up)), np.eye(4), side, axis, manual
        )
        yield _Variants(LEG_CUT, _filled_up([longer]), ())
    if mesh.shell is not None:
        shapes = [continued(mesh.vertices, mesh.faces, mesh.shell.transform[2, :3], mm) for mm in HIGHER_RIM_MM]
        higher = [_measured(mesh._replace(vertices=v, faces=f), np.eye(4), side, axis, manual) for v, f in shapes]
        yield _Variants("the upper side is missing", _filled_up(higher), OF_UPPER_SIDE)
    if mesh.missing:
        foot = foot_frame(mesh.vertices, mesh.faces, side, axis, manual, body=_body(mesh))
        completed = [_taken(one, manual) for one in _completed(foot, "heel" in mesh.missing)]
        part = " and ".join(mesh.missing)
        verb = "are" if part == "toes" else "is"
        missing = OF_TOES if "toes" in mesh.missing else OF_HEEL
        yield _Variants(f"the {part} {verb} missing", _filled_up(completed), missing)


def _body(mesh: RawMesh, motion: Floats | None = None) -> Body:
    """What is known of the mesh; `motion` is a (4, 4) error of its floor, which matters if the sole was not seen."""
    if mesh.closing is None:
        return Body(not mesh.missing, shell=mesh.shell)
    return Body(not mesh.missing, mesh.to_floor if motion is None else motion @ mesh.to_floor)


def _shifted(upwards_mm: float) -> Floats:
    motion = np.eye(4)
    motion[2, 3] = upwards_mm
    return motion


def _tilted(about: str, degrees: float) -> Floats:
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler(about, degrees, degrees=True).as_matrix()
    return motion


def _measured(
    mesh: RawMesh, motion: Floats, side: Side, axis: Axis, manual: Mapping[str, Floats] | None
) -> dict[str, Measure]:
    """Measures of a variant; none if that is no foot."""
    try:
        body = _body(mesh, motion)
        return measure_foot(mesh.vertices, mesh.faces, side, axis=axis, manual=manual, count=0, body=body).measures
    except Finding:
        return {}


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
        return take_measures(foot, find_landmarks(foot, manual or {}), count=0)
    except (Finding, ValueError):  # a window in which a landmark is sought holds no surface
        return {}


def _judged(measure: Measure, others: list[Measure], reason: str, is_missing: bool) -> Measure:
    """The measure, judged by how it changes in other ways to complete the foot."""
    if measure.value is None:
        return measure
    without_value = {"value": None, "uncertainty": None, "status": "incomplete", "surface_length": None, "plane": None}
    values = [measure.value, *(other.value for other in others if other.value is not None)]
    change = float(np.ptp(values))
    most = max(SAYS_NOTHING * abs(measure.value), SAYS_LITTLE.get(measure.unit, 0.0))
    if is_missing or 2 * len(values) <= len(others) + 1 or change > most:
        return measure.model_copy(update={**without_value, "note": reason})
    if len(values) > len(others) and change <= STEADY[measure.unit]:
        return measure
    note = reason if measure.note is None else f"{measure.note}; {reason}"
    sd = round(float(np.hypot(measure.uncertainty or 0.0, change / 2)), 3)
    return measure.model_copy(update={"status": "uncertain", "note": note, "uncertainty": sd})

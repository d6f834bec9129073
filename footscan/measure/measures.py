"""The measures of a foot: their definitions, and their values for a mesh."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure import girths, linear, plantar, solid
from footscan.measure.attached import things_at_foot
from footscan.measure.definitions.conventions import CONVENTIONS, OWN
from footscan.measure.foot_landmarks import Landmark, find_landmarks
from footscan.measure.foot_surface import FootSurface
from footscan.measure.frame.foot_frame import Body, FootFrame, foot_frame
from footscan.measure.frame.glass import glass_doubt, glass_sd
from footscan.measure.quantity import NotMeasurable, Quantity
from footscan.measure.replicates import REPLICATES, of_replicates
from footscan.measure.roughness import Roughness
from footscan.measure.uncertainty import Scatter, SurfaceErrors, scatter_of, with_landmarks
from footscan.mesh.nearest import tree_of
from footscan.mesh.rigid_transform import apply
from footscan.side_by_side import cores, together
from footscan.surface.errors.field import ErrorField
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.glass import GlassPlane
from schemas.measures import Axis, Measure, MeasuredLandmark, Measures, Position, Status, Unit

Floats = NDArray[np.float64]

FILLED_SHARE = 0.05
"""A measure of which more than this share rests on filled surface is uncertain; chosen by hand."""
LARGEST_SD_MM, LARGEST_GIRTH_SD_MM = 1.0, 2.0
"""Standard deviations from which a length and a girth are uncertain: half of what ISO 20685-1:2018 allows a scanner to
be off, 2 mm for the foot and 4 mm for small circumferences."""
NO_SECOND_TOE = "the axis runs through the ball, since the second toe was not found: set toe_2_tip by footscan edit"
HEIGHT, PRINT = "_height", "footprint"
"""Ending of the names of measures that count from the glass, and a word in the texts of those on the print."""
ROUGH_MM = 0.05
"""Median roughness of a mesh at which landmarks begin to move, and propagation is no longer linear. Chosen by hand."""
MISSING_SHARE = 0.2
"""A measure that more than this share of the replicates does not have is uncertain. Chosen by hand."""
DIGITS: dict[Unit, int] = {"mm": 3, "mm2": 0, "mm3": 0, "deg": 2, "1": 4}
"""Decimals of a value, by its unit."""


class Definition(NamedTuple):
    """The unit of a measure, its definition in words, and the function that computes it."""

    unit: Unit
    text: str
    compute: Callable[[FootSurface], Quantity]

    @property
    def is_on_axis(self) -> bool:
        """True if it is taken along or across the foot axis."""
        return "axis" in self.text


def _definitions() -> dict[str, Definition]:
    """Definitions of all measures, in the order in which they are shown."""
    along, across, height = linear.along_axis, linear.across_axis, linear.height
    tape = "tape in the plane"
    return {
        "foot_length": Definition("mm", "rearmost heel point to the longest toe, along the axis", linear.foot_length),
        "foot_breadth": Definition(
            "mm",
            "between the tangents, parallel to the axis, at the heads of the first and fifth metatarsals",
            partial(across, medial="metatarsale_tibiale", lateral="metatarsale_fibulare"),
        ),
        "foot_breadth_diagonal": Definition(
            "mm", "between the heads of the first and fifth metatarsals, on the level", linear.foot_breadth_diagonal
        ),
        "foot_breadth_max": Definition(
            "mm", "between the tangents parallel to the axis, at 55 to 85 % of the length", linear.foot_breadth_max
        ),
        "ball_length": Definition(
            "mm",
            "rearmost heel point to the head of the first metatarsal, along the axis",
            partial(along, name="metatarsale_tibiale"),
        ),
        "lateral_ball_length": Definition(
            "mm",
            "rearmost heel point to the head of the fifth metatarsal, along the axis",
            partial(along, name="metatarsale_fibulare"),
        ),
        "instep_length": Definition(
            "mm", "rearmost heel point to the instep point, along the axis", partial(along, name="instep_point")
        ),
        "toe_length": Definition(
            "mm", "head of the first metatarsal to the longest toe, along the axis", linear.toe_length
        ),
        "ball_angle": Definition(
            "deg",
            "between the line through the heads of the first and fifth metatarsals and the axis",
            linear.ball_angle,
        ),
        "heel_breadth": Definition(
            "mm",
            "most medial to most lateral point at 10 to 20 % of the foot length, up to 40 mm high, across the axis",
            linear.heel_breadth,
        ),
        "midfoot_breadth": Definition(
            "mm", "section at half the foot length, up to 60 mm high, across the axis", linear.midfoot_breadth
        ),
        "bimalleolar_breadth": Definition(
            "mm",
            "most prominent points of both malleoli, across the axis",
            partial(across, medial="medial_malleolus", lateral="lateral_malleolus"),
        ),
        "ball_height": Definition(
            "mm", "highest point of the upright section through both metatarsal heads", linear.ball_height
        ),
        "toe_height": Definition("mm", "highest point of the big toe 12.5 mm behind its tip", linear.toe_height),
        "instep_height": Definition("mm", "floor to the highest point at half the foot length", linear.instep_height),
        "arch_height": Definition(
            "mm",
            "highest point of the sole at 30 to 60 % of the foot length, a third of the midfoot's breadth from its "
            "medial edge",
            linear.arch_height,
        ),
        "arch_height_index": Definition("1", "instep height over ball length", linear.arch_height_index),
        "navicular_height": Definition("mm", "floor to the navicular", partial(height, name="navicular")),
        "medial_malleolus_height": Definition(
            "mm", "floor to the most prominent point of the medial malleolus", partial(height, name="medial_malleolus")
        ),
        "lateral_malleolus_height": Definition(
            "mm",
            "floor to the most prominent point of the lateral malleolus",
            partial(height, name="lateral_malleolus"),
        ),
        "toe_1_angle": Definition(
            "deg",
            "line from the medial side of the heel to the head of the first metatarsal, against its tangent to the big "
            "toe; positive where that turns to the lateral side",
            linear.toe_1_angle,
        ),
        "toe_5_angle": Definition(
            "deg",
            "line from the lateral side of the heel to the head of the fifth metatarsal, against its tangent to the "
            "little toe; positive where that turns to the medial side",
            linear.toe_5_angle,
        ),
        "heel_angle": Definition(
            "deg",
            "middle of the heel's rear, from 6 to 20 % of the foot length high, against the vertical; positive where "
            "it leans to the medial side upwards",
            linear.heel_angle,
        ),
        "ball_girth": Definition("mm", f"{tape} that stands upright on both metatarsal heads", girths.ball_girth),
        "straight_ball_girth": Definition(
            "mm", f"{tape} across the axis at the head of the first metatarsal", girths.straight_ball_girth
        ),
        "waist_girth": Definition(
            "mm",
            f"{tape} across the axis, midway between the middle of the ball and half the length",
            girths.waist_girth,
        ),
        "instep_girth": Definition("mm", f"{tape} across the axis at half the foot length", girths.instep_girth),
        "instep_girth_min": Definition(
            "mm", "least tape through the instep point, tilted by at most 30 degrees", girths.instep_girth_min
        ),
        "heel_girth": Definition(
            "mm",
            f"{tape} across the foot through the landing point and the junction of foot and leg",
            girths.heel_girth,
        ),
        "long_heel_girth": Definition(
            "mm",
            f"{tape} across the foot through the rear of the heel on the floor and the instep point",
            girths.long_heel_girth,
        ),
        "ankle_girth": Definition("mm", "least level tape above the malleoli", girths.ankle_girth),
        "arch_index": Definition(
            "1",
            "middle third of the footprint without toes over the whole (Cavanagh and Rodgers 1987)",
            plantar.arch_index,
        ),
        "chippaux_smirak_index": Definition(
            "1",
            "least width of the footprint's middle third over the greatest of its front third",
            plantar.chippaux_smirak,
        ),
        "staheli_index": Definition(
            "1",
            "least width of the footprint's middle third over the greatest of its rear third",
            plantar.staheli,
        ),
        "clarke_angle": Definition(
            "deg",
            "between the footprint's medial tangent and the line from there, beside the head of the first metatarsal, "
            "to the deepest point of the arch",
            plantar.clarke_angle,
        ),
        "foot_volume": Definition("mm3", "below the height of the junction of foot and leg", solid.foot_volume),
        "foot_surface": Definition(
            "mm2", "skin below the height of the junction of foot and leg, sole included", solid.foot_surface
        ),
        "scan_height": Definition("mm", "floor to the highest point of the surface", linear.scan_height),
    }


def measure_foot(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    side: Side,
    *,
    axis: Axis = "toe2",
    manual: Mapping[str, Floats] | None = None,
    errors: Sequence[ErrorField] | None = None,
    count: int | None = None,
    filled: NDArray[np.bool_] | None = None,
    calibration: Mapping[str, tuple[float, float]] | None = None,
    glass: GlassPlane | None = None,
    doubts: Sequence[str] = (),
    body: Body | None = None,
) -> Measures:
    """Measure a foot in any pose. A left foot is mirrored and measured as a right one.

    Parameters
    ----------
    vertices : (V, 3) mm, any frame
    faces : (F, 3), looking outward
    side : "unknown" is inferred from the form
    axis : the requested foot axis
    manual : landmarks set by a person: name to (3,) mm in the frame of the mesh
    errors : errors of the V vertices by their cause; default: inferred from the roughness of the mesh
    count : number of replicates by which the errors of the vertices are propagated, see `of_replicates`; 0: propagation
        is linear; default: `REPLICATES` if the mesh is rough, 0 if not
    filled : (V,) true for vertices that were filled, not measured
    calibration : name of a measure to (a, b): the reported value is a + b times the measured one
    glass : the scanner's glass in the frame of the mesh; default: at Z = 0
    doubts : reasons, a sentence each, not to rely on the scan: all measures are uncertain
    body : as of `foot_frame`

    Raises
    ------
    Finding
        The surface is no foot, or not in mm.
    """
    glass_sd_mm, glass = (0.0, GlassPlane()) if glass is None else (glass_sd(glass), glass)
    foot = foot_frame(vertices, faces, side, axis, manual, glass.plane, body)
    landmarks = find_landmarks(foot, manual or {})
    if errors is not None or filled is not None:  # the foot's vertices are those of the mesh without its strays
        back = apply(np.linalg.inv(foot.transform), foot.vertices)
        source = np.asarray(tree_of(vertices.astype(np.float64)).query(back, workers=cores())[1])
        errors = None if errors is None else [field.of(source) for field in errors]
        filled = None if filled is None else filled[source]
    # A cut end is a step of its own.
    things = things_at_foot(foot) if body is None or body.is_whole else []
    reasons = [*doubts, *filter(None, [glass_doubt(glass)])]
    return Measures(
        side=foot.side,
        side_note=foot.side_note,
        things=things,
        doubts=reasons,
        axis=foot.axis,
        transform=foot.transform.tolist(),
        measures=take_measures(
            foot,
            landmarks,
            errors=errors,
            count=count,
            filled=filled,
            calibration=calibration,
            doubt="; ".join([*reasons, *things]) or None,
            axis_doubt=NO_SECOND_TOE if axis == "toe2" != foot.axis else None,
            glass_sd_mm=glass_sd_mm,
        ),
        landmarks=_in_mesh(landmarks, foot.transform),
    )


def take_measures(
    foot: FootFrame,
    landmarks: Mapping[str, Landmark],
    *,
    errors: Sequence[ErrorField] | None = None,
    count: int | None = None,
    filled: NDArray[np.bool_] | None = None,
    calibration: Mapping[str, tuple[float, float]] | None = None,
    doubt: str | None = None,
    axis_doubt: str | None = None,
    glass_sd_mm: float = 0.0,
) -> dict[str, Measure]:
    """Compute all measures of a foot in its own frame.

    Parameters are those of `measure_foot`; arrays (V,) are by the vertices of `foot`. `doubt` is a reason for which all
    measures are uncertain, `axis_doubt` one for those on the foot axis, `glass_sd_mm` the standard deviation of the
    floor from which heights count.
    """
    surface = FootSurface(foot, landmarks)
    known = SurfaceErrors(foot.vertices, [ErrorField("noise", surface.errors)] if errors is None else errors)
    if count is None:
        count = REPLICATES if errors is None and np.median(surface.errors) > ROUGH_MM else 0
    to_mesh = np.linalg.inv(foot.transform).astype(np.float64)
    marked = {name: one.point for name, one in landmarks.items() if one.method == "manual"}
    manual = {name: apply(to_mesh, point[None])[0] for name, point in marked.items()}
    compute = partial(_values, rough=surface.roughness, manual=manual)
    scatter = scatter_of(of_replicates(foot, known, count, compute, marked), count, foot.axis_not_found is not None)
    definitions = _definitions()

    def measured(name: str) -> Measure:
        definition = definitions[name]
        floor_sd_mm = glass_sd_mm if name.endswith(HEIGHT) or PRINT in definition.text else 0.0
        reasons = [*filter(None, [doubt, axis_doubt if definition.is_on_axis else None])]
        known_errors, own = (known, scatter.get(name), floor_sd_mm), (calibration or {}).get(name)
        measure = _measure(definition, surface, known_errors, filled, own, to_mesh, reasons)
        return measure.model_copy(update={"convention": CONVENTIONS.get(name, OWN)})

    return dict(zip(definitions, together(partial(measured, name) for name in definitions), strict=True))


def _values(replicate: FootFrame, rough: Roughness, manual: Mapping[str, Floats]) -> dict[str, float]:
    """The lengths, angles and indices that can be taken of a replicate; areas and volumes hardly rest on landmarks."""
    values: dict[str, float] = {}
    try:
        surface = FootSurface(replicate, find_landmarks(replicate, manual), rough)
    except Finding:  # it is no foot any more
        return values
    for name, definition in _definitions().items():
        if definition.unit not in ("mm2", "mm3"):
            with suppress(NotMeasurable):
                values[name] = definition.compute(surface).value
    return values


def _measure(
    definition: Definition,
    surface: FootSurface,
    errors: tuple[SurfaceErrors, Scatter | None, float],
    filled: NDArray[np.bool_] | None,
    calibration: tuple[float, float] | None,
    to_mesh: Floats,
    reasons: list[str],
) -> Measure:
    try:
        quantity = definition.compute(surface)
    except NotMeasurable as missing:
        return Measure(
            value=None, unit=definition.unit, status="incomplete", definition=definition.text, note=str(missing)
        )
    offset, factor = calibration or (0.0, 1.0)
    digits = DIGITS[definition.unit]
    share = None if filled is None else round(quantity.share(filled), 3)
    doubts = [*reasons] if quantity.doubt is None else [quantity.doubt, *reasons]
    if share is not None and share > FILLED_SHARE:
        doubts.append(f"{100 * share:.0f} % of it rests on surface that was filled, or that one camera alone saw")
    surface_errors, scatter, glass_sd_mm = errors
    if scatter is not None and scatter.missing > MISSING_SHARE:
        doubts.append(f"{100 * scatter.missing:.0f} % of the replicates, displaced as the scan may err, do not have it")
    budget = with_landmarks(surface_errors.budget(quantity), scatter, quantity.value)
    if budget is not None and glass_sd_mm:
        lift = quantity.by_lift(surface.normals) if PRINT in definition.text else 1.0
        budget = None if lift is None else {**budget, "glass": glass_sd_mm * lift}
    sd = None if budget is None else abs(factor) * math.hypot(*budget.values())
    largest = LARGEST_SD_MM if quantity.plane is None else LARGEST_GIRTH_SD_MM
    if sd is not None and sd > largest and definition.unit == "mm":
        doubts.append(f"its standard deviation exceeds {largest:g} mm")
    status: Status = "uncertain" if doubts else "ok"
    return Measure(
        value=round(offset + factor * quantity.value, digits),
        unit=definition.unit,
        status=status,
        definition=definition.text,
        note="; ".join([*doubts, *([] if quantity.note is None else [quantity.note])]) or None,
        uncertainty=None if sd is None else round(sd, digits + 1),
        budget=None if budget is None else {cause: round(abs(factor) * sd, digits + 1) for cause, sd in budget.items()},
        surface_length=None if quantity.surface_length is None else round(quantity.surface_length, 3),
        plane=None if quantity.plane is None else _plane_in_mesh(*quantity.plane, to_mesh),
        filled_share=share,
        calibration=calibration,
    )


def _plane_in_mesh(point: Floats, normal: Floats, to_mesh: Floats) -> tuple[Position, Position]:
    moved, turned = apply(to_mesh, point[None])[0], to_mesh[:3, :3] @ normal
    return _place(moved, 3), _place(turned / np.linalg.norm(turned), 6)


def _place(point: Floats, digits: int) -> Position:
    x, y, z = np.round(point, digits).tolist()
    return x, y, z


def _in_mesh(landmarks: Mapping[str, Landmark], transform: Floats) -> dict[str, MeasuredLandmark]:
    back = np.linalg.inv(transform)
    return {
        name: MeasuredLandmark(
            point=_place(apply(back, landmark.point[None])[0], 3),
            method=landmark.method,
            confidence=landmark.confidence,
            note=landmark.note,
        )
        for name, landmark in landmarks.items()
    }

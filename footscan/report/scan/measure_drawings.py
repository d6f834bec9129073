"""Places of the measures on the foot: sections, spans and landmarks, drawn over the surface."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.sections import Cuttable, cut, cuttable
from footscan.report.surface_views import upright
from footscan.report.viewer import Drawing
from schemas.measures import Measure, Measures

Floats = NDArray[np.float64]

SECTION_OF = {"ball_height": "ball_girth", "instep_height": "instep_girth", "midfoot_breadth": "instep_girth"}
"""Measures that are taken in the plane of a girth."""
_X, _Y, _Z = np.eye(3)
SPANS = {
    "foot_length": ("pternion", _X),
    "ball_length": ("pternion", _X),
    "lateral_ball_length": ("pternion", _X),
    "instep_length": ("pternion", _X),
    "toe_length": ("metatarsale_tibiale", _X),
    "foot_breadth": ("metatarsale_fibulare", _Y),
    "bimalleolar_breadth": ("lateral_malleolus", _Y),
    "navicular_height": ("navicular", -_Z),
    "medial_malleolus_height": ("medial_malleolus", -_Z),
    "lateral_malleolus_height": ("lateral_malleolus", -_Z),
}
"""Measures that extend by their value from a landmark in a direction of the foot's own frame, +Y medial."""
ENDS = {
    "ball_length": ("metatarsale_tibiale",),
    "lateral_ball_length": ("metatarsale_fibulare",),
    "instep_length": ("instep_point",),
    "foot_breadth": ("metatarsale_tibiale",),
    "foot_breadth_diagonal": ("metatarsale_tibiale", "metatarsale_fibulare"),
    "ball_angle": ("metatarsale_tibiale", "metatarsale_fibulare"),
    "bimalleolar_breadth": ("medial_malleolus",),
    "toe_1_angle": ("heel_medial", "metatarsale_tibiale"),
    "toe_5_angle": ("heel_lateral", "metatarsale_fibulare"),
    "instep_girth_min": ("instep_point",),
    "heel_girth": ("landing_point", "junction_point"),
    "long_heel_girth": ("instep_point",),
    "ball_girth": ("metatarsale_tibiale", "metatarsale_fibulare"),
}
"""Further landmarks of a measure. If it has two and neither section nor span, a line joins them."""


def measure_drawings(vertices: Floats, faces: NDArray[np.integer], measures: Measures) -> dict[str, Drawing]:
    """Drawings of the measures that have a place on the foot, by measure name, mm, in the frame of `upright`.

    Parameters
    ----------
    vertices : (V, 3) mm, the frame of the mesh that was measured
    faces : (F, 3)
    """
    loops = girth_loops(vertices, faces, measures)
    drawings = {}
    for name, measure in measures.measures.items():
        lines = [*loops.get(name, loops.get(SECTION_OF.get(name, ""), [])), *_span(name, measure, measures)]
        points = [landmark_place(measures, mark) for mark in _landmarks(name) if mark in measures.landmarks]
        if not lines and len(points) == 2 and measure.value is not None:
            lines = [np.array(points)]
        if lines and measure.value is not None:
            drawings[name] = Drawing(lines, points)
    return drawings


def girth_loops(vertices: Floats, faces: NDArray[np.integer], measures: Measures) -> dict[str, list[Floats]]:
    """Closed curves of the girths, by measure name; a list is empty if the plane of the girth does not cut the mesh.

    A curve is (N, 3) mm, in the frame of `upright`; its last point is its first. Parameters as in `measure_drawings`.
    """
    planes = {name: measure for name, measure in measures.measures.items() if measure.plane is not None}
    if not planes:
        return {}
    mesh = cuttable(vertices, faces)
    return {
        name: [upright(loop, measures.transform) for loop in _loops(mesh, measure)] for name, measure in planes.items()
    }


def landmark_place(measures: Measures, name: str) -> Floats:
    """Position of a landmark, (3,) mm, in the frame of `upright`."""
    place: Floats = upright(np.array([measures.landmarks[name].point]), measures.transform)[0]
    return place


def _loops(mesh: Cuttable, measure: Measure) -> list[Floats]:
    """The closed curve in the plane of a girth whose length is nearest to the girth; empty without a curve."""
    assert measure.plane is not None
    point, normal = (np.array(part) for part in measure.plane)
    loops = [np.vstack([loop.points, loop.points[:1]]) for loop in cut(mesh, point, normal)]
    length_mm = measure.surface_length
    if length_mm is None or not loops:
        return []
    loop_lengths = [float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum()) for loop in loops]
    return [loops[int(np.argmin(np.abs(np.array(loop_lengths) - length_mm)))]]


def _landmarks(name: str) -> tuple[str, ...]:
    first = (SPANS[name][0],) if name in SPANS else ()
    return (*first, *ENDS.get(name, ()))


def _span(name: str, measure: Measure, measures: Measures) -> list[Floats]:
    if name not in SPANS or measure.value is None or SPANS[name][0] not in measures.landmarks:
        return []
    mark, direction = SPANS[name]
    start = landmark_place(measures, mark)
    is_mirrored = np.linalg.det(np.array(measures.transform)[:3, :3]) < 0  # `upright` undoes the mirror
    way = direction * [1.0, -1.0 if is_mirrored else 1.0, 1.0] * measure.value
    return [np.array([start, start + way])]

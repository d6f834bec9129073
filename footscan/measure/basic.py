"""The measures of a foot."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame import FootFrame, foot_frame
from footscan.measure.landmarks import metatarsale_fibulare, metatarsale_tibiale
from footscan.measure.sections import Section, below, cut, tape_girth, widest_gap
from schemas.measures import Measure, Measures, Status
from schemas.scan import Side

UNCERTAIN_GAP_MM = 5.0
"""A section with a wider opening gives an uncertain measure."""
INCOMPLETE_GAP_MM = 30.0
"""A section with a wider opening gives none."""
HEEL_HEIGHT_MM = 40.0
ALONG = np.array([1.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])


def measure_foot(vertices: NDArray[np.floating], faces: NDArray[np.integer], side: Side) -> Measures:
    """The measures of a foot standing on the glass, sole at Z = 0.

    It may lie any way along the scanner, heel first or toes first. A left foot is mirrored and measured as a right one.

    Parameters
    ----------
    vertices : (V, 3) mm, scanner frame
    faces : (F, 3)

    Raises
    ------
    Finding
        The surface is no foot, or not in mm.
    """
    foot = foot_frame(vertices, faces, side)
    medial, lateral = metatarsale_tibiale(foot.samples, foot.length), metatarsale_fibulare(foot.samples, foot.length)
    ball = (medial + lateral) / 2
    across_ball = np.cross(medial - lateral, UP)
    across_ball /= np.linalg.norm(across_ball)
    instep = np.array([0.5 * foot.length, 0.0, 0.0])
    waist = np.array([(ball[0] + instep[0]) / 2, 0.0, 0.0])
    measures = {
        "foot_length": _plain(foot.length, f"rearmost heel point to the longest toe, along the {foot.axis} axis"),
        "foot_breadth": _plain(
            medial[1] - lateral[1],
            "between the tangents, parallel to the axis, at the heads of the first and fifth metatarsals",
        ),
        "ball_length": _plain(medial[0], "rearmost heel point to the head of the first metatarsal, along the axis"),
        "heel_breadth": _heel_breadth(foot),
        "instep_height": _instep_height(foot),
        "ball_girth": _girth(foot, ball, across_ball, "tape in the upright plane through both metatarsal heads"),
        "waist_girth": _girth(foot, waist, ALONG, "tape across the axis, midway between ball and instep planes"),
        "instep_girth": _girth(foot, instep, ALONG, "tape across the axis at half the foot length"),
        "scan_height": _plain(float(foot.vertices[:, 2].max()), "floor to the highest point of the surface"),
    }
    return Measures(side=side, axis=foot.axis, transform=foot.transform.tolist(), measures=measures)


def _heel_breadth(foot: FootFrame) -> Measure:
    definition = "broadest place across the axis at 10 to 20 % of the foot length, up to 40 mm high"
    stations = np.linspace(0.10, 0.20, 11) * foot.length
    return _over_stations(foot, stations, HEEL_HEIGHT_MM, definition, _breadth, np.max)


def _instep_height(foot: FootFrame) -> Measure:
    definition = "floor to the highest point at half the foot length"
    stations = 0.5 * foot.length + np.linspace(-2.0, 2.0, 5)
    return _over_stations(
        foot, stations, np.inf, definition, lambda section: float(section.points[:, 2].max()), np.median
    )


def _breadth(section: Section) -> float:
    return float(np.ptp(section.points[:, 1]))


def _over_stations(
    foot: FootFrame,
    stations: NDArray[np.float64],
    height: float,
    definition: str,
    measure: Callable[[Section], float],
    choose: Callable[[NDArray[np.float64]], np.floating],
) -> Measure:
    """`measure` of the sections across the axis at all `stations`, up to `height`; `choose` makes one value of them."""
    sections = [below(cut(foot.vertices, foot.faces, x * ALONG, ALONG), height) for x in stations]
    if any(not len(section.points) for section in sections):
        return _incomplete(definition, "the surface has a gap here")
    gap = max(widest_gap(section) for section in sections)
    return _with_gap(float(choose(np.array([measure(section) for section in sections]))), definition, gap)


def _girth(foot: FootFrame, point: NDArray[np.float64], normal: NDArray[np.float64], definition: str) -> Measure:
    section = cut(foot.vertices, foot.faces, point, normal)
    girth = tape_girth(section, normal)
    if girth is None:
        return _incomplete(definition, "the surface has a gap here")
    return _with_gap(girth, definition, widest_gap(section))


def _with_gap(value: float, definition: str, gap: float) -> Measure:
    if gap > INCOMPLETE_GAP_MM:
        return _incomplete(definition, f"the surface has a gap of {gap:.0f} mm here")
    status: Status = "uncertain" if gap > UNCERTAIN_GAP_MM else "ok"
    note = f"the surface has a gap of {gap:.0f} mm here" if status == "uncertain" else None
    return Measure(value=round(value, 3), unit="mm", status=status, definition=definition, note=note)


def _plain(value: float, definition: str) -> Measure:
    return Measure(value=round(float(value), 3), unit="mm", status="ok", definition=definition)


def _incomplete(definition: str, note: str) -> Measure:
    return Measure(value=None, unit="mm", status="incomplete", definition=definition, note=note)

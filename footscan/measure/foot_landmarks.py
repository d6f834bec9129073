"""The landmarks of a foot: points that its measures run between.

Definitions and names follow the lists of i-Ware INFOOT and of AIST. Where the bone that a landmark is named for lies
under the skin, its place is inferred from the form of the surface, and its confidence is low.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from footscan.measure.frame.foot_frame import FootFrame, forefoot_points
from footscan.measure.landmarks.dorsal import BELOW_CUT_MM, instep_point, junction_point, metatarsal_top
from footscan.measure.landmarks.extreme import Cap, Floats, Point, Summit
from footscan.measure.landmarks.plantar import landing_point
from footscan.measure.landmarks.sides import (
    REACH,
    heel_lateral,
    heel_medial,
    metatarsale_fibulare,
    metatarsale_tibiale,
    outermost_in,
    pternion,
)
from footscan.measure.landmarks.toes import toe_tips
from footscan.mesh.rigid_transform import apply
from schemas.base.errors import Finding
from schemas.landmarks import LANDMARKS

Method = Literal["geometric", "fallback", "manual"]

FIRST_HEAD, SECOND_HEAD = 0.20, 0.40
"""Places of the heads of the first and second metatarsal, as shares of the ball's breadth from its medial side."""
MALLEOLI, MALLEOLI_HEIGHT = (0.12, 0.35), (0.20, 0.38)
NAVICULAR, NAVICULAR_HEIGHT = (0.33, 0.48), (0.10, 0.25)
TUBEROSITY, TUBEROSITY_HEIGHT = (0.35, 0.48), (0.0, 0.115)
"""Windows along the foot and in height, as shares of the length; chosen by hand."""
BULGE_END = 0.01
"""Half the length of the windows that locate the ends of the straight line under a bulge, as a share of the length."""
FULL_NOISE_MM = 0.5
"""Roughness that halves a confidence; chosen by hand."""
NOTABLE_BULGE = 3.0
"""A bulge of the skin exceeds the straight line over its window by more than this multiple of the roughness. Chosen by
hand."""
FAR_MM = 20.0
"""Largest distance from the surface of a landmark set by a person: ten times the error of a hand."""
AT_BORDER = 0.5
"""Factor of the confidence where the surface goes on rising across the border of the window; chosen by hand."""


class Landmark(NamedTuple):
    """A point of the foot."""

    point: Point
    """(3,) mm, in the foot's frame"""
    method: Method
    """"geometric": by its definition; "fallback": by proportion; "manual": set by a person"""
    confidence: float
    """0 to 1"""
    note: str | None = None
    cap: Cap | None = None
    """The fitted part of the surface, if the landmark is a summit or a crease."""
    at_border: bool = False
    """True if the surface goes on rising beside the window in which the landmark was sought: it is elsewhere."""


def check_manual(manual: Mapping[str, Point], vertices: Floats) -> None:
    """Refuse landmarks that lie far from the surface.

    Parameters
    ----------
    manual : (3,) mm each, in the frame of the mesh
    vertices : (N, 3) mm

    Raises
    ------
    ValueError
        A landmark lies farther than `FAR_MM` from all vertices; the message has its name.

    Examples
    --------
    >>> check_manual({"pternion": np.array([0.0, 0, 30])}, np.zeros((1, 3)))
    Traceback (most recent call last):
    ValueError: pternion lies 30 mm from the surface, expected a point of it in mm
    """
    for name, point in manual.items():
        distance = float(np.sqrt(np.min(np.sum((vertices - point) ** 2, axis=1))))
        if not distance <= FAR_MM:
            raise ValueError(f"{name} lies {distance:.0f} mm from the surface, expected a point of it in mm")


def find_landmarks(foot: FootFrame, manual: Mapping[str, Point] | None = None) -> dict[str, Landmark]:
    """Find the landmarks of a foot on its surface, by the names in `LANDMARKS`; those not found are left out.

    Parameters
    ----------
    manual : (3,) mm each, in the frame of the mesh that `foot` was made of; they replace the landmarks found

    Raises
    ------
    KeyError
        `manual` has a name that is not in `LANDMARKS`.
    Finding
        The heads of the first and fifth metatarsal in `manual` are exchanged.
    """
    marked = {
        name: Landmark(apply(foot.transform, np.asarray(point, np.float64)[None])[0], "manual", 1.0)
        for name, point in (manual or {}).items()
    }
    if unknown := set(marked) - set(LANDMARKS):
        raise KeyError(f"{sorted(unknown)[0]!r} is no landmark")
    landmarks = _of_outline(foot) | marked
    ball = [landmarks.get(name) for name in ("metatarsale_tibiale", "metatarsale_fibulare")]
    if ball[0] is not None and ball[1] is not None and ball[0].point[1] <= ball[1].point[1]:
        raise Finding("metatarsale_tibiale does not lie on the medial side of metatarsale_fibulare: exchanged?")
    landmarks |= _of_toes(foot, landmarks) | marked
    landmarks |= _of_back(foot, landmarks) | _of_leg(foot) | _under_skin(foot) | marked
    return {name: landmarks[name] for name in LANDMARKS if name in landmarks}


def _of_outline(foot: FootFrame) -> dict[str, Landmark]:
    landmarks: dict[str, Landmark | None] = {
        "pternion": _outermost(pternion(foot.samples, foot.length, foot.low), 0.95),
        "metatarsale_tibiale": _outermost(metatarsale_tibiale(foot.samples, foot.length), 0.9),
        "metatarsale_fibulare": _outermost(metatarsale_fibulare(foot.samples, foot.length), 0.9),
    }
    for name, find in (("heel_medial", heel_medial), ("heel_lateral", heel_lateral)):
        side = find(foot.samples, foot.length)  # the broadest place of its window may lie at the border
        landmarks[name] = None if side is None else Landmark(side.point, "geometric", _trust(0.9, side), cap=side.cap)
    landing = landing_point(foot.vertices, foot.faces, foot.length)
    if landing is not None:
        landmarks["landing_point"] = Landmark(landing, "geometric", 0.9 if foot.floor != "resting" else 0.5)
    return {name: landmark for name, landmark in landmarks.items() if landmark is not None}


def _of_toes(foot: FootFrame, landmarks: Mapping[str, Landmark]) -> dict[str, Landmark]:
    sides = [landmarks[name].point[1] for name in ("metatarsale_tibiale", "metatarsale_fibulare") if name in landmarks]
    if len(sides) < 2:
        return {}
    points = forefoot_points(foot.vertices, foot.faces, foot.length, foot.low)
    toes = toe_tips(points, foot.samples, foot.length, foot.low, (float(sides[0]), float(sides[1])))
    note = None if toes.is_whole else f"{len(toes.tips)} of five toes told apart, numbered by where they lie"
    confidence = 0.9 if toes.is_whole else 0.5
    return {
        f"toe_{toe}_tip": Landmark(tip.point, "geometric", _trust(confidence, tip), note, tip.cap)
        for toe, tip in toes.tips.items()
    }


def _of_back(foot: FootFrame, landmarks: Mapping[str, Landmark]) -> dict[str, Landmark]:
    back = {}
    junction = junction_point(foot.vertices, foot.faces, foot.length, _top(foot))
    if junction is not None:
        point, cap = junction
        back["junction_point"] = Landmark(point, "geometric", 0.8, cap=cap)
    instep = instep_point(foot.samples, foot.length)
    if instep is not None:
        point, is_bend = instep
        note = None if is_bend else "the back of the foot has no bend here: half way along the foot"
        method: Method = "geometric" if is_bend else "fallback"
        back["instep_point"] = Landmark(point, method, 0.5 if is_bend else 0.3, note)
    if "metatarsale_tibiale" in landmarks and "metatarsale_fibulare" in landmarks:
        tibiale, fibulare = landmarks["metatarsale_tibiale"].point, landmarks["metatarsale_fibulare"].point
        for name, share in (("first", FIRST_HEAD), ("second", SECOND_HEAD)):
            above = metatarsal_top(foot.samples, tibiale, fibulare, share)
            if above is not None:
                back[f"{name}_metatarsal_head_top"] = Landmark(
                    above, "fallback", 0.5, f"{share:.0%} of the ball's breadth from its medial side"
                )
    return back


def _of_leg(foot: FootFrame) -> dict[str, Landmark]:
    landmarks = {}
    highest = min(MALLEOLI_HEIGHT[1], (_top(foot) - BELOW_CUT_MM) / foot.length)
    for name, side in (("medial_malleolus", 1), ("lateral_malleolus", -1)):
        most = _in_window(foot, foot.samples, side, MALLEOLI, (MALLEOLI_HEIGHT[0], highest))
        if most is not None and not most.at_border:  # a leg that broadens upwards shows no malleolus
            landmarks[name] = Landmark(most.point, "geometric", _trust(0.7, most), cap=most.cap)
    return landmarks


def _under_skin(foot: FootFrame) -> dict[str, Landmark]:
    """Find bones that bulge the sides of the midfoot beyond the straight line over their window.

    A bulge that does not exceed the roughness gives no landmark.
    """
    landmarks = {}
    for name, side, along, height, confidence in (
        ("navicular", 1, NAVICULAR, NAVICULAR_HEIGHT, 0.3),
        ("fifth_metatarsal_tuberosity", -1, TUBEROSITY, TUBEROSITY_HEIGHT, 0.4),
    ):
        ends = [_in_window(foot, foot.samples, side, (x - BULGE_END, x + BULGE_END), height) for x in along]
        if ends[0] is None or ends[1] is None:
            continue
        slope = (ends[1].point[1] - ends[0].point[1]) / (ends[1].point[0] - ends[0].point[0])
        tilted = foot.samples - np.outer(foot.samples[:, 0] * slope, [0.0, 1.0, 0.0])
        most = _in_window(foot, tilted, side, along, height)
        if most is not None:
            point = most.point + slope * most.point[0] * np.array([0.0, 1.0, 0.0])
            bulge = float(most.point[1] - (ends[0].point[1] - slope * ends[0].point[0])) * side
            # The outermost point of an even side is arbitrary: a change in the last digit moves it by a centimetre.
            if not most.at_border and bulge > NOTABLE_BULGE * most.residual:
                note = "a bulge of the skin; the bone lies beneath"
                landmarks[name] = Landmark(point, "geometric", _trust(confidence, most), note)
    return landmarks


def _top(foot: FootFrame) -> float:
    """Height up to which the leg is whole, mm."""
    return float(foot.vertices[:, 2].max()) if foot.cut_height is None else foot.cut_height


def _in_window(
    foot: FootFrame, points: Floats, side: int, along: tuple[float, float], height: tuple[float, float]
) -> Summit | None:
    first, last = (share * foot.length for share in along)
    lowest, highest = (share * foot.length for share in height)
    return outermost_in(points, side, (first, last), (lowest, highest), REACH * foot.length)


def _outermost(most: Summit | None, confidence: float) -> Landmark | None:
    if most is None:
        return None
    note = "the surface reaches farther out beside the place where this is sought" if most.at_border else None
    trust = _trust(confidence, most) * (AT_BORDER if most.at_border else 1.0)
    return Landmark(most.point, "geometric", trust, note, most.cap, most.at_border)


def _trust(confidence: float, most: Summit) -> float:
    return round(confidence / (1.0 + (most.residual / FULL_NOISE_MM) ** 2), 3)

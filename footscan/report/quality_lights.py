"""Quality of a scan at a glance: four lights, each with the figure that decides it."""

import math
from typing import Literal, NamedTuple

from footscan.report.markup import number
from schemas.measures import Measures
from schemas.quality import Quality

Level = Literal["good", "fair", "poor", "unknown"]
LEVELS: tuple[Level, ...] = ("good", "fair", "unknown", "poor")
"""From the best to the worst."""

LOST_SHARE = 0.05
"""Largest share of lost frames that is still fair; chosen by hand.

If more frames are lost, neighbouring stripes are missing, and the surface is filled between them."""
AGREE_MM = (0.1, 0.25)
"""Largest distance of a camera from the others that is good, and fair: the noise of a stripe point, and the accuracy
that is expected of a whole scan."""
FILLED_SHARES = (0.1, 0.25)
"""Largest filled share of the surface that is good, and fair; chosen by hand.

In a whole scan, toes hide some 5 % of the surface from all cameras."""
MISSING_SHARE = 0.1
"""Largest share of measures not taken that is still fair; chosen by hand.

Some feet lack a landmark, for instance the bulge of the navicular: another scan does not bring it."""


class TrafficLight(NamedTuple):
    """One judgement."""

    name: str
    level: Level
    why: str


def quality_lights(measures: Measures, quality: Quality) -> list[TrafficLight]:
    """Judge the frames, the agreement of the cameras, the surface and the measures."""
    return [_frames(quality), _cameras(quality), _surface(quality), _measures(measures)]


def apart_mm(quality: Quality) -> dict[int, float]:
    """Distance between the skin as each camera sees it and as the others see it, mm, by camera.

    It is the root mean square over the camera's pairs of median offset and robust scatter, weighted by the number of
    places that both cameras see.
    """
    squares: dict[int, float] = {}
    places: dict[int, int] = {}
    for pair in quality.fusion.pairs:
        square = pair.after.median_mm**2 + pair.after.deviation_mm**2
        for camera in pair.cameras:
            squares[camera] = squares.get(camera, 0.0) + pair.points * square
            places[camera] = places.get(camera, 0) + pair.points
    return {camera: math.sqrt(squares[camera] / places[camera]) for camera in sorted(squares) if places[camera]}


def worst(lights: list[TrafficLight]) -> Level:
    """The worst level of all lights; unknown without lights."""
    return max((light.level for light in lights), key=LEVELS.index, default="unknown")


def _frames(quality: Quality) -> TrafficLight:
    frames, lost = (sum(getattr(camera, name) for camera in quality.cameras) for name in ("frames", "frames_lost"))
    blind = [str(camera.camera) for camera in quality.cameras if not camera.points]
    why = f"{lost} of {frames} frames lost" + (f", no stripe in camera {', '.join(blind)}" if blind else "")
    return TrafficLight("Frames", "poor" if blind or lost > LOST_SHARE * frames else "fair" if lost else "good", why)


def _cameras(quality: Quality) -> TrafficLight:
    apart = apart_mm(quality)
    if not apart:
        return TrafficLight("Cameras", "unknown", "no two cameras see the same skin")
    camera = max(apart, key=lambda camera_id: apart[camera_id])
    why = f"camera {camera} is the farthest from the others, by {number(apart[camera], 2)} mm"
    return TrafficLight("Cameras", _level(apart[camera], AGREE_MM), why)


def _surface(quality: Quality) -> TrafficLight:
    mesh = quality.mesh
    if mesh.open_edges or mesh.non_manifold_edges:
        return TrafficLight("Surface", "poor", f"open, {number(mesh.holes)} holes")
    if mesh.filled_share is None:
        return TrafficLight("Surface", "unknown", "closed; it is not known what was filled")
    return TrafficLight(
        "Surface", _level(mesh.filled_share, FILLED_SHARES), f"{number(100 * mesh.filled_share, 1)} % filled"
    )


def _measures(measures: Measures) -> TrafficLight:
    if measures.finding is not None:
        return TrafficLight("Measures", "poor", f"none: {measures.finding}")
    missing, doubted = (
        sum(measure.status == status for measure in measures.measures.values())
        for status in ("incomplete", "uncertain")
    )
    count = len(measures.measures)
    why = f"{missing} of {count} not taken, {doubted} uncertain"
    is_poor = missing + doubted == count or missing > MISSING_SHARE * count
    return TrafficLight("Measures", "poor" if is_poor else "fair" if missing or doubted else "good", why)


def _level(value: float, limits: tuple[float, float]) -> Level:
    return "good" if value <= limits[0] else "fair" if value <= limits[1] else "poor"

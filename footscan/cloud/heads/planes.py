"""Heads and their places, applied to points and to views."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import Floats
from footscan.cloud.heads.comparisons import HEAD_TERMS, terms_of_head
from footscan.cloud.points import coordinates, copied
from footscan.cloud.views import View
from schemas.calibration import LaserPlane, camera_of_view, laser_of_view
from schemas.heads import HeadsReport
from schemas.rig import USUAL_HEADS

UNKNOWN = -1


def heads_of(views: Mapping[int, View]) -> dict[int, int]:
    """Camera -> number of its head, by the calibration or by the usual numbering; cameras without either are left out.

    Views of second lasers are left out, too: the first lasers show where the heads are.

    >>> heads_of({})
    {}
    """
    known = {
        camera: view.plane.head if view.plane else USUAL_HEADS.get(camera)
        for camera, view in views.items()
        if laser_of_view(camera) == 1
    }
    return {camera: head for camera, head in known.items() if head is not None}


def head_indices(heads: Mapping[int, int]) -> NDArray[np.intp]:
    """(256,) index of each camera's head among the numbers of `heads`, `UNKNOWN` for other cameras.

    >>> head_indices({1: 1, 2: 1, 5: 3})[[1, 2, 3, 5]].tolist()
    [0, 0, -1, 1]
    """
    numbers = sorted(set(heads.values()))
    indices = np.full(256, UNKNOWN, np.intp)
    for camera, head in heads.items():
        indices[camera] = numbers.index(head)
    return indices


def calibrated_places(views: Mapping[int, View], heads: Mapping[int, int], x_mm: float) -> Floats:
    """(H, 4) places of the heads by the calibration, at X = `x_mm`; 0 where no film has shown them.

    >>> calibrated_places({}, {1: 1, 3: 2}, 0.0).tolist()
    [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
    """
    places = np.zeros((len(set(heads.values())), 4))
    indices = head_indices(heads)
    for camera in heads:
        plane = views[camera].plane if camera in views else None
        if plane is not None:
            offset = plane.offset_mm + plane.scale * (x_mm - plane.x_mm)
            places[indices[camera]] = offset, plane.yaw, plane.pitch, plane.scale
    return places


def planes_filmed(views: Mapping[int, View], heads: Mapping[int, int]) -> bool:
    """True if a film has shown where the laser planes of all cameras on `heads` lie.

    >>> planes_filmed({}, {1: 1})
    False
    """
    planes = [views[camera].plane if camera in views else None for camera in heads]
    return all(plane is not None and any(plane.sd) for plane in planes)


def displaced(points: NDArray[np.void], places: Floats, head_of: NDArray[np.intp], x_mm: float) -> NDArray[np.void]:
    """Move points along X to where places (H, 4) of their heads put them; `head_of` as of `head_indices`."""
    moved = copied(points)
    of_point = np.vstack([places, np.zeros(HEAD_TERMS)]).take(head_of[points["camera"]], axis=0)  # the last if UNKNOWN
    moved["x"] = points["x"] + np.einsum("nk,nk->n", terms_of_head(coordinates(points), x_mm), of_point)
    moved["plane"] = points["plane"] + of_point[:, 0] + of_point[:, 3] * (points["plane"].astype(np.float64) - x_mm)
    return moved


def views_at(views: Mapping[int, View], heads: Mapping[int, int], places: Floats, x_mm: float) -> dict[int, View]:
    """The views with the laser planes at places (H, 4), in addition to what the calibration says of them."""
    numbers = sorted(set(heads.values()))
    moved = dict(views)
    for camera, head in heads.items():
        offset, yaw, pitch, scale = places[numbers.index(head)].tolist()
        plane = views[camera].plane or LaserPlane(head=head, x_mm=x_mm, sd=[0.0] * 7)
        moved[camera] = replace(
            views[camera],
            plane=plane.model_copy(
                update={
                    "offset_mm": plane.offset_mm + offset + scale * (plane.x_mm - x_mm),
                    "yaw": plane.yaw + yaw,
                    "pitch": plane.pitch + pitch,
                    "scale": plane.scale + scale,
                }
            ),
        )
    return moved


def places_of(report: HeadsReport) -> Floats:
    """(H, 4) the places of a report, by ascending number of the head."""
    by_number = sorted(report.heads, key=lambda head: head.head)
    return np.array([[head.offset_mm, head.yaw, head.pitch, head.scale] for head in by_number]).reshape(-1, 4)


def corrected(
    points: NDArray[np.void], views: Mapping[int, View], report: HeadsReport
) -> tuple[NDArray[np.void], dict[int, View]]:
    """The points of all cameras (N,), mm, scanner frame, and the views, with the heads where the report says."""
    if not report.is_corrected:
        return points, dict(views)
    by_camera = {camera: head.head for head in report.heads for camera in head.cameras}
    heads = {view: by_camera[camera_of_view(view)] for view in views if camera_of_view(view) in by_camera}
    places = places_of(report)
    return (
        displaced(points, places, head_indices(heads), report.x_mm),
        views_at(views, heads, places, report.x_mm),
    )

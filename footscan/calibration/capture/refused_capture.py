"""Refusal of a capture, with evidence: the reference object was placed differently, or is not recognised."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import from_object
from footscan.calibration.capture.from_capture import CameraView, Recognised, nominal_poses
from footscan.calibration.capture.judged_placement import LEAST_SHARE, in_words, judge_placement
from footscan.calibration.capture.placement import CameraFit
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.maps import to_pixels
from footscan.calibration.models.region import region_of
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration, view_name

Floats = NDArray[np.float64]

FEWEST_POINTS = 40
"""Points of the stripe, of all cameras together, that a placement needs. Chosen by hand."""
OUTLINE_STEP_MM = 1.0
"""Distance of the points of a drawn outline."""


@dataclass(frozen=True)
class Evidence:
    """One frame of one camera that shows why a capture is refused."""

    camera: int
    frame: int
    stripe: Floats
    """(N, 2) px."""
    expected: Floats
    """(M, 2) px: the outline of the object in its nominal pose; empty if the camera has no map."""
    found: Floats
    """(M, 2) px: the outline in its actual pose; empty if that is unknown."""


class RefusedCapture(RefusedInput):
    """A capture from which the cameras cannot be calibrated, with the evidence."""

    def __init__(self, source: str, problem: str, *, field: str, evidence: Sequence[Evidence]) -> None:
        super().__init__(source, problem, field=field)
        self.evidence = evidence


def check_placements(
    views: Mapping[int, CameraView],
    recognised: Mapping[int, Recognised],
    edges: Edges,
    placements: Floats,
    tolerance_mm: float,
    source: str,
) -> None:
    """Refuse the placement, of (K, 2) mm, with the largest departure of the object from it.

    A placement is judged by maps that were fitted without it, of cameras that recognise the object in most placements.
    A single placement is not judged.

    Raises
    ------
    RefusedCapture
        A frame shows no stripe, or the object departs from a placement by more than `tolerance_mm`.
    """
    poses = nominal_poses(placements)
    for number in range(len(poses)):
        if sum(len(view.stripes[number]) for view in views.values()) < FEWEST_POINTS:
            shown = [Evidence(camera, number, view.stripes[number], *_NOTHING) for camera, view in views.items()]
            problem = "shows no stripe in any camera, expected the object"
            raise RefusedCapture(source, problem, field=f"frame {number}", evidence=shown)
    worst: tuple[float, RefusedCapture] | None = None
    for number in range(len(poses)) if len(poses) > 1 else ():
        judged = judge_placement(number, views, recognised, edges, poses)
        if judged is None:
            continue
        maps, change, size = judged.maps, judged.change, judged.change.size_mm
        allowed = tolerance_mm + judged.margin_mm
        nominal, actual = poses[number], poses[number] + change.pose
        if change.share >= LEAST_SHARE:
            problem = (
                f"the object stood at ({actual[0]:.1f}, {actual[1]:.1f}) mm, "
                f"turned by {np.degrees(actual[2]):.1f} degrees, "
                f"expected ({nominal[0]:g}, {nominal[1]:g}) as placements_mm says"
            )
        else:
            size = np.inf
            problem = (
                "the reference object is not recognised in its placement or near it "
                f"by {in_words(maps)}, which recognise it in the other frames"
            )
        if size > allowed and (worst is None or size > worst[0]):
            shown = [
                Evidence(
                    camera,
                    number,
                    views[camera].stripes[number],
                    _outline(map_, views[camera], edges, nominal),
                    _outline(map_, views[camera], edges, actual) if change.share >= LEAST_SHARE else _NOTHING[0],
                )
                for camera, map_ in maps.items()
            ]
            worst = (size, RefusedCapture(source, problem, field=f"frame {number}", evidence=shown))
    if worst is not None:
        raise worst[1]


def refuse_unrecognised(views: Mapping[int, CameraView], reasons: Mapping[int, str], source: str) -> None:
    """Refuse a capture with cameras that do not recognise the object, for `reasons`; the first of them is shown.

    Raises
    ------
    RefusedCapture
        There is such a camera.
    """
    if not reasons:
        return
    camera = min(reasons)
    others = f" (nor by {in_words(sorted(reasons)[1:])})" if len(reasons) > 1 else ""
    shown = [Evidence(camera, number, stripe, *_NOTHING) for number, stripe in enumerate(views[camera].stripes)]
    problem = f"the reference object is not recognised: {reasons[camera]}{others}"
    raise RefusedCapture(source, problem, field=f"camera {view_name(camera)}", evidence=shown)


def refuse_contradictions(recognised: Mapping[int, Recognised], source: str) -> None:
    """Refuse cameras that see the object from a side other than that of their mounting.

    Their films are exchanged, or the placements or the profile are mirrored.

    Raises
    ------
    RefusedCapture
        There is such a camera.
    """
    wrong = {camera: result for camera, result in sorted(recognised.items()) if result.contradiction}
    if not wrong:
        return
    camera, first = next(iter(wrong.items()))
    if len(wrong) == len(recognised) > 1:
        cause = (
            "and all other cameras see it from a wrong side too: check the signs and the order of placements_mm, "
            "profile_mm"
        )
    else:
        others = f", and {in_words([c for c in wrong if c != camera])} likewise" if len(wrong) > 1 else ""
        cause = f"by its number or `stands`{others}: is this its film?"
    shown = [Evidence(number, 0, result.view.stripes[0], *_NOTHING) for number, result in wrong.items()]
    raise RefusedCapture(source, f"{first.contradiction}, {cause}", field=f"camera {view_name(camera)}", evidence=shown)


_NOTHING = (np.empty((0, 2)), np.empty((0, 2)))
"""No outlines."""


def _outline(map_: CameraFit, view: CameraView, edges: Edges, pose: Floats) -> Floats:
    """The edges of an object in `pose` (3,) as a camera would see them: (M, 2) px within its image."""
    steps = [np.arange(0.0, length, OUTLINE_STEP_MM) / length for length in edges.length]
    own = np.concatenate(
        [a + t[:, np.newaxis] * (b - a) for a, b, t in zip(edges.start, edges.end, steps, strict=True)]
    )
    pixels = map_.points.pixels
    camera = CameraCalibration(
        camera=view.camera,
        image_px=view.image_px,
        map=map_.fit.model.as_map(map_.fit.parameters),
        region_px=region_of(pixels),
        points=len(pixels),
    )
    seen = to_pixels(camera, from_object(own, pose))
    inside = ((seen >= 0) & (seen <= np.array(view.image_px) - 1)).all(axis=1)
    return np.asarray(seen[inside])

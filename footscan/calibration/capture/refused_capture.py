"""What is wrong with a capture as a whole, and what shows it: an object that stood elsewhere, or is not recognised."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import from_object
from footscan.calibration.capture.from_capture import SEEN, CameraView, Recognised, as_said, fit_view
from footscan.calibration.capture.placement import CameraFit, departure
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.fit import UndeterminedError
from footscan.calibration.models.maps import to_pixels
from footscan.calibration.models.region import region_of
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

FEWEST_POINTS = 40
"""With fewer points of the stripe, all cameras together, a placement shows nothing."""
FOUND = 0.5
"""An object is where a departure says when so much of the stripe lies on its edges."""
SURE_MM = 0.25
"""A camera whose map, fitted without a placement, is less sure than this of what it shows there has no say in it."""
SIGMAS = 3.0
"""How far beyond the tolerance a departure may be by what the maps do not know."""
LEVER_MM = 50.0
"""A turn moves the object's corners by this times its angle."""
OUTLINE_STEP_MM = 1.0


@dataclass(frozen=True)
class Evidence:
    """What one camera shows of a refused capture in one frame."""

    camera: int
    frame: int
    stripe: Floats
    """(N, 2) px."""
    expected: Floats
    """(M, 2) px: the outline of the object where it should stand; empty where the camera does not know."""
    found: Floats
    """(M, 2) px: the outline where it stood; empty where it was not found."""


class RefusedCapture(RefusedInput):
    """A capture that does not show what it should."""

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
    """Refuses the placement, of (K, 2) mm, in which the object stood farthest from where it was said.

    It is judged by maps that do not rest on it, of cameras that recognise the object in most placements; with a single
    placement there are none.

    Raises
    ------
    RefusedCapture
        A frame shows no stripe, or the object stood elsewhere than said by more than `tolerance_mm`.
    """
    poses = as_said(placements)
    for number in range(len(poses)):
        if sum(len(view.stripes[number]) for view in views.values()) < FEWEST_POINTS:
            shown = [Evidence(camera, number, view.stripes[number], *_NOTHING) for camera, view in views.items()]
            problem = "shows no stripe in any camera, expected the object"
            raise RefusedCapture(source, problem, field=f"frame {number}", evidence=shown)
    worst: tuple[float, RefusedCapture] | None = None
    for number in range(len(poses)) if len(poses) > 1 else ():
        maps = _maps_without(number, recognised, edges, poses)
        sigmas = {camera: known.fit.region_sigma(views[camera].stripes[number]) for camera, known in maps.items()}
        unsure = {camera: sigma for camera, sigma in sigmas.items() if sigma is not None and sigma <= SURE_MM}
        maps = {camera: maps[camera] for camera in unsure}
        if not maps:
            continue
        found = departure(
            [known.world(views[camera].stripes[number]) for camera, known in maps.items()], edges, poses[number]
        )
        allowed = tolerance_mm + SIGMAS * min(unsure.values())
        size = max(float(np.hypot(*found.pose[:2])), float(abs(found.pose[2])) * LEVER_MM)
        said, stood = poses[number], poses[number] + found.pose
        if found.share >= FOUND:
            problem = (
                f"the object stood at ({stood[0]:.1f}, {stood[1]:.1f}) mm, "
                f"turned by {np.degrees(stood[2]):.1f} degrees, "
                f"expected ({said[0]:g}, {said[1]:g}) as placements_mm says"
            )
        else:
            size = np.inf
            problem = (
                "the reference object is not recognised where it should stand, nor near to it, "
                f"by {_cameras(maps)}, which recognise it in the other frames"
            )
        if size > allowed and (worst is None or size > worst[0]):
            shown = [
                Evidence(
                    camera,
                    number,
                    views[camera].stripes[number],
                    _outline(known, views[camera], edges, said),
                    _outline(known, views[camera], edges, stood) if found.share >= FOUND else _NOTHING[0],
                )
                for camera, known in maps.items()
            ]
            worst = (size, RefusedCapture(source, problem, field=f"frame {number}", evidence=shown))
    if worst is not None:
        raise worst[1]


def refuse_unrecognised(views: Mapping[int, CameraView], reasons: Mapping[int, str], source: str) -> None:
    """Refuses a capture with cameras that do not recognise the object, for `reasons`; the first of them is shown.

    Raises
    ------
    RefusedCapture
        There is such a camera.
    """
    if not reasons:
        return
    camera = min(reasons)
    others = f" (nor by {_cameras(sorted(reasons)[1:])})" if len(reasons) > 1 else ""
    shown = [Evidence(camera, number, stripe, *_NOTHING) for number, stripe in enumerate(views[camera].stripes)]
    problem = f"the reference object is not recognised: {reasons[camera]}{others}"
    raise RefusedCapture(source, problem, field=f"camera {camera}", evidence=shown)


def refuse_contradictions(recognised: Mapping[int, Recognised], source: str) -> None:
    """Refuses cameras that see the object from another side than they stand on: their films are exchanged, or the
    placements or the profile are mirrored.

    Raises
    ------
    RefusedCapture
        There is such a camera.
    """
    wrong = {camera: known for camera, known in sorted(recognised.items()) if known.contradiction}
    if not wrong:
        return
    camera, first = next(iter(wrong.items()))
    if len(wrong) == len(recognised) > 1:
        cause = (
            "and every other one another side than its own: check the signs and the order of placements_mm, profile_mm"
        )
    else:
        others = f", and {_cameras([c for c in wrong if c != camera])} likewise" if len(wrong) > 1 else ""
        cause = f"by its number or `stands`{others}: is this its film?"
    shown = [Evidence(number, 0, known.view.stripes[0], *_NOTHING) for number, known in wrong.items()]
    raise RefusedCapture(source, f"{first.contradiction}, {cause}", field=f"camera {camera}", evidence=shown)


def _cameras(numbers: Iterable[int]) -> str:
    """Their numbers in words."""
    listed = ", ".join(map(str, sorted(numbers)))
    return f"cameras {listed}" if "," in listed else f"camera {listed}"


_NOTHING = (np.empty((0, 2)), np.empty((0, 2)))


def _maps_without(
    number: int, recognised: Mapping[int, Recognised], edges: Edges, poses: Floats
) -> dict[int, CameraFit]:
    """The maps of all cameras that are to be trusted, fitted without one of the placements."""
    mostly = {c: known for c, known in recognised.items() if np.nanmean(known.first.explained >= SEEN) > 0.5}
    maps = {}
    for camera, known in (mostly or recognised).items():
        try:
            maps[camera] = fit_view(known.view, known.first, edges, poses, without=number)
        except UndeterminedError:
            continue
    return maps


def _outline(known: CameraFit, view: CameraView, edges: Edges, pose: Floats) -> Floats:
    """Where a camera would see the edges of an object that stands in `pose` (3,): (M, 2) px within its image."""
    steps = [np.arange(0.0, length, OUTLINE_STEP_MM) / length for length in edges.length]
    own = np.concatenate(
        [a + t[:, np.newaxis] * (b - a) for a, b, t in zip(edges.start, edges.end, steps, strict=True)]
    )
    pixels = known.points.pixels
    camera = CameraCalibration(
        camera=view.camera,
        image_px=view.image_px,
        map=known.fit.model.as_map(known.fit.parameters),
        region_px=region_of(pixels),
        points=len(pixels),
    )
    seen = to_pixels(camera, from_object(own, pose))
    inside = ((seen >= 0) & (seen <= np.array(view.image_px) - 1)).all(axis=1)
    return np.asarray(seen[inside])

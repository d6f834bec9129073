"""What is known of a capture between its films and its calibration, as named arrays and back, to the last bit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import EdgePoints
from footscan.calibration.capture.from_capture import CameraView, Recognised
from footscan.calibration.capture.placement import CameraFit
from footscan.calibration.capture.recognition import FirstMap
from footscan.calibration.models.fit import Fit
from footscan.calibration.models.homography import HomographyModel, image_frame
from schemas.mounting import Mounting, Sign

Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """What the cameras of a capture see of the reference object, each by its number."""

    views: dict[int, CameraView]
    recognised: dict[int, Recognised]
    unrecognised: dict[int, str]
    """Why a camera does not recognise the object."""


def view_of(camera: int, stripe: Arrays, mounting: Mounting) -> CameraView:
    """What a camera saw, from its `stripe_arrays` and where it stands."""
    columns, rows = stripe["image_px"].tolist()
    ends = np.cumsum(stripe["counts"])[:-1]
    stripes = np.split(stripe["pixels"], ends)
    return CameraView(camera, (columns, rows), stripes, mounting, tuple(stripe["lost"].tolist()))


def recognised_arrays(found: Recognised | str, mounting: Mounting) -> dict[str, NDArray[np.generic]]:
    """The object as a camera recognises it, or why it does not."""
    stands: dict[str, NDArray[np.generic]] = {"mounting": _signs(mounting)}
    if isinstance(found, str):
        return stands | {"reason": np.frombuffer(found.encode(), np.uint8)}
    fit = found.rough.fit
    covariance = {} if fit.covariance is None else {"covariance": fit.covariance}
    return {
        **stands,
        "matrix": found.first.matrix,
        "explained": found.first.explained,
        "score": np.array([found.first.score]),
        "seen_from": _signs(found.first.seen_from),
        "parameters": fit.parameters,
        "condition": np.array([fit.condition]),
        "residuals": fit.residuals,
        **covariance,
        **points_arrays(found.rough.points),
    }


def seen_by(camera: int, stripe: Arrays, found: Arrays) -> tuple[CameraView, Recognised | str]:
    """What a camera saw and whether it recognises the object, from `stripe_arrays` and `recognised_arrays`."""
    view = view_of(camera, stripe, mounting_of_signs(found["mounting"].tolist()))
    if "reason" in found:
        return view, found["reason"].tobytes().decode()
    seen_from = mounting_of_signs(found["seen_from"].tolist())
    first = FirstMap(found["matrix"], found["explained"], found["score"].item(), seen_from)
    lens = HomographyModel(*image_frame(view.image_px), distorted=True)
    fit = Fit(lens, found["parameters"], found.get("covariance"), found["condition"].item(), found["residuals"])
    return view, Recognised(view, first, CameraFit(points_of(found), fit))


def seen_of(arrays: Mapping[str, Arrays]) -> Seen:
    """What all cameras see: `arrays` holds a `stripe-N` and a `recognised-N` for each camera N."""
    numbers = [int(name.removeprefix("stripe-")) for name in arrays if name.startswith("stripe-")]
    seen = {camera: seen_by(camera, arrays[f"stripe-{camera}"], arrays[f"recognised-{camera}"]) for camera in numbers}
    return Seen(
        {camera: view for camera, (view, _) in seen.items()},
        {camera: found for camera, (_, found) in seen.items() if isinstance(found, Recognised)},
        {camera: found for camera, (_, found) in seen.items() if isinstance(found, str)},
    )


def points_arrays(points: EdgePoints) -> dict[str, NDArray[np.generic]]:
    """Points of the stripe on known edges."""
    return {f"edge_{field.name}": getattr(points, field.name) for field in fields(EdgePoints)}


def points_of(arrays: Arrays) -> EdgePoints:
    """The opposite of `points_arrays`."""
    return EdgePoints(*(arrays[f"edge_{field.name}"] for field in fields(EdgePoints)))


def mounting_of_signs(signs: Sequence[int]) -> Mounting:
    """A mounting from its three signs."""
    x, y, z = (cast(Sign, sign) for sign in signs)
    return Mounting(x, y, z)


def _signs(mounting: Mounting) -> NDArray[np.int64]:
    return np.array([mounting.x, mounting.y, mounting.z], np.int64)

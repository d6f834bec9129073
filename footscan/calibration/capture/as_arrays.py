"""Conversion of the intermediate results of a capture to named arrays and back, without loss."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import EdgePoints
from footscan.calibration.capture.from_capture import CameraView, Recognised
from footscan.calibration.capture.placement import CameraFit
from footscan.calibration.capture.recognition import FirstMap
from footscan.calibration.models.fit import ModelFit
from footscan.calibration.models.homography import HomographyModel, image_frame
from schemas.mounting import Mounting, Sign

Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """The views of the reference object in a capture, by number of the camera."""

    views: dict[int, CameraView]
    recognised: dict[int, Recognised]
    unrecognised: dict[int, str]
    """The reason why a camera does not recognise the object."""


def view_of(camera: int, stripe: Arrays, mounting: Mounting) -> CameraView:
    """Restore the view of a camera from its `stripe_arrays` and its mounting."""
    columns, rows = stripe["image_px"].tolist()
    ends = np.cumsum(stripe["counts"])[:-1]
    stripes = np.split(stripe["pixels"], ends)
    return CameraView(camera, (columns, rows), stripes, mounting, tuple(stripe["lost"].tolist()))


def recognised_arrays(recognised: Recognised | str, mounting: Mounting) -> dict[str, NDArray[np.generic]]:
    """Convert a recognised view to arrays, or the reason why the object is not recognised."""
    signs: dict[str, NDArray[np.generic]] = {"mounting": _signs(mounting)}
    if isinstance(recognised, str):
        return signs | {"reason": np.frombuffer(recognised.encode(), np.uint8)}
    fit = recognised.rough.fit
    covariance = {} if fit.covariance is None else {"covariance": fit.covariance}
    return {
        **signs,
        "matrix": recognised.first.matrix,
        "explained": recognised.first.explained,
        "score": np.array([recognised.first.score]),
        "seen_from": _signs(recognised.first.seen_from),
        "parameters": fit.parameters,
        "condition": np.array([fit.condition]),
        "residuals": fit.residuals,
        **covariance,
        **points_arrays(recognised.rough.points),
    }


def seen_by(camera: int, stripe: Arrays, recognised: Arrays) -> tuple[CameraView, Recognised | str]:
    """Restore the view of a camera, and the recognised object, from `stripe_arrays` and `recognised_arrays`."""
    view = view_of(camera, stripe, mounting_of_signs(recognised["mounting"].tolist()))
    if "reason" in recognised:
        return view, recognised["reason"].tobytes().decode()
    seen_from = mounting_of_signs(recognised["seen_from"].tolist())
    first = FirstMap(recognised["matrix"], recognised["explained"], recognised["score"].item(), seen_from)
    lens = HomographyModel(*image_frame(view.image_px), distorted=True)
    covariance, condition = recognised.get("covariance"), recognised["condition"].item()
    fit = ModelFit(lens, recognised["parameters"], covariance, condition, recognised["residuals"])
    return view, Recognised(view, first, CameraFit(points_of(recognised), fit))


def camera_views_of(arrays: Mapping[str, Arrays]) -> Seen:
    """Restore the views of all cameras; `arrays` holds a `stripe-N` and a `recognised-N` for each camera N."""
    numbers = [int(name.removeprefix("stripe-")) for name in arrays if name.startswith("stripe-")]
    seen = {camera: seen_by(camera, arrays[f"stripe-{camera}"], arrays[f"recognised-{camera}"]) for camera in numbers}
    return Seen(
        {camera: view for camera, (view, _) in seen.items()},
        {camera: result for camera, (_, result) in seen.items() if isinstance(result, Recognised)},
        {camera: reason for camera, (_, reason) in seen.items() if isinstance(reason, str)},
    )


def points_arrays(points: EdgePoints) -> dict[str, NDArray[np.generic]]:
    """Convert points of the stripe on known edges to arrays."""
    return {f"edge_{field.name}": getattr(points, field.name) for field in fields(EdgePoints)}


def points_of(arrays: Arrays) -> EdgePoints:
    """Restore the points of `points_arrays`."""
    return EdgePoints(*(arrays[f"edge_{field.name}"] for field in fields(EdgePoints)))


def mounting_of_signs(signs: Sequence[int]) -> Mounting:
    """Restore a mounting from its three signs."""
    x, y, z = (cast(Sign, sign) for sign in signs)
    return Mounting(x, y, z)


def _signs(mounting: Mounting) -> NDArray[np.int64]:
    """The three signs of a mounting."""
    return np.array([mounting.x, mounting.y, mounting.z], np.int64)

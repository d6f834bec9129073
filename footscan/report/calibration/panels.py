"""Panels of a calibration on a page: uncertainty and residuals of each camera. Drawn as SVG, in milliseconds."""

import numpy as np
from numpy.typing import NDArray

from footscan.report.calibration.facts import (
    LONG_PX,
    SHARE,
    arrow_unit_mm,
    arrows_of,
    deviation_of,
    figures_of,
    residuals_of,
    round_up,
)
from footscan.report.markup import data_uri, key, text
from footscan.report.render import png_bytes
from schemas.calibration import Calibration, CameraCalibration

Floats = NDArray[np.float64]

MOST_CAMERAS = 64
"""Further cameras are not drawn, to bound the size of the page."""
GRID_PX = 10
"""Spacing of the pixels at which the uncertainty of the map is drawn."""
STOPS = np.array([[255, 255, 217], [65, 182, 196], [8, 29, 88]], np.float64)
"""Ends and middle of YlGnBu (Brewer, ColorBrewer 2.0); light colours mean a low uncertainty."""


def calibration_panels(calibration: Calibration) -> str:
    """Draw a panel for each camera, as SVG; content as in `footscan.report.calibration.figure.calibration_figure`."""
    cameras = calibration.cameras[:MOST_CAMERAS]
    deviations = [deviation_of(camera, GRID_PX) for camera in cameras]
    finite = [sigma[np.isfinite(sigma)] for sigma in deviations if sigma is not None]
    all_sigmas = np.concatenate([np.empty(0), *finite])
    most = round_up(float(np.quantile(all_sigmas, SHARE))) if all_sigmas.size else 1.0
    unit_mm = arrow_unit_mm(cameras)
    figures = [_figure(camera, sigma, most, unit_mm) for camera, sigma in zip(cameras, deviations, strict=True)]
    scale = [(f"{share * most:g} mm", _rgb(share)) for share in (0.0, 0.5, 1.0)] if all_sigmas.size else []
    return (
        f'<p class="note">Arrows: what the fit left, {LONG_PX:.0f} px long for {unit_mm:g} mm. Coloured: the region '
        "that data support, by the standard deviation of the map there.</p>"
        f'{key(scale)}<div class="frames">{"".join(figures)}</div>'
    )


def _figure(camera: CameraCalibration, sigma: Floats | None, most: float, unit_mm: float) -> str:
    rows, columns = camera.image_size
    corners = " ".join(f"{i:.1f},{j:.1f}" for i, j in camera.region_px)
    picture = "" if sigma is None else _picture(sigma, most)
    # The picture begins half a step before the first place of its grid.
    size = f'x="{-GRID_PX / 2}" y="{-GRID_PX / 2}"' + (
        "" if sigma is None else f' width="{sigma.shape[1] * GRID_PX}" height="{sigma.shape[0] * GRID_PX}"'
    )
    residuals = residuals_of(camera)
    tips = residuals[:, :2] + arrows_of(camera, residuals) / unit_mm * LONG_PX
    arrows = "".join(
        f"M{i:.1f} {j:.1f}h0M{i:.1f} {j:.1f}L{to_i:.1f} {to_j:.1f}"
        for (i, j), (to_i, to_j) in zip(residuals[:, :2].tolist(), tips.tolist(), strict=True)
    )
    name = f"Camera {camera.camera}"
    return (
        f"<figure><figcaption><b>{name}</b> {text(figures_of(camera))}</figcaption>"
        f'<svg class="map" viewBox="-0.5 -0.5 {columns} {rows}" role="img" aria-label="{name}: residuals and support">'
        + (f'<image {size} preserveAspectRatio="none" href="{picture}"/>' if picture else "")
        + f'<polygon class="{"support" if sigma is None else "outline"}" points="{corners}"/>'
        f'<path class="residual" d="{arrows}"/></svg></figure>'
    )


def _picture(sigma: Floats, most: float) -> str:
    """Colours of (rows, columns) standard deviations as the data URI of a PNG; NaN is transparent."""
    finite = np.isfinite(sigma)
    share = np.where(finite, sigma, 0.0) / most
    channels = [np.interp(share, (0.0, 0.5, 1.0), STOPS[:, channel]) for channel in range(3)]
    pixels = np.dstack([np.rint(channel).astype(np.uint8) for channel in channels] + [np.uint8(255) * finite])
    return data_uri("image/png", png_bytes(pixels))


def _rgb(share: float) -> tuple[int, int, int]:
    red, green, blue = (round(float(np.interp(share, (0.0, 0.5, 1.0), STOPS[:, k]))) for k in range(3))
    return red, green, blue

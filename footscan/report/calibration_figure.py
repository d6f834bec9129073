"""What a calibration knows, camera by camera: where it is supported, how sure it is there, and what the fit left."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.maps import IMAGE_PX, is_supported, model_of, prediction_covariance
from footscan.report.panels import panels, png_of
from schemas.calibration import Calibration, CameraCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize

Floats = NDArray[np.float64]

MOST_CAMERAS = 64
"""More are not drawn."""
GRID_PX = 4
"""Spacing of the places at which the map's uncertainty is drawn."""
LONG_PX = 30.0
"""An arrow as long as this in the image stands for the length that 95 % of all residuals do not reach, rounded up."""
INK, RESIDUAL, SUPPORT = "#222222", "#b3202c", "#b9d4e8"


def calibration_figure(calibration: Calibration) -> bytes:
    """A PNG: for each camera its image with the region that data support, coloured by the standard deviation of the
    map there, and the residuals as arrows; one scale of colours and one of arrows for all."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    cameras = calibration.cameras[:MOST_CAMERAS]
    sigmas = {camera.camera: _sigma(camera) for camera in cameras}
    known = [sigma[np.isfinite(sigma)] for sigma in sigmas.values() if sigma is not None]
    all_sigmas = np.concatenate([np.empty(0), *known])
    colours = Normalize(0.0, round_up(float(np.quantile(all_sigmas, 0.95))) if all_sigmas.size else 1.0)
    unit_mm = _arrow_unit(cameras)

    figure, places = panels(len(cameras), 0.5)
    for panel, camera in zip(places, cameras, strict=False):
        _draw_camera(panel, camera, sigmas[camera.camera], colours, unit_mm)
    figure.suptitle(
        f"Arrows: what the fit left, {LONG_PX:.0f} px long for {unit_mm:g} mm. Coloured: the region that data support.",
        fontsize=10,
        color=INK,
    )
    if all_sigmas.size:
        bar = figure.colorbar(ScalarMappable(colours, "YlGnBu"), ax=places, shrink=0.8, extend="max")
        bar.set_label("standard deviation of the map, mm")
    return png_of(figure)


def round_up(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below `value`; 0.001 at least."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value * (1 - 1e-9)))


def _arrow_unit(cameras: Sequence[CameraCalibration]) -> float:
    lengths = [np.hypot(*_residuals(camera)[:, 2:].T) for camera in cameras]
    every = np.concatenate([np.empty(0), *lengths])
    return round_up(float(np.quantile(every, 0.95))) if every.size else 1.0


def _draw_camera(
    panel: "Axes", camera: CameraCalibration, sigma: Floats | None, colours: "Normalize", unit_mm: float
) -> None:
    columns, rows = camera.image_px or IMAGE_PX
    panel.set_xlim(-0.5, columns - 0.5)
    panel.set_ylim(rows - 0.5, -0.5)
    panel.set_aspect("equal")
    panel.set_xticks([0, columns // 2, columns - 1])
    panel.set_yticks([0, rows // 2, rows - 1])
    panel.tick_params(labelsize=6, length=2, color=INK)
    if sigma is not None:
        panel.imshow(sigma, cmap="YlGnBu", norm=colours, extent=(-0.5, columns - 0.5, rows - 0.5, -0.5))
    elif camera.region_px:
        panel.fill(*np.transpose(camera.region_px), facecolor=SUPPORT, edgecolor="none")
    if camera.region_px:
        panel.plot(*np.transpose([*camera.region_px, camera.region_px[0]]), color=INK, linewidth=0.6)
    residuals = _residuals(camera)
    arrows = _arrows(camera, residuals) / unit_mm * LONG_PX
    panel.plot(residuals[:, 0], residuals[:, 1], ".", color=RESIDUAL, markersize=1.0)
    panel.quiver(
        residuals[:, 0], residuals[:, 1], arrows[:, 0], arrows[:, 1],
        angles="xy", scale_units="xy", scale=1, width=0.0018, headwidth=4, color=RESIDUAL,
    )  # fmt: skip
    panel.set_title(f"Camera {camera.camera}: {model_of(camera.map)[0].name}\n{_figures(camera)}", fontsize=8)


def _figures(camera: CameraCalibration) -> str:
    known = [("rms", camera.rms_mm), ("held out", camera.held_out_rms_mm), ("worst", camera.worst_mm)]
    figures = ", ".join(f"{name} {mm:.3f}" for name, mm in known if mm is not None)
    return f"{figures} mm" if figures else f"{camera.points} points"


def _sigma(camera: CameraCalibration) -> Floats | None:
    """Standard deviation, mm, of (Y, Z) over the image, (rows, columns), NaN where data do not support the map."""
    columns, rows = camera.image_px or IMAGE_PX
    i, j = np.meshgrid(np.arange(0, columns, GRID_PX), np.arange(0, rows, GRID_PX))
    pixels = np.column_stack([i.ravel(), j.ravel()]).astype(np.float64)
    inside = is_supported(camera, pixels) & bool(camera.region_px)
    covariance = prediction_covariance(camera, pixels[inside])
    if covariance is None:
        return None
    sigma = np.full(len(pixels), np.nan)
    sigma[inside] = np.sqrt(np.maximum(np.trace(covariance, axis1=1, axis2=2), 0.0))
    return sigma.reshape(i.shape)


def _residuals(camera: CameraCalibration) -> Floats:
    return np.array(camera.residuals, np.float64).reshape(-1, 4)


def _arrows(camera: CameraCalibration, residuals: Floats) -> Floats:
    """Residuals (N, 2) as they point in the image, as long as they are in mm."""
    model, parameters = model_of(camera.map)
    errors = residuals[:, 2:]
    slopes = model.by_pixels(parameters, residuals[:, :2])
    seen = (np.linalg.pinv(slopes) @ errors[:, :, np.newaxis])[:, :, 0]
    length = np.hypot(*seen.T)
    return np.asarray(seen * (np.hypot(*errors.T) / np.where(length > 0, length, 1.0))[:, np.newaxis])

"""A figure of a calibration: supported region, uncertainty and residuals of each camera."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import model_of
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
from footscan.report.panels import INK, panels, png_of
from schemas.calibration import Calibration, CameraCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize

Floats = NDArray[np.float64]

MOST_CAMERAS = 64
"""Further cameras are not drawn, to bound the size of the picture."""
RESIDUAL, SUPPORT = "#b3202c", "#b9d4e8"


def calibration_figure(calibration: Calibration) -> bytes:
    """Draw the image of each camera, as PNG: the region that data support, and the residuals as arrows.

    The region is coloured by the standard deviation of the map. All cameras share one scale of colours and of arrows.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    cameras = calibration.cameras[:MOST_CAMERAS]
    sigmas = {camera.camera: deviation_of(camera) for camera in cameras}
    finite = [sigma[np.isfinite(sigma)] for sigma in sigmas.values() if sigma is not None]
    all_sigmas = np.concatenate([np.empty(0), *finite])
    colours = Normalize(0.0, round_up(float(np.quantile(all_sigmas, SHARE))) if all_sigmas.size else 1.0)
    unit_mm = arrow_unit_mm(cameras)

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


def _draw_camera(
    panel: "Axes", camera: CameraCalibration, sigma: Floats | None, colours: "Normalize", unit_mm: float
) -> None:
    rows, columns = camera.image_size
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
    residuals = residuals_of(camera)
    arrows = arrows_of(camera, residuals) / unit_mm * LONG_PX
    panel.plot(residuals[:, 0], residuals[:, 1], ".", color=RESIDUAL, markersize=1.0)
    panel.quiver(
        residuals[:, 0], residuals[:, 1], arrows[:, 0], arrows[:, 1],
        angles="xy", scale_units="xy", scale=1, width=0.0018, headwidth=4, color=RESIDUAL,
    )  # fmt: skip
    panel.set_title(f"Camera {camera.camera}: {model_of(camera.map)[0].name}\n{figures_of(camera)}", fontsize=8)

"""Colourings of a foot: measured and filled parts, cameras, uncertainty, distance to a reference."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import coordinates
from footscan.mesh.nearest import tree_of
from footscan.report.colours import colour_bar, colour_limit, distance_colours
from footscan.report.filled import CUT, filled_colours, filled_key
from footscan.report.markup import key, number
from footscan.report.viewer import Colouring
from footscan.side_by_side import cores
from schemas.quality import MeshQuality

Floats = NDArray[np.float64]

CAMERAS = (
    (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66),
    (0, 114, 178), (213, 94, 0), (204, 121, 167), (120, 120, 120),
    (136, 34, 85), (51, 34, 136), (153, 153, 51), (170, 68, 153),
)  # fmt: skip
"""RGB of cameras 1 to 12. Those of the first eight are distinct for colour-blind readers (Okabe and Ito, "Color
universal design", 2008), the others follow P. Tol's muted scheme ("Colour schemes", 2021).

Camera 13 has the colour of camera 1 again."""
SURE, UNSURE = np.array([253, 231, 37], np.float64), np.array([68, 1, 84], np.float64)
"""RGB of a certain and of an uncertain point."""
_MIDDLE = np.array([33, 145, 140], np.float64)
"""Middle of the ramp from `SURE` to `UNSURE`; the three are colours of viridis (Smith and van der Walt, 2015)."""
_SHARE = 0.98
"""Quantile of the uncertainty at which its colour scale ends; chosen by hand."""
_LEAST_SIGMA_MM = 1e-3
"""Shortest colour scale of the uncertainty, so that it never divides by zero."""


class FootSurface(NamedTuple):
    """The surface of a foot, and what is known of each vertex."""

    vertices: Floats
    """(V, 3) mm, scanner frame, V > 0."""
    faces: NDArray[np.integer]
    """(F, 3), counter-clockwise as seen from outside."""
    filled: NDArray[np.bool_] | None
    """(V,) True where the surface was not measured; None if unknown."""
    deviations: Floats
    """(V,) standard deviations along the normals, mm."""
    cut_mm: float | None
    """Z of the flat cut above the ankle; None without a cut."""
    truth_distance: NDArray[np.floating] | None
    """(V,) mm, signed, positive outside the reference model; None without a reference model."""


def foot_colourings(surface: FootSurface, mesh: MeshQuality, cloud: NDArray[np.void]) -> list[Colouring]:
    """Colour the vertices of a foot in every way that its data allow; the first is shown first.

    `cloud` : (N,) of `footscan.cloud.points.POINT_DTYPE`, mm, scanner frame, from which the surface was made
    """
    filled = surface.filled
    plain = filled_colours(surface.vertices, filled, surface.cut_mm)
    colourings = [Colouring("Measured and filled", plain, filled_key(mesh))]
    if surface.truth_distance is not None:
        limit = colour_limit(surface.truth_distance)
        colours = distance_colours(surface.truth_distance, limit)
        colourings.insert(0, Colouring("Distance to reference", colours, colour_bar(limit)))
    if len(cloud):
        nearest = cloud.take(tree_of(coordinates(cloud)).query(surface.vertices, workers=cores())[1])
        colourings.append(_by_camera(nearest, filled))
    return [*colourings, _by_uncertainty(surface.deviations)]


def _by_camera(nearest: NDArray[np.void], filled: NDArray[np.bool_] | None) -> Colouring:
    """Colour each vertex by the camera of the nearest measured point."""
    palette = np.array(CAMERAS, np.uint8)
    colours = palette[(nearest["camera"].astype(int) - 1) % len(CAMERAS)]
    camera_ids = np.unique(nearest["camera"] if filled is None else nearest["camera"][~filled]).tolist()
    meanings = [(f"Camera {camera}", CAMERAS[(camera - 1) % len(CAMERAS)]) for camera in camera_ids]
    return Colouring("Camera", _with_filled(colours, filled), key([*meanings, *_filled_meaning(filled)]))


def _by_uncertainty(deviations: Floats) -> Colouring:
    """Colour each vertex by its standard deviation."""
    limit = max(float(np.quantile(deviations, _SHARE)), _LEAST_SIGMA_MM)
    legend = key([(f"{number(share * limit, 2)} mm", _rgb(share)) for share in (0.0, 0.5, 1.0)])
    note = (
        '<p class="note">Standard deviation of the surface along its normal, from all causes: noise and calibration, '
        "filled surface, ends beyond the stripes, disagreement of cameras, movement of the foot.</p>"
    )
    return Colouring("Uncertainty", _ramp(deviations / limit), legend + note)


def _ramp(share: Floats) -> NDArray[np.uint8]:
    """RGB, (N, 3), of (N,) values from 0 (sure) to 1 (unsure)."""
    stops = np.array([SURE, _MIDDLE, UNSURE])
    channels = [np.interp(share, (0.0, 0.5, 1.0), stops[:, channel]) for channel in range(3)]
    colours: NDArray[np.uint8] = np.rint(np.column_stack(channels)).astype(np.uint8)
    return colours


def _rgb(share: float) -> tuple[int, int, int]:
    red, green, blue = _ramp(np.array([share]))[0].tolist()
    return red, green, blue


def _with_filled(colours: NDArray[np.uint8], filled: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    if filled is None:
        return colours
    return np.where(filled[:, None], np.array([CUT], np.uint8), colours).astype(np.uint8)


def _filled_meaning(filled: NDArray[np.bool_] | None) -> list[tuple[str, tuple[int, int, int]]]:
    return [] if filled is None or not filled.any() else [("Filled, not measured", CUT)]

"""What a person may see of a foot in colour: what was measured, by which camera, how surely, and how well."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.points import coordinates
from footscan.report.colours import colour_bar, colour_limit, distance_colours
from footscan.report.filled import CUT, filled_colours, filled_key
from footscan.report.markup import key, number
from footscan.report.viewer import Colouring
from schemas.quality import MeshQuality

Floats = NDArray[np.float64]

CAMERAS = (
    (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66),
    (0, 114, 178), (213, 94, 0), (204, 121, 167), (120, 120, 120),
)  # fmt: skip
"""Told apart by colour-blind eyes, too: Okabe and Ito, "Color universal design", 2008; the ninth is as the first."""
SURE, UNSURE = np.array([253, 231, 37], np.float64), np.array([68, 1, 84], np.float64)
_MIDDLE = np.array([33, 145, 140], np.float64)
"""Between them: three colours of viridis (Smith and van der Walt, 2015), lightness even."""
_SHARE = 0.98
"""Of the surface, what is no less sure than the end of the scale."""


def foot_colourings(
    vertices: Floats,
    filled: NDArray[np.bool_] | None,
    cut_mm: float | None,
    mesh: MeshQuality,
    cloud: NDArray[np.void],
    truth_distance: NDArray[np.floating] | None,
) -> list[Colouring]:
    """In which colours a foot is shown; parameters are those of `footscan.report.scan.page.scan_page`."""
    plain = Colouring("Measured and filled", filled_colours(vertices, filled, cut_mm), filled_key(mesh))
    shown = [plain]
    if truth_distance is not None:
        limit = colour_limit(truth_distance)
        colours = distance_colours(truth_distance, limit)
        shown.insert(0, Colouring("Distance to reference", colours, colour_bar(limit)))
    if len(cloud):
        nearest = cloud[KDTree(coordinates(cloud)).query(vertices)[1]]
        shown += [_by_camera(nearest, filled), _by_uncertainty(nearest, filled)]
    return shown


def _by_camera(nearest: NDArray[np.void], filled: NDArray[np.bool_] | None) -> Colouring:
    """The camera of the measured point that is nearest to each vertex."""
    palette = np.array(CAMERAS, np.uint8)
    colours = palette[(nearest["camera"].astype(int) - 1) % len(CAMERAS)]
    seen = np.unique(nearest["camera"] if filled is None else nearest["camera"][~filled]).tolist()
    meanings = [(f"Camera {camera}", CAMERAS[(camera - 1) % len(CAMERAS)]) for camera in seen]
    return Colouring("Camera", _with_filled(colours, filled), key([*meanings, *_filled_meaning(filled)]))


def _by_uncertainty(nearest: NDArray[np.void], filled: NDArray[np.bool_] | None) -> Colouring:
    """The standard deviation to be expected of the measured point that is nearest to each vertex."""
    sigma = nearest["sigma"].astype(np.float64)
    most = max(float(np.quantile(sigma, _SHARE)), 1e-3)
    steps = key([(f"{number(share * most, 3)} mm", _rgb(share)) for share in (0.0, 0.5, 1.0)] + _filled_meaning(filled))
    note = '<p class="note">Standard deviation to be expected of a point’s place, along the normal of the skin.</p>'
    return Colouring("Uncertainty", _with_filled(_ramp(sigma / most), filled), steps + note)


def _ramp(share: Floats) -> NDArray[np.uint8]:
    """(N, 3) colours of (N,) values from 0, sure, to 1, unsure."""
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

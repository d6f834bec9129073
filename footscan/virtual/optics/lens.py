"""A camera's lens: directions in the camera's frame to pixels and back, with Brown's radial and tangential distortion.

D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971) 855-866.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Lens:
    """Pinhole with distortion; the camera looks along +z, with x to the image's right and y down."""

    focal_px: float
    centre_px: tuple[float, float]
    """Principal point (i, j)."""
    k1: float
    k2: float
    p1: float
    p2: float

    def pixels(self, directions: Floats) -> Floats:
        """Pixels (i, j), (N, 2), of `directions` (N, 3) in the camera's frame; NaN behind the camera."""
        ahead = np.where(directions[:, 2:] > 1e-9, directions[:, 2:], np.nan)
        distorted = self._distort(directions[:, :2] / ahead)
        return np.asarray(distorted * self.focal_px + np.asarray(self.centre_px))

    def directions(self, pixels: Floats) -> Floats:
        """Unit directions (N, 3) in the camera's frame that arrive at `pixels` (N, 2)."""
        target = (pixels - np.asarray(self.centre_px)) / self.focal_px
        plane = target.copy()
        for _ in range(12):  # a contraction for the small distortion of these lenses; ends at rounding
            plane = plane + (target - self._distort(plane))
        rays = np.column_stack([plane, np.ones(len(plane))])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def _distort(self, plane: Floats) -> Floats:
        x, y = plane[:, 0], plane[:, 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * self.k2)
        return np.column_stack(
            [
                x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
                y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
            ]
        )

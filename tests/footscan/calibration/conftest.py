"""A pinhole camera that looks at the laser's plane, worked out from where it stands."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.calibration.models.homography import HomographyModel

Floats = NDArray[np.float64]
IMAGE_CENTRE = np.array([319.5, 239.5])
SCALE_PX = float(np.hypot(319.5, 239.5))


@dataclass(frozen=True)
class Pinhole:
    """A camera of 640 x 480 pixels without distortion, at 42 degrees to the plane if not told otherwise."""

    distance_mm: float = 300.0
    angle_deg: float = 42.0
    bearing_deg: float = 45.0
    """Where it stands around the X axis, from Y towards Z."""
    focal_px: float = 1000.0
    roll_deg: float = 0.0
    target_mm: tuple[float, float] = (10.0, 40.0)
    """(Y, Z) that it looks at."""

    def to_plane(self) -> Floats:
        """The homography (3, 3) from pixels to (Y, Z): the inverse of K [r_y r_z t]."""
        angle, bearing, roll = np.deg2rad([self.angle_deg, self.bearing_deg, self.roll_deg])
        away = np.array([np.sin(angle), np.cos(angle) * np.cos(bearing), np.cos(angle) * np.sin(bearing)])
        right = np.cross(away, [1.0, 0.0, 0.0])
        right /= np.linalg.norm(right)
        down = np.cross(-away, right)
        right, down = np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right
        rotation = np.stack([right, down, -away])
        station = np.array([0.0, *self.target_mm]) + self.distance_mm * away
        pose = np.column_stack([rotation[:, 1:], -rotation @ station])
        camera = np.array([[self.focal_px, 0, 319.5], [0, self.focal_px, 239.5], [0, 0, 1.0]])
        return np.linalg.inv(camera @ pose)

    def parameters(self, model: HomographyModel) -> Floats:
        """Its homography as the first eight parameters of `model`, the others zero."""
        normalisation = np.diag([model.scale_px, model.scale_px, 1.0])
        normalisation[:2, 2] = model.centre_px
        matrix = self.to_plane() @ normalisation
        parameters = np.zeros(model.unknowns)
        parameters[:8] = (matrix / matrix[2, 2]).ravel()[:8]
        return parameters

    def world(self, pixels: Floats) -> Floats:
        """(Y, Z) of pixels (N, 2)."""
        points = np.column_stack([pixels, np.ones(len(pixels))]) @ self.to_plane().T
        return points[:, :2] / points[:, 2:]


@pytest.fixture(scope="session")
def pinhole() -> type[Pinhole]:
    return Pinhole


@pytest.fixture(scope="session")
def all_models() -> list[HomographyModel]:
    """Homographies of the whole image, the plain one first."""
    centre = (319.5, 239.5)
    return [
        HomographyModel(centre, SCALE_PX),
        HomographyModel(centre, SCALE_PX, True),
        HomographyModel(centre, SCALE_PX, False, 2),
        HomographyModel(centre, SCALE_PX, True, 2),
        HomographyModel(centre, SCALE_PX, True, 3),
        HomographyModel(centre, SCALE_PX, True, 5),
    ]

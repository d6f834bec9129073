"""The geometry of the virtual scanner: three lasers in one plane, eight cameras around it, a glass plate.

All coordinates are in the frame of the heads: X counts from the laser plane, which stands at X = 0 and travels with
the heads; Y and Z are the world's. Cameras 1 and 2 see the upper +Y side, 3 and 4 the upper -Y side, 5 to 8 the sole
through the glass, of these 5 and 6 from the +Y side and 7 and 8 from the -Y side. Odd cameras stand in front of the
laser plane, at +X, where the toes point; even ones behind it, at -X; the axis of each meets the plane at 42 degrees.
"""

from dataclasses import dataclass
from math import cos, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.glass import THICKNESS_MM, directions_from_below, exits_above
from footscan.virtual.optics.lens import Lens
from footscan.virtual.portable import product
from schemas.base.image_size import FRAME_SIZE

Floats = NDArray[np.float64]

HEIGHT, WIDTH = FRAME_SIZE
"""Size of the pictures, px."""
VOLUME_MM = ((-70.0, 70.0), (0.0, 114.0))
"""The scan volume in Y and Z."""
VIEW_ANGLE_DEGREES = 42.0
"""Angle between a camera's axis and the laser plane. Chosen by hand."""
FAN_DEGREES = 80.0
"""Full angle of a laser's fan. Chosen by hand."""


@dataclass(frozen=True)
class Laser:
    """One line laser; its sheet is the plane X = 0."""

    position: tuple[float, float, float]
    axis: tuple[float, float, float]
    """Unit vector along the middle of the fan."""
    plate_mm: float = THICKNESS_MM
    """Thickness of the glass plate."""

    @property
    def below_glass(self) -> bool:
        """True if its light reaches the foot through the plate."""
        return self.position[2] < -self.plate_mm


@dataclass(frozen=True)
class Camera:
    """One camera, fixed to its head."""

    id: int
    position: Floats
    """(3,) mm, centre of projection."""
    rotation: Floats
    """(3, 3) rows: the image's right, the image's down, the optical axis."""
    lens: Lens
    plate_mm: float = THICKNESS_MM
    """Thickness of the glass plate."""

    @property
    def below_glass(self) -> bool:
        """True if it looks through the plate."""
        return bool(self.position[2] < -self.plate_mm)

    def project(self, points: Floats, passes: int = 1) -> Floats:
        """Project `points` (N, 3), mm, to pixels (i, j), (N, 2) float64; exact, with refraction by the plate.

        `passes` = 3 gives the ghost that a camera below sees: light that was reflected once at each face of the plate.
        """
        through_glass = self.below_glass
        rays = (
            directions_from_below(self.position, points, passes, self.plate_mm)
            if through_glass
            else points - self.position
        )
        return self.lens.pixels(product(rays, self.rotation.T))

    def project_plane(self, y: Floats, z: Floats) -> Floats:
        """Pixels (N, 2) of points (0, y, z) on the laser plane."""
        return self.project(np.column_stack([np.zeros(len(y)), y, z]))

    def rays(self, pixels: Floats) -> tuple[Floats, Floats]:
        """Origins and unit directions, each (N, 3), of the rays that arrive at `pixels` (N, 2).

        They are as they run above the glass; for a camera below it the origins lie on its upper face.
        """
        directions = self.directions(pixels)
        if self.below_glass:
            return exits_above(self.position, directions, thickness=self.plate_mm), directions
        return np.broadcast_to(self.position, directions.shape), directions

    def directions(self, pixels: Floats) -> Floats:
        """Unit directions, (N, 3), from the camera to what it sees at `pixels` (N, 2)."""
        return product(self.lens.directions(pixels), self.rotation)


@dataclass(frozen=True)
class VirtualScanner:
    """One scanner: its seed, its lasers and its cameras."""

    seed: int
    lasers: tuple[Laser, ...]
    cameras: tuple[Camera, ...]

    def camera(self, camera_id: int) -> Camera:
        """Camera `camera_id`, 1 to 8."""
        return self.cameras[camera_id - 1]


def standard_scanner(seed: int = 1, distortion: float = 1.0) -> VirtualScanner:
    """The scanner of a `seed`: mounting and lenses vary a little between scanners and between cameras.

    `distortion` scales the distortion of the lenses. The spreads are chosen by hand.
    """
    cameras = tuple(standing_camera(seed, number, usual_stand(number), distortion) for number in range(1, 9))
    return VirtualScanner(seed, usual_lasers(), cameras)


_UPPER_ELEVATION = 27.0
_LOWER_ELEVATION = -60.0
"""Degrees, chosen by hand. Low upper cameras see the flanks just above the glass better, and the corners of the
reference object there; high ones see the lit instep better."""


def usual_lasers() -> tuple[Laser, ...]:
    """The lasers of the three heads: above on both sides, and below."""

    def laser(y: float, z: float, target_z: float) -> Laser:
        length = sqrt(y * y + (target_z - z) ** 2)
        return Laser((0.0, y, z), (0.0, -y / length, (target_z - z) / length))

    return laser(205.0, 138.0, 45.0), laser(-205.0, 138.0, 45.0), laser(0.0, -190.0, 0.0)


class Stand(NamedTuple):
    """Where a camera stands, and how it looks at the laser plane."""

    below: bool
    left: bool
    """On the +Y side."""
    front: bool
    """At +X."""
    elevation_degrees: float
    """Of the direction to the camera within the laser plane, about X, from the horizontal upwards."""
    angle_degrees: float = VIEW_ANGLE_DEGREES
    """Angle between the camera's axis and the laser plane."""


def nominal_place(stand: Stand) -> tuple[Floats, Floats]:
    """Where a camera is meant to stand, and the point of the laser plane at which it looks; both (3,) mm."""
    elevation, angle = radians(stand.elevation_degrees), radians(stand.angle_degrees)
    distance, side = 250.0 if stand.below else 300.0, 1.0 if stand.left else -1.0
    target = np.array([0.0, side * 4.0, 16.0]) if stand.below else np.array([0.0, side * 20.0, 50.0])
    outward = np.array(
        [(1.0 if stand.front else -1.0) * sin(angle), side * cos(angle) * cos(elevation), cos(angle) * sin(elevation)]
    )
    return target + distance * outward, target


def usual_stand(camera_id: int) -> Stand:
    """The stand of camera 1 to 8."""
    below = camera_id > 4
    elevation = _LOWER_ELEVATION if below else _UPPER_ELEVATION
    return Stand(below, camera_id in (1, 2, 5, 6), camera_id % 2 == 1, elevation)


def standing_camera(seed: int, camera_id: int, stand: Stand, distortion: float = 1.0) -> Camera:
    """The camera of a scanner's `seed` that stands as `stand` says, but for the errors of its mounting."""
    elevation = radians(stand.elevation_degrees)
    below, side = stand.below, 1.0 if stand.left else -1.0
    focal = 1010.0 if below else 1150.0
    random = np.random.default_rng([seed, camera_id, 1])
    place, target = nominal_place(stand)
    position = place + random.normal(0.0, 1.5, 3)
    target = target + np.array([0.0, *random.normal(0.0, 1.5, 2)])
    axis = target - position
    axis /= np.sqrt((axis**2).sum())
    # The picture's long side lies along the plane's diagonal that the camera sees without foreshortening.
    along = np.array([0.0, sin(elevation) * side, -cos(elevation)]) * (-1.0 if below else 1.0)
    right = along - (along * axis).sum() * axis
    right /= np.sqrt((right**2).sum())
    down = np.cross(axis, right)
    roll = radians(random.normal(0.0, 1.2))
    rotation = np.array([cos(roll) * right + sin(roll) * down, cos(roll) * down - sin(roll) * right, axis])
    k1, k2 = random.normal(-0.11, 0.02), random.normal(0.03, 0.01)
    p1, p2 = random.normal(0.0, 8e-4, 2)
    lens = Lens(
        focal_px=float(focal * random.normal(1.0, 0.008)),
        centre_px=(319.5 + float(random.normal(0.0, 5.0)), 239.5 + float(random.normal(0.0, 5.0))),
        k1=float(distortion * k1),
        k2=float(distortion * k2),
        p1=float(distortion * p1),
        p2=float(distortion * p2),
    )
    return Camera(camera_id, position, rotation, lens)

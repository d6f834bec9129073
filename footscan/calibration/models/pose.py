"""Position of a camera from its map of the laser plane.

The image of the plane is a homography K (r1 r2 t), where r1 and r2 are orthogonal unit vectors: two equations for the
unknowns of the camera (Z. Zhang, "A flexible new technique for camera calibration", IEEE TPAMI 22(11), 2000, 1330-1334,
doi:10.1109/34.888718). With square pixels and the principal point in the middle of the image, the only unknown is the
focal length. A map that is not that of a pinhole camera still shows the direction in which the plane is foreshortened,
and the direction in which it appears larger.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.homography import project
from footscan.calibration.models.maps import grid_over, model_of, to_world
from schemas.calibration import CameraCalibration, HomographyMap
from schemas.mounting import mounting_by_number

Floats = NDArray[np.float64]

SAMPLES = 15
"""Pixels a side of the region that are mapped: a bound of time."""
FOCAL_WIDTHS = (0.4, 6.0)
"""Range of focal lengths of cameras, in widths of their images: views of 100 to 10 degrees."""
DISTANCES_MM = (40.0, 2000.0)
"""Range of distances of cameras from the middle of their region. Chosen by hand."""
TYPICAL_MM = 300.0
"""Distance assumed for a camera of which only the direction is known. Chosen by hand."""
LARGEST_MISFIT = 0.02
"""Misfit (rms), relative to the region's diagonal, up to which a map is that of a pinhole. Chosen by hand."""
LEAST_TILT = 0.1
"""Sine of the angle to the plane's normal below which a view is frontal and does not determine focal length or tilt.
Chosen by hand."""
SAME_SIDE, SAME_WAY = 0.95, 0.9
"""Least share of samples that see the plane from one side; least cosine between the directions of foreshortening and
of growth. Chosen by hand."""


def camera_centres(cameras: Iterable[CameraCalibration]) -> dict[int, Floats]:
    """Find the position of each view's camera, by `camera_centre` or else by the mounting that belongs to its number.

    Returns
    -------
    View -> position (3,), mm, as in `camera_centre`, X from the plane of the view's laser; without the cameras whose
    position remains unknown.
    """
    centres = {}
    for camera in cameras:
        centre = camera_centre(camera)
        if centre is None:
            stands = mounting_by_number(camera.camera)
            direction = np.array([stands.x, stands.y, stands.z], np.float64)
            centre = TYPICAL_MM * direction / np.linalg.norm(direction) if direction.any() else None
        if centre is not None:
            centres[camera.view] = centre
    return centres


def camera_centre(camera: CameraCalibration) -> Floats | None:
    """Find the position of a camera's centre of projection from its map.

    A view along the plane's normal gives only the side of the plane; a typical distance is then assumed. Glass in the
    line of sight is ignored: through a plate of 6 mm a camera appears some 5 mm nearer.

    Returns
    -------
    (3,) float64, mm: X from the laser plane, Y and Z. None if the map does not determine it: a map without
    perspective, or one distorted by too few control points.

    Examples
    --------
    A frontal view gives the side of the plane and a typical distance:

    >>> from schemas.calibration import PolynomialMap
    >>> map_ = PolynomialMap(order=1, centre_px=(319.5, 239.5), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> print(camera_centre(CameraCalibration(camera=1, map=map_, region_px=[], points=0)).round(3) + 0.0)
    [300.   0.   0.]
    """
    pixels = grid_over(camera, SAMPLES)
    plane = to_world(camera, pixels)
    if not np.isfinite(plane).all():
        return None
    centre = _by_homography(camera, pixels, plane)
    return centre if centre is not None else _by_foreshortening(camera, pixels, plane)


def _by_homography(camera: CameraCalibration, pixels: Floats, plane: Floats) -> Floats | None:
    """The camera's position from the homography of its map; None if the map is not that of a pinhole camera."""
    middle, image_middle = plane.mean(axis=0), (np.array(camera.image_size.px) - 1) / 2
    if isinstance(camera.map, HomographyMap):
        image = _without_distortion(camera.map, plane) - image_middle
    else:
        image = pixels - image_middle
    to_image = _homography(plane - middle, image)
    misfit = np.sqrt(np.mean(np.sum((project(to_image, plane - middle)[0] - image) ** 2, axis=1)))
    if not misfit <= LARGEST_MISFIT * np.linalg.norm(np.ptp(pixels, axis=0)):
        return None
    y, z = to_image[:, 0], to_image[:, 1]
    # Zhang's equations (3) and (4) with the image of the absolute conic diag(1, 1, f^2) / f^2, by least squares.
    in_image = np.array([y[0] * z[0] + y[1] * z[1], (y[0] ** 2 + y[1] ** 2 - z[0] ** 2 - z[1] ** 2) / 2])
    in_depth = np.array([y[2] * z[2], (y[2] ** 2 - z[2] ** 2) / 2])
    along = float(np.sum(in_image * in_depth))
    if along >= 0:
        return None
    focal = float(np.sqrt(-np.sum(in_image**2) / along))
    if not FOCAL_WIDTHS[0] <= focal / (2 * image_middle[0]) <= FOCAL_WIDTHS[1]:
        return None
    taken = to_image / np.array([[focal], [focal], [1.0]])
    left, lengths, right = np.linalg.svd(taken[:, :2], full_matrices=False)
    axes = left @ right  # the nearest orthonormal vectors
    rotation = np.column_stack([np.cross(axes[:, 0], axes[:, 1]), axes])
    centre = -rotation.T @ taken[:, 2] / lengths.mean()
    tilt = np.hypot(centre[1], centre[2])
    distance = np.linalg.norm(centre)
    if not DISTANCES_MM[0] <= distance <= DISTANCES_MM[1] or tilt < LEAST_TILT * distance:
        return None
    return np.asarray(centre + np.array([0.0, *middle]))


def _without_distortion(pixel_map: HomographyMap, plane: Floats) -> Floats:
    """Where a camera whose lens does not distort sees points (N, 2) of the plane, px."""
    to_plane = np.append(pixel_map.matrix, 1.0).reshape(3, 3)
    uv, _ = project(np.linalg.inv(to_plane), plane)
    return np.asarray(uv * pixel_map.scale_px + np.array(pixel_map.centre_px))


def _homography(plane: Floats, image: Floats) -> Floats:
    """(3, 3) matrix from points (N, 2) of the plane to the image, depths positive (Hartley & Zisserman 2004, 4.1)."""
    to_unit, from_unit = _normalisation(plane), np.linalg.inv(_normalisation(image))
    source, goal = project(to_unit, plane)[0], project(np.linalg.inv(from_unit), image)[0]
    homogeneous = np.column_stack([source, np.ones(len(source))])
    nothing = np.zeros_like(homogeneous)
    rows = np.concatenate(
        [
            np.concatenate([homogeneous, nothing, -goal[:, :1] * homogeneous], axis=1),
            np.concatenate([nothing, homogeneous, -goal[:, 1:] * homogeneous], axis=1),
        ]
    )
    matrix = np.linalg.eigh(np.einsum("np,nq->pq", rows, rows))[1][:, 0].reshape(3, 3)
    matrix = from_unit @ matrix @ to_unit
    return np.asarray(matrix * (1.0 if matrix[2, 2] >= 0 else -1.0))


def _normalisation(points: Floats) -> Floats:
    """(3, 3) matrix that moves and scales `points` (N, 2) to the origin and about unit size."""
    middle = points.mean(axis=0)
    size = np.sqrt(np.mean((points - middle) ** 2)) or 1.0
    return np.array([[1 / size, 0.0, -middle[0] / size], [0.0, 1 / size, -middle[1] / size], [0.0, 0.0, 1.0]])


def _by_foreshortening(camera: CameraCalibration, pixels: Floats, plane: Floats) -> Floats | None:
    """The camera's position from the foreshortening of the plane and the growth of its nearer part.

    A plane tilted by an angle is foreshortened by the cosine of the angle. At a distance D, the area of its image grows
    with the inverse cube of the distance: relatively by 3 sin / D a mm towards the camera.
    """
    model, parameters = model_of(camera.map)
    slopes = np.linalg.det(model.by_pixels(parameters, pixels))
    sides = np.sign(slopes)
    side = 1.0 if sides.sum() < 0 else -1.0  # a camera in front, at +X, sees Y and Z mirrored
    regular = sides == -side
    if np.mean(regular) < SAME_SIDE:
        return None
    middle = plane.mean(axis=0)
    _, lengths, directions = np.linalg.svd(np.linalg.inv(model.by_pixels(parameters, pixels.mean(axis=0)[None])[0]))
    cosine = lengths[1] / lengths[0]
    sine = np.sqrt(1.0 - cosine**2)
    if sine < LEAST_TILT:
        return np.array([side * TYPICAL_MM, *middle])
    about = np.column_stack([plane - middle, np.ones(len(plane))])[regular]
    growth = np.linalg.lstsq(about, -np.log(np.abs(slopes[regular])), rcond=None)[0][:2]
    towards = growth @ directions[1]
    if abs(towards) < SAME_WAY * np.linalg.norm(growth) or towards == 0.0:
        return None
    distance = 3.0 * sine / abs(towards)
    if not DISTANCES_MM[0] <= distance <= DISTANCES_MM[1]:
        return None
    in_plane = middle + distance * sine * np.sign(towards) * directions[1]
    return np.array([side * distance * cosine, *in_plane])

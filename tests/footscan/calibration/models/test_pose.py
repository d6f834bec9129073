import numpy as np
import pytest

from footscan.calibration.models.polynomial import design_matrix
from footscan.calibration.models.pose import TYPICAL_MM, camera_centre, camera_centres
from footscan.virtual.optics.scanner import standard_scanner
from schemas.calibration import CameraCalibration, HomographyMap, PolynomialMap

CENTRE_PX, SCALE_PX = (319.5, 239.5), 400.0


def looking_at_plane(centre: tuple[float, float, float], focal_px: float = 1000.0, roll: float = 0.3) -> np.ndarray:
    """The (3, 3) homography from (Y, Z, 1), mm, to the pixels of a pinhole that looks at Y = 0, Z = 50 of the plane."""
    axis = np.array([0.0, 0.0, 50.0]) - centre
    axis /= np.linalg.norm(axis)
    right = np.cross(axis, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(axis, right)
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.array([c * right + s * down, c * down - s * right, axis])
    camera = np.array([[focal_px, 0.0, CENTRE_PX[0]], [0.0, focal_px, CENTRE_PX[1]], [0.0, 0.0, 1.0]])
    return np.asarray(camera @ np.column_stack([rotation[:, 1], rotation[:, 2], -rotation @ np.array(centre)]))


def homography_camera(to_image: np.ndarray, number: int = 1) -> CameraCalibration:
    """A camera whose map is the inverse of `to_image`."""
    from_uv = np.array([[SCALE_PX, 0.0, CENTRE_PX[0]], [0.0, SCALE_PX, CENTRE_PX[1]], [0.0, 0.0, 1.0]])
    matrix = np.linalg.inv(to_image) @ from_uv
    matrix /= matrix[2, 2]
    pixel_map = HomographyMap(centre_px=CENTRE_PX, scale_px=SCALE_PX, matrix=matrix.ravel()[:8].tolist())
    return calibrated(pixel_map, number)


def polynomial_camera(pixels: np.ndarray, plane: np.ndarray, order: int, number: int = 1) -> CameraCalibration:
    """A camera whose map is fitted to pairs of (N, 2) pixels and (N, 2) places, mm."""
    u, v = ((pixels - CENTRE_PX) / SCALE_PX).T
    alpha = np.linalg.lstsq(design_matrix(u, v, order), plane, rcond=None)[0]
    y, z = alpha.T.tolist()
    return calibrated(PolynomialMap(order=order, centre_px=CENTRE_PX, scale_px=SCALE_PX, alpha_y=y, alpha_z=z), number)


def calibrated(pixel_map: HomographyMap | PolynomialMap, number: int) -> CameraCalibration:
    region = [(60.0, 40.0), (580.0, 40.0), (580.0, 440.0), (60.0, 440.0)]
    return CameraCalibration(camera=number, image_px=(640, 480), map=pixel_map, region_px=region, points=20)


def degrees_between(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))))


@pytest.mark.parametrize("centre", [(200.0, 200.0, 150.0), (-200.0, 150.0, 180.0), (150.0, -90.0, -140.0)])
def test_a_pinhole_is_found_where_it_is(centre: tuple[float, float, float]) -> None:
    found = camera_centre(homography_camera(looking_at_plane(centre)))
    np.testing.assert_allclose(found, centre, atol=1e-4)


@pytest.mark.parametrize(("order", "degrees"), [(2, 6.0), (4, 1.5)])
def test_a_polynomial_tells_it_roughly(order: int, degrees: float) -> None:
    to_image = looking_at_plane((200.0, 200.0, 150.0))
    i, j = np.meshgrid(np.linspace(60, 580, 9), np.linspace(40, 440, 9))
    pixels = np.column_stack([i.ravel(), j.ravel()])
    plane = np.column_stack([pixels, np.ones(81)]) @ np.linalg.inv(to_image).T
    found = camera_centre(polynomial_camera(pixels, plane[:, :2] / plane[:, 2:], order))
    assert found is not None
    middle = np.array([0.0, 0.0, 50.0])
    assert degrees_between(found - middle, np.array([200.0, 200.0, 150.0]) - middle) < degrees


@pytest.mark.parametrize("distortion", [0.0, 1.0])
def test_the_virtual_scanners_cameras(distortion: float) -> None:
    """Through lenses that distort, and for those below through the glass, by polynomials of the third order."""
    for camera in standard_scanner(3, distortion).cameras:
        y, z = (side.ravel() for side in np.meshgrid(np.linspace(-60, 60, 25), np.linspace(0, 110, 25)))
        pixels = camera.project_plane(y, z)
        inside = ((pixels > 40) & (pixels < [600, 440])).all(axis=1)
        plane = np.column_stack([y, z])[inside]
        found = camera_centre(polynomial_camera(pixels[inside], plane, 3, camera.id))
        assert found is not None
        middle = np.array([0.0, *plane.mean(axis=0)])
        assert degrees_between(found - middle, camera.position - middle) < 3.0
        assert np.linalg.norm(found - middle) == pytest.approx(np.linalg.norm(camera.position - middle), rel=0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_frontal_view_tells_the_side(side: float) -> None:
    found = camera_centre(homography_camera(looking_at_plane((side * 400.0, 0.0, 50.0))))
    np.testing.assert_allclose(found, [side * TYPICAL_MM, 0.0, 50.0], atol=5.0)


def test_without_perspective_the_cameras_number_tells() -> None:
    pixels = np.array([[100.0, 100.0], [500.0, 100.0], [500.0, 400.0], [100.0, 400.0]])
    plane = np.array([[-40.0, 80.0], [10.0, 80.0], [40.0, 10.0], [-10.0, 10.0]])
    cameras = [polynomial_camera(pixels, plane, 1, number) for number in (2, 7, 9)]
    assert [camera_centre(camera) for camera in cameras] == [None, None, None]
    centres = camera_centres(cameras)
    assert set(centres) == {2, 7}
    np.testing.assert_array_equal(np.sign(centres[2]), [-1, 1, 1])
    np.testing.assert_array_equal(np.sign(centres[7]), [1, -1, -1])
    assert np.linalg.norm(centres[2]) == pytest.approx(TYPICAL_MM)


def test_a_map_that_folds_says_nothing() -> None:
    folded = calibrated(
        PolynomialMap(
            order=2, centre_px=CENTRE_PX, scale_px=SCALE_PX, alpha_y=[0, 1, 0, 60, 0, 0], alpha_z=[0, 0, 60, 0, 0, 0]
        ),
        1,
    )
    assert camera_centre(folded) is None


def test_a_map_that_is_not_finite_or_constant_says_nothing() -> None:
    constant = PolynomialMap(order=1, centre_px=CENTRE_PX, scale_px=SCALE_PX, alpha_y=[5, 0, 0], alpha_z=[5, 0, 0])
    assert camera_centre(calibrated(constant, 1)) is None

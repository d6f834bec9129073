import numpy as np

from footscan.calibration.models.maps import to_world
from footscan.calibration.models.pose import camera_centres
from footscan.cloud.views import views_of
from schemas.calibration import CameraCalibration, HomographyMap, PolynomialMap


def tilted(number: int, region: list[tuple[float, float]]) -> CameraCalibration:
    """A camera that sees the plane with a strong perspective."""
    pixel_map = HomographyMap(
        centre_px=(319.5, 239.5), scale_px=400.0, matrix=[-60.0, -20.0, 20.0, 20.0, -90.0, 60.0, 0.25, 0.1]
    )
    return CameraCalibration(camera=number, image_px=(640, 480), map=pixel_map, region_px=region, points=20)


REGION = [(100.0, 100.0), (500.0, 100.0), (500.0, 400.0), (100.0, 400.0)]


def test_the_outline_goes_through_the_corners_of_the_region() -> None:
    camera = tilted(1, REGION)
    view = views_of([camera])[1]
    corners = to_world(camera, np.array(REGION))
    for corner in corners:
        assert np.abs(view.outline - corner).sum(axis=1).min() < 1e-9
    after = np.roll(view.outline, -1, axis=0)
    assert np.sum(view.outline[:, 0] * after[:, 1] - after[:, 0] * view.outline[:, 1]) > 0  # counterclockwise
    np.testing.assert_array_equal(view.centre, camera_centres([camera])[1])


def test_without_a_region_it_is_the_images() -> None:
    camera = tilted(1, [])
    corner = to_world(camera, np.array([[639.0, 479.0]]))
    assert np.abs(views_of([camera])[1].outline - corner).sum(axis=1).min() < 1e-9


def test_cameras_of_unknown_place_are_left_out() -> None:
    flat = PolynomialMap(order=1, centre_px=(0, 0), scale_px=1.0, alpha_y=[0, 0.2, 0.1], alpha_z=[0, 0.0, -0.2])
    unknown = CameraCalibration(camera=12, map=flat, region_px=REGION, points=4)
    assert list(views_of([unknown, tilted(1, REGION)])) == [1]

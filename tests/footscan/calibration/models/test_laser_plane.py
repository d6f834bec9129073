import numpy as np

from footscan.calibration.models.laser_plane import row_share, x_in_plane
from schemas.base.image_size import ImageSize
from schemas.calibration import LaserPlane

NONE = [0.0] * 7


def place(
    plane: LaserPlane, x: float = 100.0, y: float = 0.0, z: float = 57.0, step: float = 2.0, row: float = 0.0
) -> float:
    return float(x_in_plane(plane, *(np.array(value) for value in ([x], [[y, z]], [step], [row])))[0])


def test_a_plane_where_the_travel_says() -> None:
    assert place(LaserPlane(head=1, sd=NONE), y=40.0, z=90.0, row=0.4) == 100.0


def test_each_number_moves_what_it_should() -> None:
    assert place(LaserPlane(head=1, offset_mm=-0.5, sd=NONE)) == 99.5
    assert np.isclose(place(LaserPlane(head=1, yaw=0.01, sd=NONE), y=-50.0), 99.5)
    assert np.isclose(place(LaserPlane(head=1, pitch=0.01, sd=NONE), z=107.0), 100.5)
    assert np.isclose(place(LaserPlane(head=1, bend_mm=0.3, sd=NONE), y=-70.0), 100.3)
    assert np.isclose(place(LaserPlane(head=1, scale=0.005, x_mm=300.0, sd=NONE)), 99.0)
    assert np.isclose(place(LaserPlane(head=1, delay_frames=0.5, sd=NONE), step=-2.0), 99.0)
    assert np.isclose(place(LaserPlane(head=1, shutter_frames=0.5, sd=NONE), row=0.5), 100.5)


def test_rows_count_from_the_middle() -> None:
    size = ImageSize(480, 640)
    np.testing.assert_allclose(row_share(np.array([-0.5, 239.5, 479.5]), size), [-0.5, 0.0, 0.5])

"""The scanner's geometry."""

from dataclasses import replace

import numpy as np
import pytest

from footscan.virtual.optics.lens import Lens
from footscan.virtual.optics.scanner import HEIGHT, VOLUME_MM, WIDTH, Camera, standard_scanner

SCANNER = standard_scanner(1)
CAMERAS = SCANNER.cameras


def test_projection_of_a_hand_made_camera() -> None:
    # At (300, 0, 400), 500 mm from the origin that it looks at; the image's right is +Y, its down (-0.8, 0, 0.6) * -1.
    rotation = np.array([[0.0, 1.0, 0.0], [0.8, 0.0, -0.6], [-0.6, 0.0, -0.8]])
    camera = Camera(1, np.array([300.0, 0.0, 400.0]), rotation, Lens(1000.0, (320.0, 240.0), 0.0, 0.0, 0.0, 0.0))
    # (0, 50, 0): 100 px right of the middle. (0, 0, 100): depth 500 - 80 = 420, down -60.
    pixels = camera.project_plane(np.array([0.0, 50.0, 0.0]), np.array([0.0, 0.0, 100.0]))
    np.testing.assert_allclose(pixels, [[320.0, 240.0], [420.0, 240.0], [320.0, 240.0 - 60.0 / 420.0 * 1000.0]])


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: f"camera {camera.id}")
def test_places(camera: Camera) -> None:
    x, y, z = camera.position
    assert (x > 0) == (camera.id % 2 == 1)
    assert (y > 0) == (camera.id in (1, 2, 5, 6))
    assert (z > 0) == (camera.id <= 4)
    assert camera.below_glass == (camera.id >= 5)
    assert np.degrees(np.arcsin(abs(camera.rotation[2, 0]))) == pytest.approx(42.0, abs=1.5)
    np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: f"camera {camera.id}")
def test_rays_meet_the_points_that_they_picture(camera: Camera) -> None:
    y, z = (grid.ravel() for grid in np.meshgrid(np.linspace(*VOLUME_MM[0], 9), np.linspace(*VOLUME_MM[1], 7)))
    origins, directions = camera.rays(camera.project_plane(y, z))
    met = origins - directions * (origins[:, :1] / directions[:, :1])
    np.testing.assert_allclose(met, np.column_stack([np.zeros(len(y)), y, z]), atol=1e-8)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: f"camera {camera.id}")
def test_volume_is_in_the_picture(camera: Camera) -> None:
    # An upper camera answers for all of the section, one below for the part that a sole and its flanks reach.
    height = VOLUME_MM[1] if camera.id <= 4 else (0.0, 50.0)
    y, z = (grid.ravel() for grid in np.meshgrid(np.linspace(*VOLUME_MM[0], 29), np.linspace(*height, 24)))
    i, j = camera.project_plane(y, z).T
    inside = (i >= 0) & (i <= WIDTH - 1) & (j >= 0) & (j <= HEIGHT - 1)
    assert inside.mean() >= 0.97


def test_glass_shifts_the_view_from_below() -> None:
    below, above = SCANNER.camera(5), SCANNER.camera(1)
    points = np.array([[0.0, 10.0, 5.0]])
    straight = replace(below, position=below.position).lens.pixels((points - below.position) @ below.rotation.T)
    # A 6 mm plate brings things nearer by about 6 * (1 - 1 / 1.52) = 2 mm: some pixels.
    assert 2.0 < np.linalg.norm(below.project(points) - straight) < 15.0
    np.testing.assert_allclose(above.project(points), above.lens.pixels((points - above.position) @ above.rotation.T))


def test_seed_makes_the_scanner() -> None:
    point = np.array([[0.0, 20.0, 30.0]])
    same, other = standard_scanner(1), standard_scanner(2)
    for camera in CAMERAS:
        np.testing.assert_array_equal(same.camera(camera.id).project(point), camera.project(point))
        assert np.linalg.norm(other.camera(camera.id).project(point) - camera.project(point)) > 1.0

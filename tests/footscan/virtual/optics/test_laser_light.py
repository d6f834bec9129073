"""The stripe as it falls on the sensor: where it lies, and where it does not."""

import numpy as np
import pytest

from footscan.virtual.optics.laser_light import stripe_picture
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import MATT_GREY, Mesh, Scene
from footscan.virtual.optics.texture import random_texture
from footscan.virtual.optics.views import camera_views
from schemas.parameters.simulation import SimulationSettings

SCANNER = standard_scanner(1)
EVEN = random_texture(1, 0.0)
SETTINGS = SimulationSettings()


def plate(y: tuple[float, float], z: tuple[float, float]) -> Mesh:
    """A strip, 120 mm in X, over the line from (y0, z0) to (y1, z1), facing to the left of that way seen from +X."""
    corners = np.array([[60.0, y[0], z[0]], [60.0, y[1], z[1]], [-60.0, y[1], z[1]], [-60.0, y[0], z[0]]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize(
    ("camera_id", "mesh"),
    [
        (1, plate((-50.0, 60.0), (30.0, 30.0))),
        (2, plate((-10.0, 50.0), (90.0, 5.0))),
        (4, plate((-50.0, 50.0), (10.0, 70.0))),
        (5, plate((50.0, -50.0), (12.0, 2.0))),
        (8, plate((50.0, -50.0), (0.5, 25.0))),
    ],
)
def test_centre_of_the_stripe_is_its_exact_projection(camera_id: int, mesh: Mesh) -> None:
    camera = SCANNER.camera(camera_id)
    x = 0.3
    picture = stripe_picture(Scene(mesh, MATT_GREY), x, SCANNER.lasers, camera_views(camera)[0], EVEN, SETTINGS)
    (y0, z0), (y1, z1) = mesh.vertices[0, 1:], mesh.vertices[1, 1:]
    share = np.linspace(0.0, 1.0, 4001)
    i, j = camera.project_plane(y0 + share * (y1 - y0), z0 + share * (z1 - z0)).T
    columns = np.arange(int(np.ceil(i.min())) + 12, int(i.max()) - 12)
    columns = columns[(columns >= 0) & (columns < picture.shape[1])]
    order = np.argsort(i)
    exact = np.interp(columns, i[order], j[order])
    inside = (exact > 15) & (exact < picture.shape[0] - 15)
    columns, exact = columns[inside], exact[inside]
    light = picture[:, columns]
    centre = (np.arange(len(picture))[:, None] * light).sum(axis=0) / light.sum(axis=0)
    assert len(columns) > 150
    assert np.abs(centre - exact).max() < 0.03


def test_a_wall_shades_what_lies_behind_it() -> None:
    low = plate((-60.0, 60.0), (1.0, 1.0))
    # A wall at Y = 0, 60 mm high, open to both sides: the lasers from +Y and -Y light their own side only.
    wall = plate((0.0, 0.0), (1.0, 61.0))
    back = plate((-0.5, -0.5), (61.0, 1.0))
    parts = [low, wall, back]
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    mesh = Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
    )
    left_laser = SCANNER.lasers[:1]
    for camera_id, y, bright in [(1, 40.0, True), (1, 20.0, True), (3, -20.0, False), (3, -50.0, False)]:
        camera = SCANNER.camera(camera_id)
        picture = stripe_picture(Scene(mesh, MATT_GREY), 0.0, left_laser, camera_views(camera)[0], EVEN, SETTINGS)
        i, j = np.rint(camera.project_plane(np.array([y]), np.array([1.0]))[0]).astype(int)
        assert (picture[j - 1 : j + 2, i - 1 : i + 2].max() > 0.5) == bright
        if not bright:
            assert picture[j - 1 : j + 2, i - 1 : i + 2].max() == 0.0


def test_no_light_on_a_face_that_looks_away() -> None:
    mesh = plate((50.0, -50.0), (20.0, 20.0))  # faces down: lit by the laser below only
    view = camera_views(SCANNER.camera(5))[0]
    scene = Scene(mesh, MATT_GREY)
    assert stripe_picture(scene, 0.0, SCANNER.lasers[:2], view, EVEN, SETTINGS).max() == 0.0
    assert stripe_picture(scene, 0.0, SCANNER.lasers[2:], view, EVEN, SETTINGS).max() > 1.0


def test_brightness_follows_incidence() -> None:
    # Two plates through the same point, one met by the lower laser upright, one at 60 degrees: half as bright a line.
    camera = SCANNER.camera(5)
    sums = []
    for mesh in (plate((40.0, -40.0), (45.0, 45.0)), plate((20.0, -20.0), (45.0 + 34.64, 45.0 - 34.64))):
        light = stripe_picture(Scene(mesh, MATT_GREY), 0.0, SCANNER.lasers[2:], camera_views(camera)[0], EVEN, SETTINGS)
        i, j = np.rint(camera.project_plane(np.zeros(1), np.array([45.0]))[0]).astype(int)
        sums.append(light[j - 8 : j + 9, i - 8 : i + 9].max())
    assert sums[1] / sums[0] == pytest.approx(0.5, abs=0.05)

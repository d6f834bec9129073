"""Pictures of worlds."""

import numpy as np
import pytest

from footscan.virtual.optics.scene import SKIN, Scene
from footscan.virtual.worlds.film.camera_film import CameraFilm
from footscan.virtual.worlds.film.raster import NOTHING, project, rasterise
from footscan.virtual.worlds.machine import Machine, machine_of, moved_camera
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import Subject, make_subject
from schemas.world import World, WorldCameras, WorldLaser, WorldRoom, WorldSubject

CAMERAS = WorldCameras(frames=100, step_mm=4.0)
FRAME = 50


@pytest.fixture(scope="module")
def foot() -> Subject:
    return make_subject(WorldSubject(), 2.0)


def machine(**parts: object) -> Machine:
    return machine_of(World(seed=3, cameras=CAMERAS).model_copy(update=parts))


@pytest.mark.parametrize("camera", [1, 6])
def test_pixels_show_the_point_that_a_ray_meets(foot: Subject, camera: int) -> None:
    here = machine()
    pose = here.pose(here.head_of[camera], here.seconds(FRAME))
    moved = moved_camera(here.cameras[camera], pose)
    raster = rasterise(project(foot.mesh.vertices, moved), foot.mesh.faces, here.size)
    rows, columns = np.nonzero(raster.face != NOTHING)
    assert len(rows) > 20_000
    chosen = np.random.default_rng(1).choice(len(rows), 2000, replace=False)
    rows, columns = rows[chosen], columns[chosen]
    corners = foot.mesh.vertices[foot.mesh.faces[raster.face[rows, columns]]]
    u, v = raster.shares[rows, columns].astype(np.float64).T
    points = corners[:, 0] * (1.0 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    origins, directions = moved.rays(np.column_stack([columns, rows]).astype(np.float64))
    hits = Scene(foot.mesh, SKIN).cast(np.ascontiguousarray(origins), directions)
    met = origins[hits.ray] + hits.distance[:, None] * directions[hits.ray]
    assert len(hits.ray) > 0.99 * len(points)
    errors = np.linalg.norm(points[hits.ray] - met, axis=1)
    assert np.quantile(errors, 0.99) < 0.05


def stripe_errors(here: Machine, foot: Subject, camera: int) -> np.ndarray:
    """Distances in px of the brightest line in a picture from the exact stripe, where the stripe is well apart."""
    light = CameraFilm(here, foot, camera).light(FRAME, np.random.default_rng(1))
    red = light[:, :, 0].astype(np.float64)
    exact = world_stripes(here, foot)[camera]
    exact = exact[(exact["frame"] == FRAME) & np.isfinite(exact["place"][:, 0])]
    pose = here.pose(here.head_of[camera], here.seconds(FRAME))
    pixels = moved_camera(here.cameras[camera], pose).project(exact["place"].astype(np.float64))
    along = np.gradient(pixels, axis=0)
    errors = []
    for (i, j), (di, dj) in zip(pixels[20:-20:5], along[20:-20:5], strict=True):
        across = np.array([-dj, di]) / np.hypot(di, dj)
        offsets = np.arange(-6.0, 6.01, 0.25)
        samples = np.array([_bilinear(red, i + t * across[0], j + t * across[1]) for t in offsets])
        if np.isfinite(samples).all():
            weights = np.maximum(samples - 0.3 * samples.max(), 0.0)
            errors.append(float((weights * offsets).sum() / weights.sum()))
    return np.array(errors)


def _bilinear(picture: np.ndarray, i: float, j: float) -> float:
    rows, columns = picture.shape
    a, b = int(np.floor(j)), int(np.floor(i))
    if not (0 <= a < rows - 1 and 0 <= b < columns - 1):
        return float("nan")
    v, u = j - a, i - b
    upper, lower = (row[0] * (1.0 - u) + row[1] * u for row in picture[a : a + 2, b : b + 2])
    return float(upper * (1.0 - v) + lower * v)


@pytest.mark.parametrize("camera", [1, 4, 5])
def test_the_stripe_is_where_it_is_computed_without_pictures(foot: Subject, camera: int) -> None:
    plain = machine(laser=WorldLaser(speckle=0.0), subject=WorldSubject(scatter_mm=0.0))
    errors = stripe_errors(plain, foot, camera)
    assert len(errors) > 20
    assert abs(np.median(errors)) < 0.05
    assert np.quantile(np.abs(errors), 0.8) < 0.2


def test_a_picture_follows_from_its_world(foot: Subject) -> None:
    here = machine(room=WorldRoom(light=0.3, things=4, people=1, flicker=0.2))
    film = CameraFilm(here, foot, 2)
    assert film.jpeg(7) == CameraFilm(here, foot, 2).jpeg(7)
    assert film.jpeg(7) != film.jpeg(8)


def test_things_of_the_room_drift_and_hardware_does_not() -> None:
    short = make_subject(WorldSubject(length_mm=120.0, arch_mm=6.0), 4.0)

    def change(room: WorldRoom) -> float:
        dark = WorldLaser(power=1e-6)
        film = CameraFilm(machine(room=room, laser=dark), short, 1)
        first, second = (film.light(frame, np.random.default_rng(1)) for frame in (2, 4))  # before the foot comes
        return float(np.abs(first - second).max())

    assert change(WorldRoom(light=1.0)) < 1e-6
    assert change(WorldRoom(light=1.0, things=10, line_things=5)) > 0.1


def test_automatic_exposure_brightens_a_dark_room(foot: Subject) -> None:
    def mean(automatic: bool) -> float:
        cameras = CAMERAS.model_copy(update={"auto_exposure": automatic})
        return float(CameraFilm(machine(cameras=cameras, room=WorldRoom(light=0.1)), foot, 1).picture(FRAME).mean())

    assert mean(automatic=True) > 1.5 * mean(automatic=False)


def test_each_laser_has_its_colour(foot: Subject) -> None:
    for colour, channel in (("red", 0), ("green", 1), ("blue", 2)):
        here = machine(laser=WorldLaser(colour=colour))
        light = CameraFilm(here, foot, 1).light(FRAME, np.random.default_rng(1))
        assert int(np.argmax(light.reshape(-1, 3).sum(axis=0))) == channel

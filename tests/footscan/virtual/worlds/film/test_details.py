"""Hairs, nails and marks of the glass in pictures."""

from collections.abc import Iterable
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from footscan.virtual.worlds.film.camera_film import CameraFilm
from footscan.virtual.worlds.film.details import hairs_of, highlight, sparkle
from footscan.virtual.worlds.film.scenery import Mark
from footscan.virtual.worlds.machine import machine_of
from footscan.virtual.worlds.subject import Subject, make_subject
from schemas.world import World, WorldCameras, WorldGlass, WorldLaser, WorldRoom, WorldSubject

ABOVE, BELOW = 1, 6


@cache
def subject(described: str) -> Subject:
    return make_subject(WorldSubject.model_validate_json(described), 4.0)


def lights(world: World, camera: int, frames: Iterable[int] = (50,)) -> list[np.ndarray]:
    film = CameraFilm(machine_of(world), subject(world.subject.model_dump_json()), camera)
    return [film.light(frame, np.random.default_rng(1)).astype(np.float64) for frame in frames]


def light(world: World, camera: int, frame: int = 50) -> np.ndarray:
    return lights(world, camera, [frame])[0]


def brightest(more: World, less: World, camera: int, frames: Iterable[int]) -> float:
    """The most light that a world has more than another."""
    frames = list(frames)
    pairs = zip(lights(more, camera, frames), lights(less, camera, frames), strict=True)
    return float(max((a - b).max() for a, b in pairs))


def world(**parts: object) -> World:
    still = WorldLaser(speckle=0.0)
    return World(seed=5, cameras=WorldCameras(frames=100, step_mm=4.0, blur_px=0.5), laser=still).model_copy(
        update=parts
    )


def test_hairs_are_dark_in_front_of_lit_skin_and_shine_in_the_laser() -> None:
    room = WorldRoom(light=0.5)
    bald = light(world(room=room), ABOVE)
    hairy = light(world(room=room, subject=WorldSubject(hairs=40)), ABOVE)
    assert (bald - hairy).max() > 0.02
    assert brightest(world(subject=WorldSubject(hairs=40)), world(), ABOVE, (48, 50, 52, 54)) > 0.01


def test_a_wide_mark_shines_where_the_sheet_crosses_it() -> None:
    """A mark of 20 mm radius whose axis the sheet, at X = 112 mm, does not meet."""
    drawn = []
    pose = SimpleNamespace(undo=lambda points: points - [112.0, 0.0, 0.0])
    camera = SimpleNamespace(below_glass=True, project=lambda points: drawn.append(points) or points[:, :2])
    ends = np.array([[100.0, 5.0, 0.0], [98.0, 9.0, 0.0]])
    sparkle([Mark(ends, 20.0, 0.2)], pose, camera, 1.0, None, np.zeros((40, 200, 1), np.float32))  # type: ignore[arg-type]
    np.testing.assert_allclose(drawn, [[[112.0, -11.0, 0.0], [112.0, 21.0, 0.0]]])


def test_hairs_grow_where_a_foot_has_some() -> None:
    foot = make_subject(WorldSubject(), 4.0)
    normals = np.tile([0.0, 0.0, 1.0], (len(foot.mesh.vertices), 1))
    hairs = hairs_of(foot.mesh, normals, world(subject=WorldSubject(hairs=30)))
    assert hairs.shape == (30, 2, 3)
    assert hairs[:, 0, 2].min() > 25.0
    lengths = np.linalg.norm(hairs[:, 1] - hairs[:, 0], axis=1)
    assert lengths.min() > 5.0
    assert lengths.max() < 30.0
    assert len(hairs_of(foot.mesh, normals, world())) == 0


def test_a_nail_shines_where_it_mirrors_the_light_into_the_camera() -> None:
    up = np.array([[0.0, 0.0, 1.0]])
    nail = np.array([[0.0, 0.0, 0.0, 5.0]])
    at, slanted = np.zeros((1, 3)), np.array([[0.0, 0.6, 0.8]])
    assert highlight(at, up, up, up, nail) == pytest.approx(1.0)
    assert highlight(at, up, slanted, slanted * [1.0, -1.0, 1.0], nail) == pytest.approx(1.0)
    assert highlight(at, up, slanted, slanted, nail) < 0.01
    assert highlight(at + 6.0, up, up, up, nail) == 0.0
    assert highlight(at, -up, up, up, nail) == 0.0


def test_nails_lie_on_the_toes() -> None:
    foot = make_subject(WorldSubject(side="left", turn_deg=15.0), 2.0)
    assert len(foot.nails) == 5
    for x, y, z, radius in foot.nails:
        away = np.linalg.norm(foot.mesh.vertices - [x, y, z], axis=1)
        near = foot.mesh.vertices[away < radius]
        assert len(near) > 5
        assert near[:, 2].max() > z - 1.0
    glossy = world(room=WorldRoom(light=0.5), subject=WorldSubject(nail_gloss=1.0))
    assert brightest(glossy, world(room=WorldRoom(light=0.5)), ABOVE, (75, 80)) > 0.05


@pytest.mark.parametrize("camera", [ABOVE, BELOW])
def test_dust_shines_where_the_sheet_crosses_it(camera: int) -> None:
    clean, dusty = world(), world(glass=WorldGlass(dust=50, wet_spots=10))
    assert brightest(dusty, clean, camera, range(4, 12, 2)) > 0.02


def test_the_border_of_a_picture_is_out_of_focus() -> None:
    things = WorldRoom(light=1.0, line_things=20)
    sharp = light(world(room=things), ABOVE, 2)
    cameras = WorldCameras(frames=100, step_mm=4.0, blur_px=0.5, defocus_px=2.0)
    soft = light(world(room=things, cameras=cameras), ABOVE, 2)

    def edges(picture: np.ndarray) -> tuple[float, float]:
        slope = np.abs(np.diff(picture[:, :, 1], axis=1))
        return float(slope[220:260, 300:340].max()), float(np.quantile(slope[:, :60], 0.999))

    assert edges(soft)[1] < 0.7 * edges(sharp)[1]
    middle = np.abs(soft - sharp)[235:245, 315:325]
    assert middle.max() < 0.05

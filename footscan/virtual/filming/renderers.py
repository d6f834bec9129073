"""Shares the frames of all cameras among processes; the pictures do not depend on how they are shared."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import islice
from multiprocessing import get_context
from typing import NamedTuple

from footscan.child_process import end_with_parent
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import Mesh, Scene, Surface
from footscan.virtual.optics.texture import random_texture
from schemas.parameters.simulation import SimulationSettings

FRAMES_A_TASK = 20
"""Frames that a process renders at a time. Chosen by hand; no byte depends on it."""


class Shot(NamedTuple):
    """One frame to take."""

    frame: int
    x: float
    """mm, X of the laser plane."""
    mesh: int
    """Index of the mesh that stands on the glass."""


def shoot(
    meshes: list[Mesh],
    surface: Surface,
    cameras: list[int],
    shots: list[Shot],
    settings: SimulationSettings,
    workers: int,
) -> Iterator[tuple[int, list[bytes]]]:
    """Take all `shots` with all `cameras`, in order; yields a camera and JPEG pictures of consecutive shots."""
    tasks = [
        (camera, shots[first : first + FRAMES_A_TASK])
        for camera in cameras
        for first in range(0, len(shots), FRAMES_A_TASK)
    ]
    if workers <= 1:
        studio = Studio(meshes, surface, settings)
        for camera, part in tasks:
            yield camera, studio.shoot(camera, part)
        return
    # Spawned: a forked process inherits locks of threads that it does not have. Few tasks ahead: pictures take memory.
    with ProcessPoolExecutor(workers, get_context("spawn"), _open_studio, (meshes, surface, settings)) as pool:
        todo = iter(tasks)
        running: deque[tuple[int, Future[list[bytes]]]] = deque()
        for camera, part in islice(todo, 2 * workers):
            running.append((camera, pool.submit(_shoot, camera, part)))
        while running:
            camera, future = running.popleft()
            pictures = future.result()
            for next_camera, part in islice(todo, 1):
                running.append((next_camera, pool.submit(_shoot, next_camera, part)))
            yield camera, pictures


class Studio:
    """The meshes and the camera that one process films with; a camera is kept until another one is requested."""

    def __init__(self, meshes: list[Mesh], surface: Surface, settings: SimulationSettings) -> None:
        self._settings = settings
        self._scanner = standard_scanner(settings.scanner_seed, settings.distortion)
        self._scenes = [Scene(mesh, surface) for mesh in meshes]
        self._texture = random_texture(settings.seed, surface.unevenness * settings.texture)
        self._renderer: CameraRenderer | None = None

    def shoot(self, camera: int, shots: list[Shot]) -> list[bytes]:
        """Returns the JPEG pictures of `shots` by one camera."""
        if self._renderer is None or self._renderer.camera.id != camera:
            self._renderer = CameraRenderer(self._scanner, camera, self._settings, self._texture)
        return [self._renderer.jpeg(self._scenes[shot.mesh], shot.x, shot.frame) for shot in shots]


_studios: list[Studio] = []


def _open_studio(meshes: list[Mesh], surface: Surface, settings: SimulationSettings) -> None:
    end_with_parent()
    _studios[:] = [Studio(meshes, surface, settings)]


def _shoot(camera: int, shots: list[Shot]) -> list[bytes]:
    return _studios[0].shoot(camera, shots)

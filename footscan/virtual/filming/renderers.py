"""The shots of a scan, and what one process films them with."""

from collections.abc import Iterator
from typing import NamedTuple

from footscan.virtual.filming.processes import shoot_in_order
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
    return shoot_in_order(Studio, (meshes, surface, settings), tasks, workers)


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

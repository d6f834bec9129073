"""Pictures of what stands on the glass, one for each place of the heads on a fine grid, kept in a folder.

Rendering a picture takes 0.06 s, and eight cameras at full rate want four times what two cores render.
The world's clock waits for them. What has been rendered is kept: the folder's name tells what is on the pictures.
"""

import os
import threading
from concurrent.futures import ProcessPoolExecutor
from functools import cache, lru_cache
from hashlib import sha256
from math import log2
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import simplejpeg

from footscan.child_process import end_with_parent
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import MATT_GREY, Mesh, Scene, Surface
from footscan.virtual.optics.sensor import compress, photograph
from footscan.virtual.optics.texture import random_texture
from schemas.base.model import canonical_json
from schemas.parameters.simulation import SimulationSettings

LEVELS_A_STOP = 4
"""Power, exposure and gain are rendered in steps of a quarter of a stop, 19 %: the nearest step is shown. Chosen by
hand, for time."""
FAINTEST = 2.0**-8
"""A power or exposure below this is taken as 0. Chosen by hand."""
GRAIN_GREY = 3.0
"""Its standard deviation, grey levels; compression leaves about as much as a camera's own noise does."""
COARSE = 4
"""The room's light is cast for one pixel in COARSE x COARSE: that takes a third of the time of a picture less than a
film's. Chosen by hand."""
POLITE = 10
"""Niceness of a process that renders. Chosen by hand."""
WORKERS = 2
"""Processes that render, each for the cameras that are its own."""
_RENDERERS_A_PROCESS = 4
"""Those of its cameras at one power: a renderer takes 90 MB."""


class StageLight(NamedTuple):
    """The light that was set, as factors of the simulation's settings."""

    power: float = 1.0
    """Of the lasers; 0 is off."""
    exposure: float = 1.0
    gain: float = 1.0

    def nearest_level(self) -> "StageLight":
        """Returns the rendered light nearest to this one."""
        return StageLight(*map(_nearest_level, self))


class Subject(NamedTuple):
    """The object on the glass."""

    mesh: Mesh | None
    """mm, scanner frame; None for an empty glass."""
    surface: Surface = MATT_GREY


class StagePictures:
    """The pictures of one subject by one scanner; a context manager, whose end ends its processes.

    Picture `index` of a camera shows the laser plane at X = `index` * `grid_mm`. At light 1 it is frame `index` of a
    film, but for the room's light, which is cast for fewer pixels. Elsewhere the light of room and laser is scaled by
    exposure and gain, and noise by the root of the gain, as shot noise is. Read noise, which would grow with all of the
    gain, is smaller than that here.
    """

    def __init__(self, subject: Subject, settings: SimulationSettings, cache: Path, grid_mm: float = 0.5) -> None:
        self.grid_mm = grid_mm
        self._job = _Job(subject, settings, grid_mm)
        self._folder = cache / self._job.digest()
        self._pools: dict[int, ProcessPoolExecutor] = {}
        self._opening = threading.Lock()

    def __enter__(self) -> "StagePictures":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; rendered pictures stay readable."""
        with self._opening:
            for pool in self._pools.values():
                pool.shutdown(cancel_futures=True)
            self._pools.clear()

    def picture(self, camera: int, index: int, light: StageLight) -> bytes:
        """Returns the JPEG picture, from the folder or rendered now (some tenths of a second)."""
        light, index = light.nearest_level(), self._seen(index)
        path = self._path(camera, index, light)
        try:
            return path.read_bytes()
        except FileNotFoundError:
            self._process_of(camera).submit(_render, camera, light, index, path).result()
            return path.read_bytes()

    def with_grain(self, jpeg: bytes, number: int) -> bytes:
        """Returns the picture with some more noise: two pictures of a camera never have the same bytes."""
        picture = simplejpeg.decode_jpeg(jpeg, colorspace="RGB")
        grain = np.random.default_rng([number, 7]).normal(0.0, GRAIN_GREY, picture.shape)
        return compress(np.clip(np.rint(picture + grain), 0, 255).astype(np.uint8), self._job.settings)

    def _seen(self, index: int) -> int:
        return 0 if self._job.subject.mesh is None else index  # an empty scanner looks the same everywhere

    def _path(self, camera: int, index: int, light: StageLight) -> Path:
        level = "-".join(f"{factor:.3f}" for factor in light)
        return self._folder / level / f"cam{camera}" / f"{index}.jpg"

    def _process_of(self, camera: int) -> ProcessPoolExecutor:
        worker = camera % WORKERS
        with self._opening:
            if worker not in self._pools:
                # Spawned: a forked process inherits locks of threads that it does not have.
                self._pools[worker] = ProcessPoolExecutor(1, get_context("spawn"), _open_studio, (self._job,))
            return self._pools[worker]


class _Job(NamedTuple):
    """All that pictures depend on, apart from camera, place and light."""

    subject: Subject
    settings: SimulationSettings
    grid_mm: float

    def digest(self) -> str:
        """Returns the digest of the job and of the modules that render."""
        mesh = self.subject.mesh
        content = sha256(canonical_json(self.settings.model_dump(mode="json")).encode())
        content.update(repr((self.grid_mm, self.subject.surface)).encode())
        if mesh is not None:
            content.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
        content.update(digest_of_rendering().encode())
        return content.hexdigest()[:16]


@cache
def digest_of_rendering() -> str:
    """SHA-256 of the modules that render."""
    virtual = Path(__file__).parents[1]
    others = (virtual / "filming/render.py", virtual / "room/room.py", virtual / "portable.py", Path(__file__))
    return sha256(
        b"".join(file.read_bytes() for file in (*sorted((virtual / "optics").glob("*.py")), *others))
    ).hexdigest()


def _nearest_level(factor: float) -> float:
    return 0.0 if factor < FAINTEST else float(2.0 ** (round(LEVELS_A_STOP * log2(factor)) / LEVELS_A_STOP))


_NOTHING = Mesh(np.array([[1e6, 0, 0], [1e6, 1, 0], [1e6, 0, 1]], np.float64), np.array([[0, 1, 2]], np.int64))
"""A triangle a kilometre away: a scene needs at least one."""


class _Studio:
    """The scene and the renderers of one process."""

    def __init__(self, job: _Job) -> None:
        self._job = job
        settings, subject = job.settings, job.subject
        scanner = standard_scanner(settings.scanner_seed, settings.distortion)
        texture = random_texture(settings.seed, subject.surface.unevenness * settings.texture)
        self._scene = Scene(subject.mesh or _NOTHING, subject.surface)

        @lru_cache(maxsize=_RENDERERS_A_PROCESS)
        def renderer(camera: int, power: float) -> CameraRenderer:
            lit = settings.model_copy(update={"laser_exposure": min(settings.laser_exposure * power, 100.0)})
            return CameraRenderer(scanner, camera, lit, texture, coarse=COARSE)

        self._renderer = renderer

    def jpeg(self, camera: int, index: int, light: StageLight) -> bytes:
        settings = self._job.settings
        random = np.random.default_rng([settings.seed, camera, index % 2**32, 4])  # as films have it
        seen = self._renderer(camera, light.power).light(self._scene, index * self._job.grid_mm, random)
        noisy = settings.model_copy(update={"noise": min(settings.noise * light.gain**0.5, 100.0)})
        return compress(photograph(seen * np.float32(light.exposure * light.gain), random, noisy), settings)


_studios: list[_Studio] = []


def _open_studio(job: _Job) -> None:
    end_with_parent()
    os.nice(POLITE)  # the clock waits for pictures, and nothing waits for those who read it
    _studios[:] = [_Studio(job)]


def _render(camera: int, light: StageLight, index: int, path: Path) -> None:
    """Write a picture; it appears under its name when it is complete."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.part")
    partial.write_bytes(_studios[0].jpeg(camera, index, light))
    partial.replace(path)

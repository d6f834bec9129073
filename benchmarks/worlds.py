"""What a picture of a world costs beside a picture of the standard virtual scanner, and a world without pictures.

.venv/bin/python -m benchmarks.worlds [SEED ...]
"""

import sys
import time

import numpy as np

from benchmarks.compare import interleave, print_ratios
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN, Scene
from footscan.virtual.optics.texture import random_texture
from footscan.virtual.worlds.draw import draw_world
from footscan.virtual.worlds.film.camera_film import CameraFilm
from footscan.virtual.worlds.machine import machine_of
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import Subject, make_subject
from schemas.parameters.simulation import SimulationSettings
from schemas.world import World

SEEDS = (9, 12, 36)
PLACES = np.linspace(0.2, 0.8, 4)
"""Shares of the travel at which the cameras take a picture."""
CAMERAS = (1, 3, 5, 7)


def main() -> None:
    for seed in map(int, sys.argv[1:]) if len(sys.argv) > 1 else SEEDS:
        world = draw_world(seed)
        subject = make_subject(world.subject)
        cameras = [camera for camera in CAMERAS if camera not in world.cameras.missing]
        _compare_pictures(world, subject, cameras)
        start = time.process_time()
        world_stripes(machine_of(world), subject)
        print(f"  all stripes of the world without pictures{time.process_time() - start:13.1f} s of one core")


def _compare_pictures(world: World, subject: Subject, cameras: list[int]) -> None:
    machine, scanner, settings = machine_of(world), standard_scanner(1), SimulationSettings()
    texture, scene = random_texture(settings.seed, SKIN.unevenness), Scene(subject.mesh, SKIN)
    standard = [CameraRenderer(scanner, camera, settings, texture) for camera in cameras]
    films = {camera: CameraFilm(machine, subject, camera, scene) for camera in cameras}

    def of_the_standard_scanner() -> None:
        for renderer in standard:
            for place in PLACES:
                renderer.jpeg(scene, 400.0 * place, int(200 * place))

    def of_the_world() -> None:
        for camera, film in films.items():
            for place in PLACES:
                film.jpeg(int(place * machine.frames(machine.head_of[camera])))

    runs = {"standard virtual scanner": of_the_standard_scanner, "world": of_the_world}
    seconds = interleave(runs, 3)
    print_ratios(f"World {world.seed}, {world.cameras.size}", seconds, len(cameras) * len(PLACES), "picture")


if __name__ == "__main__":
    main()

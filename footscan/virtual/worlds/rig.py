"""Cameras of a world's scanner that stand elsewhere than the standard eight."""

import numpy as np

from footscan.virtual.optics.scanner import Camera, Stand, standard_scanner, standing_camera
from schemas.world import World

LEFT_HEAD, RIGHT_HEAD, LOWER_HEAD = range(3)
ELEVATIONS = {False: (12.0, 48.0), True: (-78.0, -42.0)}
"""Ranges of the elevation of cameras above and below, degrees: 15 or more to either side of the standard one. Chosen by
hand."""
ANGLES = (32.0, 52.0)
"""Range of the angle between a camera's axis and the laser plane, degrees: 10 to either side of the standard one."""


def cameras_of(world: World) -> dict[int, tuple[Camera, int]]:
    """Return the cameras of a world's scanner by number, each with its head; they follow from the world's seed.

    Examples
    --------
    >>> from schemas.world import WorldRig
    >>> two = cameras_of(World(seed=1, rig=WorldRig(above=2, below=0)))
    >>> [(camera, head, bool(seen.position[1] > 0)) for camera, (seen, head) in two.items()]
    [(1, 0, True), (2, 1, False)]
    """
    if world.rig is None:
        standard = standard_scanner(world.seed).cameras
        return {camera.id: (camera, _head(camera.below_glass, camera.position[1] > 0.0)) for camera in standard}
    cameras = {}
    for number in range(1, world.rig.above + world.rig.below + 1):
        random = np.random.default_rng([world.seed, 210, number])
        below = number > world.rig.above
        place = number - world.rig.above if below else number
        stand = Stand(
            below=below,
            left=place % 2 == 1,
            front=bool(random.random() < 0.5),
            elevation_degrees=float(random.uniform(*ELEVATIONS[below])),
            angle_degrees=float(random.uniform(*ANGLES)),
        )
        cameras[number] = standing_camera(world.seed, number, stand), _head(below, stand.left)
    return cameras


def _head(below: bool, left: bool) -> int:
    if below:
        return LOWER_HEAD
    return LEFT_HEAD if left else RIGHT_HEAD

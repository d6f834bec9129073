"""The ways in which light reaches a camera: straight, mirrored in the glass, or as a ghost from inside the glass."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.glass import exits_above, reflectance
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, Camera
from footscan.virtual.portable import dot

Floats = NDArray[np.float64]


_FOUR = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]])
"""Middles of a pixel's quarters, px from its own middle."""
_ONE = np.zeros((1, 2))


@dataclass(frozen=True)
class View:
    """The rays of all pixels along one way, as they run above the glass, where the object is.

    Arrays have one row a pixel, row by row; steps are the changes to the pixel's right and lower neighbours.
    """

    origins: Floats
    """(P, 3) mm, frame of the heads."""
    directions: Floats
    """(P, 3), unit."""
    origin_steps: tuple[Floats, Floats]
    direction_steps: tuple[Floats, Floats]
    weights: Floats
    """(P,) share of light that arrives this way; 0 where there is no such way."""
    project: Callable[[Floats], Floats]
    """Points (N, 3) mm to pixels (N, 2) along this way."""
    eye: Floats
    """(3,) roughly where points are seen from, to leave out faces that look away."""
    mirrored: bool
    """True if the light is reflected by the glass beside the object, which may then hide the reflection."""
    subpixels: Floats
    """(S, 2) px from a pixel's middle: where in it the stripe is sampled."""

    def at(self, pixels: NDArray[np.int64], offsets: Floats) -> tuple[Floats, Floats]:
        """Origins and directions, (M * K, 3), of the rays of `pixels` (K,), moved by each of `offsets` (M, 2) px."""
        return (
            _moved(self.origins[pixels], self.origin_steps, pixels, offsets),
            _moved(self.directions[pixels], self.direction_steps, pixels, offsets),
        )


def camera_views(camera: Camera) -> tuple[View, View]:
    """The views of `camera`: direct (for a lower camera through the glass), and by reflection.

    An upper camera sees the mirror image in the glass. Only the reflection by the upper face is drawn; that by the
    lower face is fainter, a few millimetres beside it. A lower camera sees the inner ghost: light that was reflected at
    the lower and then at the upper face, inside the plate.
    """
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    directions = camera.directions(np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64))
    turns = _steps(directions)
    vignetting = (dot(directions, camera.rotation[2]) ** 2) ** 2  # the cosine-fourth law of illumination
    once = reflectance(np.abs(directions[:, 2]))
    eye = camera.position
    if camera.below_glass:
        through, twice_turned = (exits_above(eye, directions, passes) for passes in (1, 3))

        def ghost(points: Floats) -> Floats:
            return camera.project(points, passes=3)

        passed = vignetting * (1.0 - once) ** 2
        straight = View(through, directions, _steps(through), turns, passed, camera.project, eye, False, _FOUR)
        inner = View(twice_turned, directions, _steps(twice_turned), turns, passed * once**2, ghost, eye, False, _ONE)
        return straight, inner

    upside = np.array([1.0, 1.0, -1.0])
    falling = directions[:, 2] < -0.02
    length = np.where(falling, -eye[2] / np.where(falling, directions[:, 2], -1.0), 0.0)
    on_glass = eye + length[:, None] * directions

    def mirrored(points: Floats) -> Floats:
        return camera.project(points * upside)

    start = np.broadcast_to(eye, directions.shape)
    still = np.broadcast_to(np.zeros(3), directions.shape)
    straight = View(start, directions, (still, still), turns, vignetting, camera.project, eye, False, _FOUR)
    up_turns = (turns[0] * upside, turns[1] * upside)
    weights = np.where(falling, vignetting * once, 0.0)
    return straight, View(
        on_glass, directions * upside, _steps(on_glass), up_turns, weights, mirrored, eye * upside, True, _ONE
    )


def _moved(rays: Floats, steps: tuple[Floats, Floats], pixels: NDArray[np.int64], offsets: Floats) -> Floats:
    right, down = steps[0][pixels], steps[1][pixels]
    return np.concatenate([rays + di * right + dj * down for di, dj in offsets])


def _steps(rays: Floats) -> tuple[Floats, Floats]:
    grid = rays.reshape(HEIGHT, WIDTH, 3)
    down, right = (np.asarray(np.gradient(grid, axis=axis)).reshape(-1, 3) for axis in (0, 1))
    return right, down

"""The stage of the virtual scanner: what each camera sees while heads move and lasers are lit, as it happens.

True here is: where a head stands is what `position_at` says for the moment of the exposure, and each exposure of a head
that moves fast enough is taken at a moment at which it passes a place of the pictures' grid, so that the stripe is
exactly that of its place.

Approximated is:

- a head that stands, or moves so slowly that it passes no place of the grid within the camera's jitter, is shown at the
  nearest one: up to half the grid off;
- all lasers shine in the plane of the camera's own head: heads that are not aligned see their own stripe alone;
- nothing moves during an exposure;
- the light of the room is cast for fewer pixels than in films;
- power, exposure and gain are rendered in steps of 19 %, see `StagePictures`;
- a place that is seen again looks the same again, noise and all. Only pictures that follow each other differ, by grain
  that is laid over them.
"""

import threading
from collections.abc import Callable, Iterator
from itertools import count
from math import floor

import numpy as np

from footscan import clock
from footscan.virtual.stage.pictures import StageLight, StagePictures

Positions = tuple[float, float, float]

HEAD_OF_CAMERA = {1: 0, 2: 0, 3: 1, 4: 1, 5: 2, 6: 2, 7: 2, 8: 2}
"""Two cameras on each of the upper heads, four on the one below."""
FRAMES_PER_SECOND = 200 / 11
"""The default scan of the live scanner: 200 frames in 11 s."""
JITTER_SECONDS = 0.01
"""Largest difference of an exposure from the camera's clock. Chosen by hand."""
GRAINS = 4
"""Number of different pictures of one place: a bound of memory and time."""
_LOOKS = 5
"""Positions within the jitter between which a crossing is searched. Chosen by hand."""
_HALVINGS = 14
"""They leave 5 ms / 2^14, less than a microsecond, of the time of a crossing."""


class Stage:
    """Eight cameras around what stands on the glass; it can be exchanged while they film.

    Parameters
    ----------
    position_at : X in mm, scanner frame, of the three heads at a time of the clock, which has passed.
    power_at : of the lasers at such a time, 1 being that of the settings, 0 off.
    light_of : exposure and gain that a camera is set to, 1 being those of the settings.
    """

    def __init__(
        self,
        pictures: StagePictures,
        position_at: Callable[[float], Positions],
        power_at: Callable[[float], float] = lambda _: 1.0,
        light_of: Callable[[int], tuple[float, float]] = lambda _: (1.0, 1.0),
    ) -> None:
        self._pictures = pictures
        self._position_at = position_at
        self._power_at = power_at
        self._light_of = light_of
        self._closed = threading.Event()
        self._shown: dict[int, tuple[object, int, list[bytes]]] = {}

    def put(self, pictures: StagePictures) -> None:
        """Exchange the object on the glass; the caller closes the earlier pictures."""
        self._pictures = pictures

    def close(self) -> None:
        """End all `exposures`."""
        self._closed.set()

    def picture(self, camera: int, seconds: float) -> bytes:
        """The JPEG picture that `camera` took at `seconds`; never the same bytes twice in a row."""
        pictures = self._pictures
        x = self._position_at(seconds)[HEAD_OF_CAMERA[camera]]
        light = StageLight(self._power_at(seconds), *self._light_of(camera)).nearest_level()
        sight = (pictures, round(x / pictures.grid_mm), light)
        before, times, grained = self._shown.get(camera, (None, 0, []))
        if sight != before:
            times, grained = 0, [pictures.picture(camera, sight[1], light)]
        elif times < GRAINS:
            grained.append(pictures.with_grain(grained[0], times))
        self._shown[camera] = (sight, times + 1, grained)
        return grained[times % GRAINS]

    def exposures(
        self, camera: int, frames_per_second: float = FRAMES_PER_SECOND, jitter_seconds: float = JITTER_SECONDS
    ) -> Iterator[float]:
        """The times at which `camera` exposes, each given once it has passed; until the stage is closed.

        The camera runs freely: its clock is even, each exposure off it by at most `jitter_seconds`. Waits in between,
        for at most a period; whoever takes them needs a thread for each camera.
        """
        random = np.random.default_rng([camera, 6])
        period = 1.0 / frames_per_second
        start = clock.seconds() + random.uniform(0.0, period)
        for number in count():
            middle = start + number * period
            clock.hold(camera, middle + jitter_seconds)
            if clock.wait_until(self._closed, middle + jitter_seconds):
                return
            aim = middle + random.uniform(-jitter_seconds, jitter_seconds)
            yield self._crossing_near(camera, aim, middle - jitter_seconds, middle + jitter_seconds)

    def _crossing_near(self, camera: int, aim: float, first: float, last: float) -> float:
        """When, near `aim`, the head of `camera` passes a place of the grid between two times; `aim` where it does not.

        Of the two places about the one where it stood at `aim` the nearer one is preferred.
        """
        if not first < last:
            return aim
        grid_mm, head = self._pictures.grid_mm, HEAD_OF_CAMERA[camera]
        place = self._position_at(aim)[head] / grid_mm
        times = np.linspace(first, last, _LOOKS).tolist()
        looks = [self._position_at(seconds)[head] / grid_mm for seconds in times]
        for line in sorted((floor(place), floor(place) + 1), key=lambda line: abs(line - place)):
            for k in range(_LOOKS - 1):
                if (looks[k] < line) != (looks[k + 1] < line):
                    return self._passes(line * grid_mm, head, times[k], times[k + 1])
        return aim

    def _passes(self, x: float, head: int, before: float, after: float) -> float:
        """When the head passes `x` between two times, by halving."""
        rises = self._position_at(before)[head] < x
        for _ in range(_HALVINGS):
            middle = (before + after) / 2.0
            if (self._position_at(middle)[head] < x) == rises:
                before = middle
            else:
                after = middle
        return (before + after) / 2.0

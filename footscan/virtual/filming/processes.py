"""Shares the pictures of all cameras among processes; the pictures do not depend on how they are shared."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import islice
from multiprocessing import get_context
from typing import Any, Protocol

from footscan.child_process import end_with_parent


class Studio(Protocol):
    """What one process films with."""

    def shoot(self, camera: int, part: Any) -> list[bytes]:
        """Return the JPEG pictures of consecutive frames of a camera."""
        ...


def shoot_in_order(
    open_studio: Callable[..., Studio], arguments: tuple[Any, ...], tasks: Iterable[tuple[int, Any]], workers: int
) -> Iterator[tuple[int, list[bytes]]]:
    """Shoot all `tasks`, each a camera and some of its frames; yields the camera and the pictures of each, in order.

    Each process opens a studio of its own with `arguments`; one worker is this process alone.
    """
    if workers <= 1:
        studio = open_studio(*arguments)
        for camera, part in tasks:
            yield camera, studio.shoot(camera, part)
        return
    # Spawned: a forked process inherits locks of threads that it does not have. Few tasks ahead: pictures take memory.
    with ProcessPoolExecutor(workers, get_context("spawn"), _open, (open_studio, arguments)) as pool:
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


_studios: list[Studio] = []


def _open(open_studio: Callable[..., Studio], arguments: tuple[Any, ...]) -> None:
    end_with_parent()
    _studios[:] = [open_studio(*arguments)]


def _shoot(camera: int, part: Any) -> list[bytes]:
    return _studios[0].shoot(camera, part)

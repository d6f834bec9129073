"""What can happen to a scanner while it films: to the line, the board, the heads, the cameras, and by a person."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from scanner_bench import CAMERAS, RATE, Bench

from footscan.virtual.board.line import Direction, Harm
from footscan.virtual.filming.stream_faults import FaultKind, StreamFault

HARMS: tuple[Harm, ...] = ("lose", "double", "garbage", "delay")
BYTES: dict[Direction, int] = {"to board": 60, "to host": 400}
"""That pass before some are harmed, at most."""
EXPOSURES = (1, 1, 2, 3, 6, 15, 30)
"""How long a camera's fault lasts."""
LIMIT_SWITCH, UNPLUGGED_SECONDS = 1, 0.5


@dataclass(frozen=True)
class Trouble:
    """Something that happens once."""

    kind: str
    words: str
    happen: Callable[[], object]
    """May take a while."""
    is_unheard: bool = False
    """Whether the board cannot be talked to afterwards, or not as before."""
    held: frozenset[int] = frozenset()
    """Heads that do not go where they are driven, which is found at the end of a scan only."""


def random_trouble(random: Random, bench: Bench) -> Trouble:
    """One of all that can happen."""
    return random.choice(TROUBLES)(random, bench)


def lift(bench: Bench) -> None:
    """What a person sees to: cable, lid, a head that is held, a board that hangs. Cameras come back by themselves."""
    board = bench.board
    board.line.mishaps.clear()
    board.frozen = False
    board.plug_cable()
    board.close_door()
    for head in (1, 2, 3):
        board.stick(head, stuck=False)


def _bytes(random: Random, bench: Bench) -> Trouble:
    direction = random.choice(list(BYTES))
    harm = random.choice(HARMS)
    after, count = random.randrange(BYTES[direction]), random.choice((1, 1, 2, 5, 20))
    seconds = random.choice((0.05, 0.3, 0.8)) if harm == "delay" else 0.0
    words = f"{harm} {count} bytes {direction} behind {after}, {seconds} s"

    def happen() -> None:
        bench.board.disturb(direction, harm, after=after, count=count, seconds=seconds)

    return Trouble(f"bytes: {harm}", words, happen)


def _many_bytes(random: Random, bench: Bench) -> Trouble:
    each = [_bytes(random, bench) for _ in range(random.randrange(2, 6))]
    return Trouble("bytes: several", "; ".join(one.words for one in each), lambda: [one.happen() for one in each])


def _restart(_: Random, bench: Bench) -> Trouble:
    return Trouble("board: reset", "", bench.board.restart)


def _hang(random: Random, bench: Bench) -> Trouble:
    seconds = random.choice((0.1, 0.3, 1.0, 3.0, None))

    def happen() -> None:
        bench.board.frozen = True
        if seconds is not None:
            time.sleep(seconds)
            bench.board.frozen = False

    return Trouble("board: hangs", "for good" if seconds is None else f"for {seconds} s", happen, is_unheard=True)


def _alarm(_: Random, bench: Bench) -> Trouble:
    def happen() -> None:
        bench.board._now_set(lambda: bench.board.firmware.alarm(LIMIT_SWITCH))

    return Trouble("board: alarm", "an end switch trips", happen)


def _pause(random: Random, bench: Bench) -> Trouble:
    seconds = random.uniform(0.05, 0.8)
    return Trouble("heads: pause", f"for {seconds:.2f} s", lambda: bench.board.pause(seconds))


def _held(random: Random, bench: Bench) -> Trouble:
    head = random.choice((1, 2, 3))
    return Trouble("heads: one is held", f"head {head}", lambda: bench.board.stick(head), held=frozenset({head}))


def _cable(random: Random, bench: Bench) -> Trouble:
    seconds = random.choice((None, random.uniform(0.0, UNPLUGGED_SECONDS)))

    def happen() -> None:
        bench.board.pull_cable()
        if seconds is not None:
            time.sleep(seconds)
            bench.board.plug_cable()

    if seconds is None:
        return Trouble("cable: pulled", "", happen, is_unheard=True)
    return Trouble("cable: pulled, put back", f"after {seconds:.2f} s", happen, is_unheard=True)


def _lid(random: Random, bench: Bench) -> Trouble:
    seconds = random.uniform(0.0, 0.6)

    def happen() -> None:
        bench.board.open_door()
        time.sleep(seconds)
        bench.board.close_door()

    return Trouble("lid: opened, closed", f"after {seconds:.2f} s", happen)


def _stop(_: Random, bench: Bench) -> Trouble:
    return Trouble("stop: pressed", "", bench.scanner.stop)


def _camera(kind: FaultKind) -> Callable[[Random, Bench], Trouble]:
    def make(random: Random, bench: Bench) -> Trouble:
        cameras = random.sample(list(CAMERAS), random.choice((1, 1, 2, 8)))
        exposures = random.choice(EXPOSURES)

        def happen() -> None:
            for camera in cameras:
                bench.streams.fail(camera, [StreamFault(kind, 0, exposures)])
            time.sleep((exposures + 1) / RATE)

        return Trouble(f"camera: {kind}", f"cameras {sorted(cameras)}, {exposures} exposures", happen)

    return make


TROUBLES: tuple[Callable[[Random, Bench], Trouble], ...] = (
    *(_bytes,) * 8,
    *(_many_bytes,) * 2,
    *(_restart, _hang, _alarm, _pause, _held, _stop),
    *(_cable,) * 2,
    *(_lid,) * 2,
    *(_camera("drop"), _camera("repeat"), _camera("tear"), _camera("stall"), _camera("cut"), _camera("cut")),
)


class Coming(threading.Thread):
    """A trouble that is to come after so many seconds."""

    def __init__(self, trouble: Trouble, seconds: float) -> None:
        super().__init__(name="trouble", daemon=True)
        self._trouble, self._seconds = trouble, seconds
        self.start()

    def run(self) -> None:
        time.sleep(self._seconds)
        self._trouble.happen()

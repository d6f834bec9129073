"""A scanner's controller without hardware: a program that answers on a pseudo-terminal as a Grbl 1.1 board does.

    python -m footscan.virtual.board.board

prints the terminal's name and answers there until it is ended. Heads move over time, switches trip, the laser has its
power at every moment; the true state can be read, and mishaps of every kind can be caused.
"""

import argparse
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from footscan import clock
from footscan.virtual.board.firmware import Firmware
from footscan.virtual.board.line import BoardLine, Direction, Harm, Mishap
from footscan.virtual.board.memory import Build, Memory
from footscan.virtual.board.motion import Motion
from footscan.virtual.board.rails import Gait, Mount, Rail, Triple

TICK_SECONDS = 0.004
"""Period of the firmware's loop; that of the real firmware is not longer. Chosen by hand."""

MOUNTS = (Mount(-20.0), Mount(-20.0), Mount(-20.0))
"""Home at X = -20, travel towards greater X: the range of the virtual films lies within."""


class Board:
    """The board, its rails and its cable; runs in a thread of its own between `start` and `close`."""

    def __init__(
        self,
        *,
        settings: Mapping[int, float] | None = None,
        build: Build | None = None,
        heads_at: Triple = (-120.0, -80.0, -200.0),
        mounts: tuple[Mount, Mount, Mount] = MOUNTS,
        gait: Gait | None = None,
        port: Path | None = None,
        boot_seconds: float = 0.0,
    ) -> None:
        """A board that was just switched on.

        Parameters
        ----------
        settings : `$` settings that differ from those of a board that is set up.
        heads_at : where the heads stand on their rails, mm; 0 is the home switch, the far one at -440.
        mounts : how the rails lie in the world.
        gait : how evenly the motors turn.
        port : the name the terminal gets; by default one in a folder of its own.
        boot_seconds : how long a restart takes in which nothing is heard; 1.5 on boards with an Arduino's USB.
        """
        self.mounts = mounts
        self.gait = gait or Gait()
        self.rails = [Rail(), Rail(), Rail()]
        self._folder = tempfile.TemporaryDirectory(prefix="footscan-board-") if port is None else None
        self.line = BoardLine(port or Path(self._folder.name if self._folder else "") / "board")
        self.boot_seconds = boot_seconds
        self.frozen = False
        """Whether the firmware hangs: motors go on, nothing is heard and nothing answered."""
        memory = Memory()
        memory.settings.update(settings or {})
        self.memory = memory
        self.motion = Motion(self.rails, heads_at, self.gait.motion_seconds(clock.seconds()))
        self.firmware = Firmware(self.motion, memory, build or Build(), self._say)
        self._lock = threading.RLock()
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual board", daemon=True)
        self.firmware.now = clock.seconds()
        self.firmware.power_up()

    @property
    def port(self) -> str:
        """What a host opens."""
        return str(self.line.port)

    def start(self) -> Self:
        """Begins to answer."""
        self._thread.start()
        return self

    def close(self) -> None:
        """Ends the thread and takes the terminal away."""
        self._ends.set()
        if self._thread.is_alive():
            self._thread.join()
        self.line.pull()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def position_at(self, seconds: float) -> Triple:
        """World X of the three heads, mm, as they really stood at a time of the world's clock, not later than now."""
        rail = self._rail_at(seconds)
        return (
            self.mounts[0].world(rail[0]),
            self.mounts[1].world(rail[1]),
            self.mounts[2].world(rail[2]),
        )

    def laser_at(self, seconds: float) -> float:
        """The lasers' power at that time, 0 to 1."""
        with self._lock:
            return self.motion.light_at(self._happened(seconds))

    def open_door(self) -> None:
        """Opens the lid."""
        self._now_set(lambda: setattr(self.firmware.pins, "door_open", True))

    def close_door(self) -> None:
        """Closes the lid."""
        self._now_set(lambda: setattr(self.firmware.pins, "door_open", False))

    def stick(self, head: int, stuck: bool = True) -> None:
        """Head 1, 2 or 3 stands still although it is driven, from now on or no longer."""
        self._now_set(lambda: self.motion.stick(head - 1, stuck))

    def lose_steps(self, head: int, mm: float) -> None:
        """Moves a head by `mm` along its rail without the firmware knowing."""
        self._now_set(lambda: self.motion.push(head - 1, mm))

    def pause(self, seconds: float) -> None:
        """The step generator stands still for so long, from now on."""
        self._now_set(lambda: self.gait.pauses.append((clock.seconds(), seconds)))

    def restart(self) -> None:
        """A reset button pressed, or power lost for a moment: motors stand, the position is forgotten."""
        self._now_set(self._power_cycle)

    def pull_cable(self) -> None:
        """Pulls the cable; the board has power of its own and goes on."""
        self._now_set(self.line.pull)

    def plug_cable(self) -> None:
        """Puts the cable back."""
        self._now_set(self.line.plug)

    def disturb(
        self, direction: Direction, harm: Harm, *, after: int = 0, count: int = 1, seconds: float = 0.0
    ) -> None:
        """Something happens once on the line, behind the next `after` bytes that go that way."""
        self._now_set(lambda: self.line.mishaps.append(Mishap(direction, harm, after, count, seconds)))

    def _rail_at(self, seconds: float) -> Triple:
        with self._lock:
            return self.motion.rail_at(self._happened(seconds))

    def _happened(self, seconds: float) -> float:
        """That time on the motion's clock, all that happened until then computed."""
        seconds = min(seconds, clock.seconds())
        moment = self.gait.motion_seconds(seconds)
        if moment > self.motion.moment:
            self.motion.advance(moment)
        return moment

    def _now_set(self, change: Callable[[], object]) -> None:
        with self._lock:
            self._happened(clock.seconds())
            change()

    def _power_cycle(self) -> None:
        self.motion.kill()
        self.firmware.now = clock.seconds()
        self.firmware.power_up(self.boot_seconds)

    def _run(self) -> None:
        while not self._ends.is_set():
            opened = self.line.wait(max(min(TICK_SECONDS, self.line.next_due() - clock.seconds()), 0.0))
            with self._lock:
                if opened:  # as on boards with an Arduino's USB
                    self._power_cycle()
                heard = self.line.read(clock.seconds())
                now = clock.seconds()  # after what was heard: a query is answered with what is so later
                if not self.frozen:
                    self.firmware.receive(heard)
                    self.firmware.tick(now, self.gait.motion_seconds(now))
                self.line.deliver(now)

    def _say(self, text: str) -> None:
        self.line.write(text, clock.seconds())


def main() -> None:
    """Runs a board until Ctrl-C or a request to terminate, also where a shell has it ignore them."""
    parser = argparse.ArgumentParser(description="A virtual Grbl 1.1 board with three heads and lasers.")
    parser.add_argument("--port", type=Path, help="name of the terminal, a symbolic link; one is made up by default")
    arguments = parser.parse_args()
    asked_to_end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked_to_end.set())
    with Board(port=arguments.port) as board:
        print(board.port)
        sys.stdout.flush()
        asked_to_end.wait()


if __name__ == "__main__":
    main()

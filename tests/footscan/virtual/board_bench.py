"""A bench for the virtual board's firmware, with a clock that is turned by hand."""

from collections.abc import Mapping

from footscan.virtual.board.firmware import Firmware
from footscan.virtual.board.memory import Build, Memory
from footscan.virtual.board.motion import Motion
from footscan.virtual.board.rails import Rail, Triple

QUICK = {24: 600.0, 25: 6000.0, 26: 5, 110: 60000.0, 111: 60000.0, 112: 60000.0, 120: 1e4, 121: 1e4, 122: 1e4}
WELCOME = ["", "Grbl 1.1h ['$' for help]"]
LOCKED = "[MSG:'$H'|'$X' to unlock]"


class Bench:
    """A board with a clock that is turned by hand."""

    def __init__(
        self,
        settings: Mapping[int, float] | None = None,
        build: Build | None = None,
        heads_at: Triple = (-12.0, -8.0, -20.0),
    ) -> None:
        self.now = 0.0
        self.said: list[str] = []
        self.memory = Memory()
        self.memory.settings.update(QUICK | dict(settings or {}))
        self.motion = Motion([Rail(), Rail(), Rail()], heads_at, 0.0)
        self.firmware = Firmware(self.motion, self.memory, build or Build(), self.said.append)
        self.firmware.power_up()
        self.at_power_up = self.take()

    def send(self, text: str, seconds: float = 0.02) -> list[str]:
        """What comes back within so many seconds; realtime characters by their Latin-1 codes."""
        self.firmware.receive(text.encode("latin-1"))
        self.wait(seconds)
        return self.take()

    def wait(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + 0.002, end)
            self.firmware.tick(self.now, self.now)

    def take(self) -> list[str]:
        said, self.said[:] = list(self.said), []
        return said

    @property
    def state(self) -> str:
        """First field of a status report."""
        [report] = self.send("?")
        return report[1:].split("|")[0]

    @property
    def light(self) -> float:
        return self.motion.light_at(self.motion.moment)


def home(bench: Bench) -> Bench:
    assert bench.send("$H\n", 6.0) == ["ok"]
    return bench

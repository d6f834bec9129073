"""What the page needs of a scanner, whatever stands behind it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from pipelines.live.state import OnState, ScannerState

Side = Literal["right", "left"]
Level = Literal["ok", "warning", "bad", "unknown"]


@dataclass(frozen=True)
class Device:
    """How a part of the scanner is, in words."""

    name: str
    level: Level
    words: str
    remedy: str = ""
    """What to do; empty where nothing is needed."""


@dataclass(frozen=True)
class Health:
    """How the whole scanner is."""

    devices: Sequence[Device]
    cameras: Sequence[int] = ()
    """Those that may have a live picture."""
    frames: Mapping[int, int] = field(default_factory=dict)
    """Pictures of each camera since the pass began."""
    resumable: bool = False
    """Whether heads are held and would go on."""


@dataclass(frozen=True)
class Scanned:
    """A scan that was stored."""

    patient: str
    scan: str
    side: Side
    problem: str | None = None
    """Why it was not measured."""
    left_out: Mapping[int, str] = field(default_factory=dict)
    """Cameras that are not in it, and why."""


class Scanner(Protocol):
    """A scanner. `state`, `health`, `picture`, `resume` and `stop` are of any thread, the others come one at a time.

    What goes wrong is a `FootscanError`.
    """

    @property
    def state(self) -> ScannerState:
        """What is true now; of any thread."""
        ...

    def listen(self, listener: OnState) -> Callable[[], None]:
        """Has `listener` called with each new state; returns what ends that."""
        ...

    def health(self) -> Health:
        """How everything is; of any thread, and soon."""
        ...

    def picture(self, camera: int) -> bytes | None:
        """The latest JPEG of a camera; None where there is none."""
        ...

    def connect(self) -> None:
        """Opens the devices, again where they were lost."""
        ...

    def home(self) -> None:
        """Homes the heads."""
        ...

    def jog(self, by_mm: float, head: int | None) -> None:
        """Moves all heads, or one, in the dark."""
        ...

    def shine(self) -> None:
        """Lights the heads where they stand, for a few seconds."""
        ...

    def film(self, patient: str, side: Side, *, keep_partial: bool) -> Scanned:
        """A scan from homing to measures."""
        ...

    def resume(self) -> None:
        """Goes on after the door was closed; while `film` waits."""
        ...

    def stop(self) -> None:
        """Lasers off, heads held; ends what is under way."""
        ...

    def close(self) -> None:
        """Lets everything go, with the lasers off."""
        ...

"""The interface of a scanner that the console needs, for a live scanner and for tests."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from pipelines.live.state import OnState, ScannerState
from schemas.base.model import Posture

Side = Literal["right", "left"]
Level = Literal["ok", "warning", "bad", "unknown"]


@dataclass(frozen=True)
class Device:
    """Condition of a part of the scanner, in words."""

    name: str
    level: Level
    words: str
    remedy: str = ""
    """What to do; empty if nothing is needed."""


@dataclass(frozen=True)
class Health:
    """Condition of the whole scanner."""

    devices: Sequence[Device]
    cameras: Sequence[int] = ()
    """Cameras that may have a live picture."""
    frames: Mapping[int, int] = field(default_factory=dict)
    """Frames of each camera since the pass began."""
    resumable: bool = False
    """True if the heads are held and can continue."""


@dataclass(frozen=True)
class Scanned:
    """A scan that was stored."""

    patient: str
    scan: str
    side: Side
    problem: str | None = None
    """Why it was not measured; None if it was."""
    left_out: Mapping[int, str] = field(default_factory=dict)
    """Cameras that are not in the scan, and why."""


class Scanner(Protocol):
    """A scanner. Any thread may call `state`, `health`, `picture`, `resume` and `stop`; the others run one at a time.

    Failures are raised as `FootscanError`.
    """

    @property
    def calibration(self) -> Path | None:
        """File of the calibration that scans are measured with; None if there is none."""
        ...

    @property
    def state(self) -> ScannerState:
        """The present state."""
        ...

    @property
    def finds_stripes(self) -> bool:
        """True once live pictures need not wait for the search for the stripe to be compiled."""
        ...

    def listen(self, listener: OnState) -> Callable[[], None]:
        """Call `listener` with each new state; returns a function that ends it."""
        ...

    def health(self) -> Health:
        """The condition of all parts; returns soon."""
        ...

    def picture(self, camera: int) -> bytes | None:
        """The latest JPEG of a camera; None without one."""
        ...

    def connect(self) -> None:
        """Open the devices; lost devices are opened again."""
        ...

    def home(self) -> None:
        """Home the heads."""
        ...

    def jog(self, by_mm: float, head: int | None) -> None:
        """Move all heads, or one, with the lasers off."""
        ...

    def shine(self) -> None:
        """Switch the lasers on for a few seconds; the heads do not move."""
        ...

    def film(
        self,
        patient: str,
        side: Side,
        *,
        posture: Posture = "unknown",
        keep_partial: bool,
        on_shown: Callable[[Scanned], None] = lambda _: None,
    ) -> Scanned:
        """Make a scan, from homing to report; `on_shown` is called when the foot can be shown, before the report."""
        ...

    def resume(self) -> None:
        """Continue after the door was closed, while `film` waits."""
        ...

    def stop(self) -> None:
        """Switch the lasers off, hold the heads, and end the present action."""
        ...

    def close(self) -> None:
        """Close all devices, lasers off."""
        ...

"""The live scanner as the guide needs it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from footscan.calibration.travel.body import Body
from pipelines.live.calibrating.body_film import film_body
from pipelines.live.calibrating.stills import Stills, live_stills
from pipelines.live.light import ScanLight
from pipelines.live.scanner import STOPPED, LiveScanner
from schemas.base.errors import Fault
from schemas.rig import Rig


class LiveStanding:
    """A `StandingScanner` over the live scanner."""

    def __init__(self, scanner: LiveScanner) -> None:
        self._scanner = scanner

    @property
    def rig(self) -> Rig:
        """The rig of the scanner."""
        return self._scanner.rig

    @rig.setter
    def rig(self, rig: Rig) -> None:
        self._scanner.rig = rig

    def stills(self, light: ScanLight | None) -> Stills:
        """As `StandingScanner.stills`."""
        with _stop_in_words():
            return live_stills(self._scanner, light)

    def film_body(self, place: Path, body: Body, light: ScanLight | None) -> None:
        """As `StandingScanner.film_body`."""
        with _stop_in_words():
            film_body(self._scanner, place, body, light)

    @contextmanager
    def waiting_for(self, words: str) -> Iterator[None]:
        """As `StandingScanner.waiting_for`."""
        with _stop_in_words(), self._scanner.waiting_for(words):
            yield


@contextmanager
def _stop_in_words() -> Iterator[None]:
    """Say of a stop what it means here: what was filmed before is kept."""
    try:
        yield
    except Fault as fault:
        if str(fault) == STOPPED:
            raise Fault("stopped; what was filmed before is kept") from None
        raise

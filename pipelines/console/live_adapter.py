"""An adapter of the live scanner to the console: its devices in words, and a method for each order."""

import datetime
import shutil
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from footscan import clock
from footscan.capture.cameras.stream import StreamHealth
from footscan.capture.cameras.usb_bus import Pass
from pipelines.calibration_check import scanner_check
from pipelines.console.scanner import Device, Health, Level, Scanned, Side
from pipelines.live.devices import passes_of
from pipelines.live.light import ScanLight
from pipelines.live.scan_order import ScanOrder
from pipelines.live.scanner import REPORT_SECONDS, LiveScanner
from pipelines.live.state import OnState, ScannerState
from pipelines.live.storing import FilmedScan, ScanName, next_scan_name
from schemas.base.errors import FootscanError
from schemas.base.model import Posture
from schemas.calibration import read_calibration

JOG_MM_PER_S = 20.0
SHINE_SECONDS = 4.0
SHINE_POWER = 0.5
"""Speed of a jog; duration and share of the laser power of a look at the stripe; all chosen by hand."""
CAMERA_BYTES = 40_000 * 400
"""Largest size of a camera's part of a scan with laser-off frames: bytes per frame x frames."""
LEAST_SCANS, FEW_SCANS = 2, 20
"""The disk is bad below, and a warning is shown below, this many times the size of a scan; chosen by hand."""
LEVELS: dict[str, Level] = {
    "lost": "bad", "closed": "bad", "alarm": "bad", "door": "warning", "held": "warning", "not homed": "warning"
}  # fmt: skip
"""Level of the controller in a state of the board; in others it is well."""
KNOWN_FILE = "known.json"
"""Name of the known measures of a virtual foot, in the folder of its scan."""
CABLE = "check its cable and hub, then connect again"


class Glass(Protocol):
    """The glass of a virtual scanner."""

    subject: str
    """What stands on it."""

    def put(self, subject: str) -> None:
        """Put another subject onto it."""
        ...

    def write_known(self, file: Path) -> None:
        """Write what is known of the foot on it into a file."""
        ...


class LiveAdapter:
    """A `Scanner` over a `LiveScanner`."""

    def __init__(
        self,
        scanner: LiveScanner,
        archive: Path,
        results: Path,
        light: ScanLight | None = None,
        glass: Glass | None = None,
    ) -> None:
        """`light` as in `ScanOrder`; `glass`: of a virtual scanner."""
        self._scanner = scanner
        self._archive, self._results = archive, results
        self._light, self._glass = light, glass
        self._passes, self._plan_problem = _planned(scanner)
        self._not_opened: dict[int, str] = {}
        self._before_pass: dict[int, int] = {}
        self._was_filming = False
        scanner.listen(self._count_from_here)

    @property
    def calibration(self) -> Path | None:
        """As `Scanner.calibration`."""
        named = self._scanner.rig.calibration
        return None if named is None else Path(named)

    @property
    def state(self) -> ScannerState:
        """As `Scanner.state`."""
        return self._scanner.state

    def listen(self, listener: OnState) -> Callable[[], None]:
        """As `Scanner.listen`."""
        return self._scanner.listen(listener)

    def health(self) -> Health:
        """As `Scanner.health`."""
        streams = self._scanner.deck.health()
        devices = [
            *self._board(),
            *(self._camera(camera.id, streams.get(camera.id)) for camera in self._scanner.rig.cameras),
            *self._plan(),
            self._checked(),
            self._space(),
        ]
        frames = {camera: stream.received - self._before_pass.get(camera, 0) for camera, stream in streams.items()}
        cameras = tuple(camera.id for camera in self._scanner.rig.cameras)
        return Health(devices, cameras, frames, resumable=self._is_held())

    @property
    def finds_stripes(self) -> bool:
        """As `Scanner.finds_stripes`."""
        return self._scanner.loops is None or self._scanner.loops.is_done

    def picture(self, camera: int) -> bytes | None:
        """As `Scanner.picture`."""
        frame = self._scanner.deck.latest(camera)
        return None if frame is None else frame.jpeg

    def connect(self) -> None:
        """As `Scanner.connect`."""
        self._not_opened = {}
        self._not_opened = self._scanner.connect()

    def home(self) -> None:
        """As `Scanner.home`."""
        self._scanner.home()

    def jog(self, by_mm: float, head: int | None) -> None:
        """As `Scanner.jog`."""
        self._scanner.jog(by_mm, JOG_MM_PER_S, head)

    def shine(self) -> None:
        """As `Scanner.shine`."""
        self._scanner.shine(SHINE_POWER if self._light is None else self._light.power, SHINE_SECONDS)

    def film(
        self,
        patient: str,
        side: Side,
        *,
        posture: Posture = "unknown",
        keep_partial: bool,
        on_shown: Callable[[Scanned], None] = lambda _: None,
    ) -> Scanned:
        """As `Scanner.film`."""
        if self._glass is not None and side != self._glass.subject:
            with self._scanner.waiting_for(f"putting the virtual {side} foot onto the glass"):
                self._glass.put(side)
        today = datetime.datetime.now().astimezone().date()
        name = ScanName(patient, next_scan_name(self._archive, patient, side, today), side, today, posture)
        order = ScanOrder(name, self._archive, self._results, light=self._light, keep_partial=keep_partial)

        def write_known(place: Path) -> None:
            file = place / KNOWN_FILE
            if self._glass is not None and not file.exists():  # when all is measured: nothing can read it before
                self._glass.write_known(file)

        def shown(filmed: FilmedScan) -> None:
            write_known(filmed.place)
            on_shown(Scanned(patient, name.scan, side, None, dict(filmed.left_out)))

        result = self._scanner.scan(order, shown)
        write_known(result.stored.place)
        problem = None if result.measured is None else result.measured.problem
        return Scanned(patient, name.scan, side, problem, dict(result.stored.left_out))

    def resume(self) -> None:
        """As `Scanner.resume`."""
        self._scanner.heads.resume()

    def stop(self) -> None:
        """As `Scanner.stop`."""
        self._scanner.stop()

    def close(self) -> None:
        """As `Scanner.close`."""
        self._scanner.close()

    def _count_from_here(self, state: ScannerState) -> None:
        """Restart the count of the frames at the begin of each pass."""
        begins = state.name == "filming" and (not self._was_filming or state.progress == 0.0)
        self._was_filming = state.name == "filming"
        if begins:
            self._before_pass = {camera: stream.received for camera, stream in self._scanner.deck.health().items()}

    @property
    def _head_numbers(self) -> range:
        return range(1, len(self._scanner.rig.heads) + 1)

    def _board(self) -> Iterator[Device]:
        try:
            heads = self._scanner.heads
        except FootscanError:
            yield Device("Controller", "bad", "not connected", "check its USB cable and its power, then connect")
            yield from (Device(f"Head {head}", "unknown", "position unknown") for head in self._head_numbers)
            return
        state = heads.state
        door = "" if heads.board.watches_door else "; it has no input for a lid: opening a lid stops nothing"
        level = LEVELS.get(state.name, "ok" if heads.board.watches_door else "warning")
        yield Device("Controller", level, f"{state.words}{door}", state.remedy)
        reports = heads.log.between(clock.seconds() - REPORT_SECONDS, float("inf"))
        for head in self._head_numbers:
            if not heads.board.homed:
                yield Device(f"Head {head}", "warning", "position unknown", "home the heads")
            elif reports:
                yield Device(f"Head {head}", "ok", f"at X = {reports[-1].x_mm[head - 1]:.1f} mm")
            else:
                yield Device(f"Head {head}", "unknown", "homed; no report from the controller")

    def _camera(self, camera: int, stream: StreamHealth | None) -> Device:
        name = f"Camera {camera}"
        latency = next(rig_camera.latency for rig_camera in self._scanner.rig.cameras if rig_camera.id == camera)
        if stream is None:
            return self._closed_camera(camera)
        if stream.state in {"lost", "silent", "closed"} or (stream.problem and stream.state == "connecting"):
            return Device(name, "bad", stream.problem or f"is {stream.state}", CABLE)
        if stream.state == "connecting":
            return Device(name, "unknown", "connecting")
        if latency is None:
            return Device(name, "bad", "latency unknown", "run 'footscan calibrate latency'")
        counts = {"torn": stream.torn, "repeated": stream.repeated, "overflowed": stream.overflowed}
        defects = [f"{count} {defect}" for defect, count in counts.items() if count]
        if defects:
            return Device(name, "warning", f"{_frames(stream.received)}, of these {', '.join(defects)}", CABLE)
        return Device(name, "ok", _frames(stream.received))

    def _closed_camera(self, camera: int) -> Device:
        if (problem := self._not_opened.get(camera)) is not None:
            return Device(f"Camera {camera}", "bad", problem, CABLE)
        later = [number for number, planned in enumerate(self._passes[1:], start=2) if camera in planned.cameras]
        return Device(f"Camera {camera}", "unknown", f"opened for pass {later[0]}" if later else "not open")

    def _plan(self) -> Iterator[Device]:
        if self._plan_problem is not None:
            yield Device("Passes", "bad", self._plan_problem)
        for number, planned in enumerate(self._passes, start=1):
            yield Device("Passes" if len(self._passes) == 1 else f"Pass {number}", "ok", planned.reason)

    def _checked(self) -> Device:
        """The calibration in use and its last check: a camera that moved since makes all measures uncertain."""
        rig = self._scanner.rig
        if rig.calibration is None:
            return Device("Calibration", "bad", "the scanner has none", "calibrate it")
        file = Path(rig.calibration)
        try:
            check = scanner_check(file, [camera.id for camera in rig.cameras])
        except FootscanError as error:
            return Device("Calibration", "bad", str(error))
        today, made = datetime.datetime.now().astimezone().date(), _day_made(file)
        words = file.stem if made is None else f"{file.stem}, made {_day_in_words(made, today)}"
        if check is None:
            since = "" if made is None else " since"
            return Device("Calibration", "ok" if made == today else "unknown", f"{words}; not checked{since}")
        level: Level = "bad" if check.doubt else "ok"
        return Device("Calibration", level, f"{words}; {check.summary('ago')}", check.doubt or "")

    def _space(self) -> Device:
        existing = next(folder for folder in (self._archive, *self._archive.absolute().parents) if folder.exists())
        free = shutil.disk_usage(existing).free
        words = f"{free / 1e9:.1f} GB are free for scans"
        scan_bytes = CAMERA_BYTES * len(self._scanner.rig.cameras)
        if free < LEAST_SCANS * scan_bytes:
            return Device("Disk", "bad", words, f"make room: a scan takes up to {scan_bytes / 1e9:.1f} GB")
        return Device("Disk", "warning" if free < FEW_SCANS * scan_bytes else "ok", words)

    def _is_held(self) -> bool:
        try:
            return self._scanner.heads.state.name in {"door", "held"}
        except FootscanError:
            return False


def _frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"


def _day_made(calibration: Path) -> datetime.date | None:
    """The local day on which a calibration was made; None if its file cannot be read or does not say."""
    try:
        return _day_in_file(calibration, calibration.stat().st_mtime_ns)
    except (OSError, FootscanError):
        return None


@lru_cache(maxsize=4)
def _day_in_file(calibration: Path, _changed_ns: int) -> datetime.date | None:
    """As `_day_made`; pages ask once a second, and the file is read again only after a change."""
    created = read_calibration(calibration).created
    return None if created is None else created.astimezone().date()


def _day_in_words(day: datetime.date, today: datetime.date) -> str:
    days = (today - day).days
    return "today" if days == 0 else f"on {day}" + (f", {days} day{'s' * (days > 1)} ago" if days > 0 else "")


def _planned(scanner: LiveScanner) -> tuple[list[Pass], str | None]:
    try:
        return passes_of(scanner.rig, [camera.id for camera in scanner.rig.cameras]), None
    except FootscanError as error:
        return [], str(error)

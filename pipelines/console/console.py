"""The console: one scanner, one operator at a time, and the present sitting, behind all pages."""

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from pipelines.archive.editing import ScanEditor
from pipelines.archive.job import job_of_scan
from pipelines.console.guidance import guidance
from pipelines.console.operator_lock import OperatorLock
from pipelines.console.presence import Presence
from pipelines.console.scanner import Scanned, Scanner, Side
from pipelines.console.sitting import ScannedFoot, Sitting, judge_scan
from pipelines.live.calibrating.guide import Guide
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.model import Posture, pseudonym

log = logging.getLogger("footscan.console")

Action = Literal["connect", "home", "jog", "shine", "scan", "calibrate"]

LOOKS_SECONDS = 1.0
"""Longest age of the health of the devices on a page; chosen by hand."""
SHORTEST_SECONDS = 0.15
"""Shortest time between two states that are sent to pages; chosen by hand."""
END_SECONDS = 60.0
"""Longest wait for a thread when the console closes."""
WARNING_SECONDS = 60.0
"""How long a warning is shown; chosen by hand."""


class Console:
    """The state behind the pages; usable from any thread. A context manager that closes the scanner, lasers off."""

    def __init__(self, scanner: Scanner, archive: Path, results: Path, guide: Guide | None = None) -> None:
        """`guide` leads through calibrations; None if the scanner has no reference object."""
        self.scanner, self.guide = scanner, guide
        self.archive, self.results = archive, results
        self._lock = threading.Lock()
        self._operator = OperatorLock()
        self._sitting = Sitting()
        self._presence = Presence()
        self._action: Action | None = None
        self._problem: str | None = None
        self._worker: threading.Thread | None = None
        self._warning: tuple[float, str] | None = None
        self._listeners: set[Callable[[], None]] = set()
        self._wake, self.closing = threading.Event(), threading.Event()
        self._seen = self._look()
        self._unlisten = scanner.listen(lambda _: self._wake.set())
        if guide is not None:
            guide.listen(lambda _: self._wake.set())
        self._watch = threading.Thread(target=self._look_on, name="console", daemon=True)
        self._watch.start()

    def __enter__(self) -> "Console":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def editor_of(self, patient: str, scan: str) -> ScanEditor:
        """The editor of a scan; RefusedInput if the scanner is at work, which needs the processor, or there is none."""
        if self._action is not None:
            raise RefusedInput("the scanner", "is at work, expected it to be ready before landmarks are moved")
        folder = self.archive / pseudonym(patient, "patient") / pseudonym(scan, "scan")
        return ScanEditor(job_of_scan(folder, self.scanner.calibration, self.results), folder)

    def seen_by(self, page: str) -> dict[str, Any]:
        """The whole state, as it is sent to a page."""
        with self._lock:
            holder = self._operator.holder
            return {**self._seen, "in_charge": holder == page, "others": holder not in {None, page}}

    def hear(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call `listener`, in any thread, after each change of the state; returns a function that ends it."""
        with self._lock:
            self._listeners.add(listener)
        return lambda: self._listeners.discard(listener)

    def enter(self, page: str) -> None:
        """Register a page that shows the state."""
        with self._lock:
            self._operator.enter(page)
        self._tell()

    def leave(self, page: str) -> None:
        """Unregister a page."""
        with self._lock:
            self._operator.leave(page)
        self._tell()

    def take_over(self, page: str) -> None:
        """Put a page in charge."""
        with self._lock:
            self._operator.take(page)
        self._tell()

    def connect(self, page: str | None = None) -> None:
        """Start to open the devices, for a page or, when the console starts, for none.

        Like all orders it raises RefusedInput if the page is not in charge, or the scanner is busy.
        """
        self._begin(page, "connect", self.scanner.connect)

    def home(self, page: str) -> None:
        """Start to home the heads."""
        self._begin(page, "home", self.scanner.home)

    def jog(self, page: str, by_mm: float, head: int | None) -> None:
        """Start to move heads with the lasers off; they stop when the page no longer calls `here`."""

        def move() -> None:
            with self._presence.needed(page, self.scanner.stop):
                self.scanner.jog(by_mm, head)

        self._begin(page, "jog", move)

    def here(self, page: str) -> None:
        """Record that a page that moves heads is still there; never waits."""
        self._presence.here(page)

    def shine(self, page: str) -> None:
        """Start to light the heads for a few seconds."""
        self._begin(page, "shine", self.scanner.shine)

    def scan(self, page: str, patient: str, side: Side, posture: Posture, keep_partial: bool) -> None:
        """Start a scan."""
        pseudonym(patient, "patient")

        def film() -> ScannedFoot:
            with self._lock:
                self._sitting = self._sitting.begun(patient)
            filmed = self.scanner.film(
                patient, side, posture=posture, keep_partial=keep_partial, on_shown=lambda seen: show(judge(seen))
            )
            return judge(filmed)

        def judge(filmed: Scanned) -> ScannedFoot:
            return judge_scan(filmed, self.results)

        def show(foot: ScannedFoot) -> None:
            with self._lock:
                self._sitting = self._sitting.with_foot(foot)
            self._wake.set()

        self._begin(page, "scan", film)

    def calibrate(self, page: str, act: Callable[[Guide], None]) -> None:
        """Start an action of the guide; the pages show its view."""
        guide = self.guide
        if guide is None:
            raise RefusedInput("reference object", "is missing, expected reference.yaml beside rig.yaml")
        self._begin(page, "calibrate", lambda: act(guide))

    def resume(self, page: str) -> None:
        """Continue after the door was closed."""
        with self._lock:
            self._operator.need(page)
        self.scanner.resume()

    def stop(self) -> None:
        """Switch the lasers off and hold the heads; any page may order it."""
        try:
            self.scanner.stop()
        finally:
            self._wake.set()

    def new_person(self, page: str) -> None:
        """Begin a new sitting; stored scans stay."""
        with self._lock:
            self._operator.need(page)
            if self._action is not None:
                raise RefusedInput("scanner", "is busy, expected to wait or to stop it")
            self._sitting, self._problem = Sitting(), None
        self._wake.set()

    def warn(self, words: str) -> None:
        """Show a warning on all pages for `WARNING_SECONDS`."""
        with self._lock:
            self._warning = (
                time.monotonic() + WARNING_SECONDS,
                "".join(letter if letter.isprintable() else "?" for letter in words),
            )
        self._wake.set()

    def end(self) -> None:
        """Switch the lasers off at once and release the pages; never waits, so that a signal handler may call it."""
        self.closing.set()
        threading.Thread(target=self._stop_working, name="console: last stop").start()

    def close(self) -> None:
        """Stop the present action and close the scanner, lasers off."""
        self.closing.set()
        try:
            self._stop_working()
            if self._worker is not None:
                self._worker.join(END_SECONDS)
        finally:
            self._unlisten()
            self._wake.set()
            self._watch.join(END_SECONDS)
            self.scanner.close()

    def _begin(self, page: str | None, action: Action, call: Callable[[], ScannedFoot | None]) -> None:
        with self._lock:
            if page is not None:
                self._operator.need(page)
            if self._action is not None or self.closing.is_set():
                raise RefusedInput("scanner", "is busy, expected to wait or to stop it")
            self._action, self._problem = action, None
            self._worker = threading.Thread(target=self._act, args=(call,), name=f"console: {action}", daemon=True)
            self._worker.start()
        self._wake.set()

    def _act(self, call: Callable[[], ScannedFoot | None]) -> None:
        problem, foot = None, None
        try:
            foot = call()
        except FootscanError as error:
            problem = str(error)
        except Exception as error:  # the operator must see any error, and the next action must be possible
            log.exception("an action failed")
            problem = f"{type(error).__name__}: {error}"
        with self._lock:
            self._action, self._problem = None, problem
            if foot is not None:
                self._sitting = self._sitting.with_foot(foot)
        self._wake.set()

    def _look_on(self) -> None:
        while not self.closing.is_set():
            self._wake.wait(LOOKS_SECONDS)
            self._wake.clear()
            seen = self._look()
            with self._lock:
                changed, self._seen = seen != self._seen, seen
            if changed:
                self._tell()
            self.closing.wait(SHORTEST_SECONDS)

    def _look(self) -> dict[str, Any]:
        state, health = self.scanner.state, self.scanner.health()
        with self._lock:
            sitting, action, problem = self._sitting, self._action, self._problem
            if self._warning is not None and self._warning[0] < time.monotonic():
                self._warning = None
            warning = None if self._warning is None else self._warning[1]
        return {
            "state": {"name": state.name, "words": state.words, "progress": state.progress, "left_s": state.left_s},
            "action": action,
            "problem": problem,
            "warning": warning,
            "do": guidance(state, health, action),
            "devices": [vars(device) for device in health.devices],
            "cameras": list(health.cameras),
            "frames": {str(camera): count for camera, count in health.frames.items()},
            "resumable": health.resumable,
            "sitting": sitting.as_json(),
            "guide": None if self.guide is None else self.guide.view.as_json(),
        }

    def _tell(self) -> None:
        with self._lock:
            listeners = list(self._listeners)
        for listener in listeners:
            listener()

    def _stop_working(self) -> None:
        self._tell()
        if self._worker is None or not self._worker.is_alive():
            return
        try:
            self.scanner.stop()
        except FootscanError as error:
            log.warning("%s", error)

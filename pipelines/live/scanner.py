"""The live scanner: one object for commands, pages and tests, from connecting to a measured foot."""

import datetime
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self

from footscan import clock
from footscan.capture.board.heads import SLACK_MM, Heads
from footscan.capture.cameras.deck import CameraDeck
from footscan.capture.cameras.stream import CapturedFrame
from footscan.capture.cameras.usb_bus import Pass
from footscan.capture.passes import FilmedPass, PassPlan, film_name, film_pass
from pipelines.calibration_check import check_in_force
from pipelines.live.devices import heads_of, passes_of, sources_of, timing_of
from pipelines.live.light import ScanLight, fix_light, light_of_all, measured_light, places_of_scan
from pipelines.live.observer import looking_on
from pipelines.live.recording_document import ScanStory
from pipelines.live.scan_order import LiveResult, ScanOrder
from pipelines.live.state import Activity, OnState, ScannerState, StateBoard, with_board
from schemas.base.errors import Fault, FootscanError, RefusedInput
from schemas.rig import Rig

if TYPE_CHECKING:  # heads that are only moved do not wait for Zarr, Dask, numba and the reconstruction
    from footscan.ahead_of_time import Compilation
    from footscan.capture.recording import ScanRecording
    from pipelines.live.storing import FilmedScan

WATCH_SECONDS = 0.1
"""Interval at which heads, disk and stops are checked; chosen by hand."""
JOG_FACTOR, JOG_SECONDS = 2.0, 5.0
"""Longest wait for a jog: this factor of its time at full speed, plus this time; chosen by hand."""
REPORT_SECONDS = 1.0
"""Age of the reports of the board among which the latest position is looked for; chosen by hand."""
UNDER_WAY = ("moving", "jogging", "homing", "held", "door")
"""States of the board in which a stop is always sent to it: heads move or are held."""
ANSWERING = (*UNDER_WAY, "ready", "not homed", "alarm", "restarting")
"""States of the board in which a stop is sent to it during an activity of the scanner."""
COMPILING = "compiling for this machine, once; on two cores that takes up to 30 s"
CHECKING = "checking that the heads lost no steps"
STOPPED = "stopped; nothing of this scan is kept"


class LiveScanner:
    """The scanner of a rig. A context manager that closes the devices, lasers off.

    A scan that is measured waits, when the heads are homed, for its `loops` to be compiled.
    """

    def __init__(self, rig: Rig, loops: "Compilation | None" = None) -> None:
        self.rig = rig
        self.loops = loops
        self._board = StateBoard()
        self._heads: Heads | None = None
        self._deck = CameraDeck(sources_of(rig))
        self._stopped = threading.Event()
        self._working = threading.Event()
        self._stopping = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def state(self) -> ScannerState:
        """The present state; usable from any thread."""
        heads = self._heads
        return with_board(self._board.state, None if heads is None else heads.state)

    def listen(self, listener: OnState) -> Callable[[], None]:
        """Call `listener` with each new state, in the working thread; returns a function that ends it."""
        return self._board.listen(listener)

    @property
    def deck(self) -> CameraDeck:
        """The cameras: their health, and live pictures."""
        return self._deck

    @property
    def heads(self) -> Heads:
        """The heads; Fault if the scanner is not connected."""
        if self._heads is None:
            raise Fault("the scanner is not connected")
        return self._heads

    def connect(self, *, cameras: bool = True) -> dict[int, str]:
        """Open the board, and the cameras of the first pass.

        Returns
        -------
        problems : why a camera gives no frames, by camera
        """
        with self._at_work("disconnected", "connecting"):
            self._connect_board()
            problems = self._deck.open_only(self._first_cameras()) if cameras else {}
            self._board.tell("idle")
            return problems

    def home(self) -> None:
        """Home the heads and align them."""
        with self._at_work("homing"):
            self._connect_board()
            self._refuse_stopped()
            self.heads.home()
            self._board.tell("idle")

    def jog(self, by_mm: float, mm_per_s: float, head: int | None = None) -> tuple[float, ...]:
        """Move all heads, or one, with the lasers off; returns their X, mm, when they stand."""
        with self._at_work("idle", "moving"):
            self._connect_board()
            heads = self.heads
            before = heads.position_mm()
            self._refuse_stopped()
            heads.jog(by_mm, mm_per_s, head)
            try:
                limit = clock.seconds() + JOG_FACTOR * abs(by_mm) / mm_per_s + JOG_SECONDS
                x_mm = heads.position_mm()  # a new report, so that the state is that after the order
                while heads.state.name == "jogging" and clock.seconds() < limit:
                    time.sleep(WATCH_SECONDS)
                    x_mm = heads.position_mm()
                moves = [by_mm if moved else 0.0 for moved in heads.carriages.carried(head)]
                if any(abs(x - start - by) > SLACK_MM for x, start, by in zip(x_mm, before, moves, strict=True)):
                    places = ", ".join(f"{x:.2f}" for x in x_mm)
                    raise Fault(f"the heads were stopped at X = {places} mm before they reached their target")
            except BaseException:
                with suppress(Fault):  # the state reports it
                    heads.stop()
                raise
            self._board.tell("idle")
            return x_mm

    def stop(self) -> None:
        """End the present action; lasers are off afterwards, and a scan that was being filmed is not kept.

        If nothing moves or shines, nothing happens.
        """
        self._stopped.set()
        # During work, heads are stopped even if the board has not yet reported a motion that has just begun.
        self._stop_heads(ANSWERING if self._working.is_set() else UNDER_WAY)

    @contextmanager
    def waiting_for(self, words: str) -> Iterator[None]:
        """Reserve the scanner for work that needs no device."""
        with self._at_work("preparing", words), self._stop_reported():
            yield
            self._refuse_stopped()
            self._board.tell("disconnected" if self._heads is None else "idle")

    def scan(self, order: ScanOrder, on_shown: Callable[["FilmedScan"], None] = lambda _: None) -> LiveResult:
        """Film, store, reconstruct and measure a foot.

        `on_shown` is called when the foot can be shown, before its report is written.

        Raises
        ------
        RefusedInput
            The rig lacks data that a scan needs, the scan exists already, the check of the calibration is damaged, or
            the scanner is busy.
        Finding
            A film is incomplete, and the order does not say `keep_partial`. Nothing is stored.
        Fault
            A device or the disk failed. Nothing is stored.
        """
        with self._at_work("filming"):
            calibration = self._calibration(order)
            stored = self.film(order, calibration)
            measured = None
            if order.results is not None and calibration is not None:
                from pipelines.live.measuring import measure_scan

                self._board.tell("reconstructing", progress=0.0)
                measured = measure_scan(
                    stored.place, calibration, order.results, self._board.progress, lambda: on_shown(stored)
                )
            if measured is not None and measured.problem is not None:
                self._board.tell("failed", measured.problem)
            else:
                self._board.tell("done", str(stored.place))
            return LiveResult(stored, measured)

    def film(self, order: ScanOrder, calibration: Path | None = None) -> "FilmedScan":
        """Film and store a foot, with the last check of the calibration: the part of `scan` that needs the devices.

        While the heads return, the foot is measured ahead. The caller has reserved the scanner."""
        from footscan.capture.recording import ScanRecording
        from pipelines.live.ahead import measuring_ahead
        from pipelines.live.storing import expected_bytes, name_scan, store_films

        for camera in self.rig.cameras:
            timing_of(camera)
        check = check_in_force(calibration)
        with self._stop_reported(), self._deck.open_after(self._first_cameras()):
            self._connect_board()
            self._home_if_needed()
            if order.results is not None and self.loops is not None and not self.loops.is_done:
                self._board.tell("preparing", COMPILING)
                self.loops.wait(self._refuse_stopped)
            passes = passes_of(self.rig, [camera.id for camera in self.rig.cameras])
            travel = self.rig.travel
            light = order.light or self.measured_light(passes, places_of_scan(self.rig))
            plan = PassPlan(travel.start_mm, travel.end_mm, travel.mm_per_s, light.power, order.texture)
            started = datetime.datetime.now().astimezone()
            story = ScanStory(started, light, passes, plan, calibration_check=check)
            place = order.archive / order.name.patient / order.name.scan
            size = expected_bytes(self.rig, travel.length_mm * (2 if order.texture else 1))
            with ScanRecording(place, size) as recording:
                for number, planned in enumerate(passes, start=1):
                    words = f"pass {number} of {len(passes)}" if len(passes) > 1 else ""
                    story.filmed.append(self.film_one_pass(planned, plan, light, recording, words, story))
                recording.settle()
                stored = store_films(self.rig, order.name, story, self.heads, recording, order.keep_partial)
                with measuring_ahead(recording.folder, stored.scan, calibration, order.results):
                    story.lost_steps_mm = self._check_steps()
                self._board.tell("storing")
                return name_scan(self.rig, story, self.heads, recording, stored)

    @contextmanager
    def ready(self, words: str = "") -> Iterator[None]:
        """Reserve the scanner, connected and homed, for the block."""
        with self._at_work("filming", words), self._stop_reported(), self._deck.open_after(self._first_cameras()):
            self._connect_board()
            self._home_if_needed()
            self._board.tell("filming", words)
            yield
            self._refuse_stopped()
            self._board.tell("idle")

    @contextmanager
    def ready_to_film(self) -> Iterator[None]:
        """Reserve the scanner, connected and homed, for passes in the block; then check the heads for lost steps."""
        with self.ready():
            yield
            self._check_steps()

    def film_one_pass(
        self,
        planned: Pass,
        plan: PassPlan,
        light: ScanLight,
        recording: "ScanRecording",
        words: str = "",
        story: ScanStory | None = None,
    ) -> FilmedPass:
        """Open the cameras of a pass and film it into a recording."""
        self._board.tell("filming", words, 0.0)
        problems = self._deck.open_only(planned.cameras)
        if problems:
            raise Fault("; ".join(problems.values()))
        fixed = fix_light(self.rig, self._deck, light.exposure_ms)
        if story is not None:
            story.fixed |= fixed
        for camera in planned.cameras:
            recording.open_film(film_name(camera))
            recording.open_film(film_name(camera, background=True))

        def take(name: str, frame: CapturedFrame) -> None:
            recording.take(name, frame.arrival, frame.jpeg)

        def check() -> None:
            recording.check()
            self._refuse_stopped()

        check()
        with self._watched(plan, recording):
            return film_pass(self.heads, self._deck, planned.cameras, plan, take, check)

    def measured_light(self, passes: Sequence[Pass], places: Sequence[float]) -> ScanLight:
        """Measure the light of all passes, each with its cameras, with the heads at `places`, X in mm.

        The caller has reserved the scanner.
        """
        lights = []
        for planned in passes:
            self._board.tell("filming", "looking at the light")
            self._deck.open_only(planned.cameras)
            lights.append(measured_light(self.rig, self._deck, self.heads, places, self._refuse_stopped))
        return light_of_all(lights, self.rig.light.longest_ms)

    def shine(self, power: float, seconds: float) -> None:
        """Switch the lasers on while the heads stand, so that live pictures show the stripe."""
        with self._at_work("idle", "lasers on"):
            self._connect_board()
            self._home_if_needed()
            self.heads.shine(power, seconds)
            self._board.tell("idle")

    def close(self) -> None:
        """Close all devices, lasers off."""
        with ExitStack() as stack:
            stack.callback(self._board.tell, "disconnected")
            stack.callback(self._deck.close)
            if self._heads is not None:
                stack.callback(self._heads.close)
            self._heads = None

    @contextmanager
    def _at_work(self, first: Activity, words: str = "") -> Iterator[None]:
        with self._board.at_work(first, words):
            self._stopped.clear()  # a stop ends only the action during which it was pressed
            self._working.set()
            try:
                with self._held_to_stops():
                    yield
            finally:
                self._working.clear()

    @contextmanager
    def _held_to_stops(self) -> Iterator[None]:
        """End a motion that began just after a stop was pressed, before the board had reported the motion."""

        def look() -> None:
            if self._stopped.is_set():
                with suppress(Fault):  # the state reports it
                    self._stop_heads(UNDER_WAY)

        with looking_on(look, WATCH_SECONDS, "watch for a stop"):
            yield

    @contextmanager
    def _stop_reported(self) -> Iterator[None]:
        """Report a failure that a stop has caused as the stop."""
        try:
            yield
        except FootscanError:
            self._refuse_stopped()
            raise

    def _refuse_stopped(self) -> None:
        if self._stopped.is_set():
            raise Fault(STOPPED)

    def _stop_heads(self, states: tuple[str, ...]) -> None:
        with self._stopping:
            heads = self._heads
            if heads is not None and heads.state.name in states:
                heads.stop()

    def _connect_board(self) -> None:
        if self._heads is not None and self._heads.state.name in {"lost", "closed"}:
            self._heads.close()
            self._heads = None
        if self._heads is None:
            self._heads = Heads(self.rig.port, self.rig.board, heads=heads_of(self.rig))

    def _home_if_needed(self) -> None:
        self._refuse_stopped()
        if not self.heads.board.homed:
            self._board.tell("homing")
            self.heads.home()
            self._refuse_stopped()

    def _check_steps(self) -> tuple[float, ...]:
        """Check that the heads lost no steps: films with wrong positions are worthless. Returns the errors, mm."""
        self._board.tell("filming", CHECKING)
        lost_mm = self.heads.lost_steps_mm()
        self._refuse_stopped()
        return lost_mm

    def _first_cameras(self) -> tuple[int, ...]:
        """The cameras of the first pass: they are open while nothing is filmed, for live pictures."""
        return passes_of(self.rig, [camera.id for camera in self.rig.cameras])[0].cameras

    def _calibration(self, order: ScanOrder) -> Path | None:
        if order.calibration is not None:
            return order.calibration
        if self.rig.calibration is not None:
            return Path(self.rig.calibration)
        if order.results is not None:
            raise RefusedInput("rig", "is missing, expected the scanner's calibration file", field="calibration")
        return None

    @contextmanager
    def _watched(self, plan: PassPlan, recording: "ScanRecording") -> Iterator[None]:
        """Report the progress of the heads, and end the pass if the disk fails."""
        heads = self.heads

        def look() -> None:
            try:
                recording.check()
            except Fault:
                with suppress(Fault):  # the state reports it
                    self._stop_heads(UNDER_WAY)
            for latest in heads.log.between(clock.seconds() - REPORT_SECONDS, math.inf)[-1:]:
                self._board.progress(
                    (latest.x_mm[(plan.head or 1) - 1] - plan.start_mm) / (plan.end_mm - plan.start_mm)
                )

        try:
            with looking_on(look, WATCH_SECONDS, "watch over the pass"):
                yield
        except FootscanError:
            recording.check()  # if the disk failed, its error is the cause
            raise

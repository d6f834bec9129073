"""A stand-in of the scanner: it films in no time, and fails as a test wants it to."""

import json
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import simplejpeg
import trimesh
from made_up_scan import CAMERAS, measures_of, quality_of

from footscan.mesh.formats.ply import ply_of
from footscan.mesh.mesh import Mesh
from pipelines.console.scanner import Device, Health, Scanned, Side
from pipelines.live.state import OnState, ScannerState, StateBoard
from schemas.base.errors import Fault, RefusedInput
from schemas.base.model import Posture

GENEROUS_SECONDS = 60.0
Deliver = Callable[[Path, Side, Posture], None]
"""Puts the results of a scan into an existing folder."""


class StandIn:
    """A `Scanner` with three heads and eight cameras.

    In the activities in `pause` it waits for `go` to be set; `step_seconds` is the time of each of ten steps.
    """

    calibration: Path | None = None

    def __init__(self, results: Path, deliver: "Deliver | None" = None, step_seconds: float = 0.0) -> None:
        self._results = results
        self._deliver = deliver or deliver_made_up
        self._board = StateBoard()
        self._step_seconds = step_seconds
        self._stopped = threading.Event()
        self._connected = self._homed = False
        self.door_open = self.alarm = False
        self.lost_camera: int | None = None
        self.next_problem: str | None = None
        self.words_of_camera = "streams 18.2 frames a second"
        self.pause: set[str] = set()
        self.go, self.reached = threading.Event(), threading.Event()
        self.calls: list[str] = []
        self.lit = False
        self._filmed = 0
        self._jpeg = {True: stripe_jpeg(True), False: stripe_jpeg(False)}

    @property
    def state(self) -> ScannerState:
        state = self._board.state
        if self.alarm:
            return ScannerState("alarm", "a head ran onto an end switch; home the heads again (alarm 1)")
        if self.door_open:
            return ScannerState("door open", "the lid or door is open: heads and lasers are stopped", state.progress)
        if not self._connected:
            return ScannerState("disconnected", state.words if state.name == "disconnected" else "")
        return state

    def listen(self, listener: OnState) -> Callable[[], None]:
        return self._board.listen(listener)

    def tell_again(self) -> None:
        """As a board does when its door opens."""
        self._board.progress(self._board.state.progress or 0.0)

    def health(self) -> Health:
        if not self._connected:
            words = "not connected", "check its USB cable and its power, then connect"
            return Health([Device("Controller", "bad", *words)], CAMERAS)
        devices = [Device("Controller", "ok", "the heads stand" if self._homed else "ready; heads not homed")]
        unknown = "warning", "position unknown", "home the heads"
        devices += [Device(f"Head {n}", *(("ok", "at X = -18.0 mm") if self._homed else unknown)) for n in (1, 2, 3)]
        for camera in CAMERAS:
            if camera == self.lost_camera:
                words = (
                    f"camera {camera}: connection lost (Input/output error)",
                    "check its cable and hub, then connect",
                )
                devices.append(Device(f"Camera {camera}", "bad", *words))
            else:
                devices.append(Device(f"Camera {camera}", "ok", self.words_of_camera))
        devices.append(Device("Passes", "ok", "All 8 cameras in one pass: bus usb1 carries 82 of 100 us."))
        devices.append(Device("Disk", "ok", "231.4 GB are free for scans"))
        frames = {} if self.lost_camera else dict.fromkeys(CAMERAS, 20 * self._filmed)
        return Health(devices, CAMERAS, frames, resumable=self.door_open)

    @property
    def finds_stripes(self) -> bool:
        return True

    def picture(self, camera: int) -> bytes | None:
        is_there = self._connected and camera in CAMERAS and camera != self.lost_camera
        return self._jpeg[self.lit] if is_there else None

    def connect(self) -> None:
        self._note("connect")
        with self._board.at_work("disconnected", "connecting"):
            self._wait("connect")
            self._connected, self.lost_camera = True, None
            self._board.tell("idle")

    def home(self) -> None:
        self._note("home")
        with self._board.at_work("homing", "the heads look for their home switches"):
            self._wait("homing")
            self.alarm, self._homed = False, True
            self._board.tell("idle")

    def jog(self, by_mm: float, head: int | None) -> None:
        self._note(f"jog {by_mm:g} {head}")

    def shine(self) -> None:
        self._note("shine")
        with self._board.at_work("idle", "the stripe is shown"):
            self.lit = True
            self._wait("shine")
            self.lit = False

    def film(
        self,
        patient: str,
        side: Side,
        *,
        posture: Posture = "unknown",
        keep_partial: bool,
        on_shown: Callable[[Scanned], None] = lambda _: None,
    ) -> Scanned:
        self._note(f"film {patient} {side} {posture} {keep_partial}")
        self._stopped.clear()
        with self._board.at_work("filming", "pass 1 of 1"):
            self.lit = True
            try:
                self._film()
            finally:
                self.lit = False
            self._homed = True
            self._board.tell("storing")
            name = self._name(patient, side)
            self._board.tell("reconstructing", progress=0.4)
            self._wait("reconstructing")
            folder = self._results / patient / name
            folder.mkdir(parents=True)
            self._deliver(folder, side, posture)
            on_shown(Scanned(patient, name, side))
            self._wait("reporting")
            self._board.tell("done", str(folder))
            return Scanned(patient, name, side)

    def resume(self) -> None:
        self._note("resume")
        self.door_open = False
        self.tell_again()

    def stop(self) -> None:
        self._note("stop")
        self.lit = False
        self._stopped.set()

    def close(self) -> None:
        self._note("close")
        self.lit = self._connected = False

    def _film(self) -> None:
        for step in range(10):
            self._filmed = step
            self._board.progress(step / 10)
            if step == 4:
                self._wait("filming")
            while self.door_open and not self._stopped.wait(0.02):
                pass
            if self._stopped.wait(self._step_seconds):
                raise Fault("stopped; nothing of this scan is kept")
            if (problem := self.next_problem) is not None:
                self.next_problem = None
                raise Fault(problem)

    def _name(self, patient: str, side: Side) -> str:
        names = [f"2026-11-20-{side[0].upper()}", *(f"2026-11-20-{side[0].upper()}-{n}" for n in range(2, 99))]
        return next(name for name in names if not (self._results / patient / name).exists())

    def _wait(self, activity: str) -> None:
        if activity not in self.pause:
            return
        self.reached.set()
        for _ in range(int(GENEROUS_SECONDS / 0.02)):
            if self.go.wait(0.02) or self._stopped.is_set():
                break
        else:
            raise Fault("the test forgot to go on")
        self.go.clear()
        self.reached.clear()

    def _note(self, call: str) -> None:
        self.calls.append(call)
        if self.lit and call.startswith("film"):
            raise RefusedInput("stand-in", "is filming already")


def stripe_jpeg(lit: bool) -> bytes:
    """A dim room, and a red stripe across it where there is light."""
    j, i = np.mgrid[0:480, 0:640].astype(np.float64)
    light = 210.0 * np.exp(-0.5 * ((j - 240.0 - 60.0 * np.sin(i / 130.0)) / 2.2) ** 2) * lit
    image = np.clip(light[..., None] * [1.0, 0.12, 0.1] + 26.0, 0, 255).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(image, 90, "RGB", "420"))


def deliver_made_up(folder: Path, side: Side, posture: Posture = "unknown") -> None:
    """Write the results of a scan of an egg instead of a foot."""
    egg = trimesh.creation.icosphere(subdivisions=3)
    vertices = np.asarray(egg.vertices) * [130.0, 48.0, 40.0] + [200.0, 0.0, 40.0]
    mesh = Mesh(vertices, np.asarray(egg.faces, np.int32), camera=np.full(len(vertices), 3, np.uint8))
    (folder / "foot.ply").write_bytes(ply_of(mesh))
    (folder / "measures.json").write_text(json.dumps(measures_of(side) | {"posture": posture}))
    (folder / "quality.json").write_text(json.dumps(quality_of()))
    (folder / "report.html").write_text("<!DOCTYPE html><title>report</title><p>whole report")

"""A stand-in of a scanner that films standing objects: it shows frames of a recorded capture."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import simplejpeg

from footscan.calibration.travel.body import Body
from footscan.frames.film import open_film
from pipelines.live.calibrating.stills import Stills
from pipelines.live.light import ScanLight
from pipelines.recordings.captures import RecordedCapture, read_capture
from schemas.base.errors import Fault
from schemas.rig import Rig, RigCamera

DARK = bytes(simplejpeg.encode_jpeg(np.full((480, 640, 3), 20, np.uint8), 90, "RGB", "420"))


class StandingStandIn:
    """A `StandingScanner` on whose glass the object stands as in placement `standing` of a capture."""

    def __init__(self, capture: Path) -> None:
        self.capture: RecordedCapture = read_capture(capture)
        self.rig = Rig(
            format="footscan.rig/1",
            scanner="S1",
            port="none",
            cameras=[RigCamera(id=camera.id, device=f"camera {camera.id}") for camera in self.capture.document.cameras],
        )
        self._films = {
            camera.id: list(open_film(self.capture.film(camera)).stored()) for camera in self.capture.document.cameras
        }
        self.standing: int | None = None
        self.later: int | None = None
        """The placement in the later frame, where the object is moved meanwhile."""
        self.covered: set[int] = set()
        """Cameras that see nothing."""
        self.silent: set[int] = set()
        """Cameras that give no frame."""
        self.swapped: dict[int, int] = {}
        """Cameras that show the picture of another one."""
        self.fault: str | None = None
        self.lights: list[ScanLight | None] = []
        self.busy: list[str] = []

    def stills(self, light: ScanLight | None) -> Stills:
        if self.fault is not None:
            fault, self.fault = self.fault, None
            raise Fault(fault)
        self.lights.append(light)
        later = self.standing if self.later is None else self.later
        frames = {
            camera: (self._frame(camera, self.standing), self._frame(camera, later))
            for camera in self._films
            if camera not in self.silent
        }
        problems = {camera: f"camera {camera}: connection lost" for camera in self.silent}
        return Stills(frames, ScanLight(1.0, is_measured=True), problems)

    def film_body(self, place: Path, _body: Body, _light: ScanLight | None) -> None:
        raise Fault(f"{place}: no heads here")

    @contextmanager
    def waiting_for(self, words: str) -> Iterator[None]:
        self.busy.append(words)
        yield

    def put(self, subject: str) -> None:
        """Puts `reference K` onto the glass."""
        self.standing = int(subject.removeprefix("reference "))

    def _frame(self, camera: int, placement: int | None) -> bytes:
        if placement is None or camera in self.covered:
            return DARK
        frame = self._films[self.swapped.get(camera, camera)][placement]
        assert isinstance(frame, bytes)
        return frame

"""A scan into the archive while it is filmed: there as a whole, or not at all.

Frames go straight from the cameras into the Zarr arrays of a hidden folder beside the scan's place, bit for bit, by a
thread of its own: a disk that hesitates delays no camera. Only what is whole, and safely on the disk, gets the scan's
name; what a killed process left is removed by the next recording.
"""

import os
import queue
import shutil
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import yaml

from footscan.frames.ingest import FRAME_SIZE, FrameWriter, make_group
from footscan.frames.partial import partial_folder, sweep
from schemas.base.errors import Fault, RefusedInput
from schemas.frames import GROUP, FrameManifest
from schemas.scan import Scan

WAITING_FRAMES = 400
"""On their way to the disk, at most: 10 MB, or what eight cameras send in three seconds."""
SPARE = 1.3
"""So much of the expected size must be free: JPEG pictures of a bright room are larger."""
LEAST_FREE_BYTES = 50_000_000
"""A disk with less is taken for full: others write to it too."""
FRAMES_A_LOOK = 100
SETTLE_SECONDS = 120.0


class ScanRecording:
    """A scan under way; a context manager, whose end without `finish` leaves nothing."""

    def __init__(self, place: Path, expected_bytes: int) -> None:
        """Opens the recording.

        Parameters
        ----------
        place : `ARCHIVE/PATIENT/SCAN`, where there is nothing yet.
        expected_bytes : size of all frames, as far as it can be known.

        Raises
        ------
        RefusedInput
            There is something at `place`.
        Fault
            Too little space, or the archive cannot be written to.
        """
        self.place = place
        self._writers: dict[str, FrameWriter] = {}
        self._waiting: queue.Queue[tuple[str, int, bytes] | None] = queue.Queue(WAITING_FRAMES)
        self._problem: Fault | None = None
        self._taken = 0
        self._settled = threading.Condition()
        if place.exists():
            raise RefusedInput(place, "is there already, expected another name for a new scan")
        self._partial = partial_folder(place.parent, place.name)
        self._made = [folder for folder in (place.parent, place.parent.parent) if not folder.exists()]
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            for patient in place.parent.parent.iterdir():
                if patient.is_dir():
                    sweep(patient)
            shutil.rmtree(self._partial, ignore_errors=True)
            (self._partial / GROUP).mkdir(parents=True)
            self._check_space(round(SPARE * expected_bytes))
        except OSError as error:
            self._remove()
            raise self._refused_by_disk(error) from None
        except Fault:
            self._remove()
            raise
        self._thread = threading.Thread(target=self._write_waiting, name="recording", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the thread, and removes what is not finished."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()
        self._remove()

    def open_film(self, name: str) -> None:
        """Begins a film, `cam1` or `cam1-background`."""
        try:
            self._writers[name] = FrameWriter(self._partial / GROUP / name)
        except OSError as error:
            raise self._refused_by_disk(error) from None

    def take(self, name: str, arrival: int, jpeg: bytes) -> None:
        """A frame of the film `name`, by its place in the order of arrival; from any thread, and at once.

        Raises
        ------
        queue.Full
            Too many frames wait for the disk, or it has failed: this one is lost. `check` tells why.
        """
        if self._problem is not None:
            raise queue.Full
        with self._settled:
            self._waiting.put_nowait((name, arrival, jpeg))
            self._taken += 1

    def check(self) -> None:
        """Fault where the disk has failed, or is full; then the recording cannot be finished."""
        if self._problem is not None:
            raise self._problem

    def settle(self) -> None:
        """Waits until all frames that were taken are written; errors as in `check`."""
        with self._settled:
            done = self._settled.wait_for(lambda: not self._taken or self._problem, SETTLE_SECONDS)
        self.check()
        if not done:
            raise Fault(f"{self.place}: frames wait for the disk since {SETTLE_SECONDS:g} s: it does not keep up")

    def close_film(self, name: str, frames: Mapping[int, int], count: int) -> FrameManifest:
        """Makes a film of so many frames of what was taken; to be called once all is settled.

        Parameters
        ----------
        frames : the arrival that frame k of the film is, k being 0 to `count` - 1. Arrivals that are not named are
            removed, frames without one are lost.
        """
        self.check()
        writer = self._writers.pop(name)
        try:
            writer.renumber(frames)
            return writer.finish(count, FRAME_SIZE, None)
        except OSError as error:
            raise self._refused_by_disk(error) from None

    def drop_film(self, name: str) -> None:
        """Takes a film back."""
        del self._writers[name]
        shutil.rmtree(self._partial / GROUP / name, ignore_errors=True)

    def file(self, name: str) -> Path:
        """Where to write another file of the scan."""
        return self._partial / name

    def finish(self, scan: Scan) -> Path:
        """Gives the scan its place, once all of it is on the disk; returns that.

        Raises
        ------
        Fault
            It could not be written, or somebody else has put something there meanwhile. Nothing of it is left.
        """
        self.check()
        if self._writers:
            raise RefusedInput(self.place, f"expected all films to be closed, found {', '.join(self._writers)}")
        try:
            make_group(self._partial / GROUP)
            _sync(self._partial)
            document = scan.model_dump(mode="json", exclude_none=True)
            text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
            self.file("scan.yaml").write_text(text, encoding="utf-8")  # last: nothing without it is a scan
            _sync_one(self.file("scan.yaml"))
            self._partial.rename(self.place)
            _sync_one(self.place)
            _sync_one(self.place.parent)
        except OSError as error:
            raise self._refused_by_disk(error) from None
        return self.place

    def _write_waiting(self) -> None:
        written = 0
        while (frame := self._waiting.get()) is not None:
            name, arrival, jpeg = frame
            try:
                if self._problem is None and name in self._writers:
                    self._writers[name].add(arrival, jpeg)
                    written += 1
                    if written % FRAMES_A_LOOK == 0:
                        self._check_space(0)
            except OSError as error:
                self._problem = self._refused_by_disk(error)
            except Fault as fault:
                self._problem = fault
            with self._settled:
                self._taken -= 1
                self._settled.notify_all()

    def _check_space(self, needed: int) -> None:
        free = shutil.disk_usage(self._partial).free
        if free < needed + LEAST_FREE_BYTES:
            expected = (needed + LEAST_FREE_BYTES) / 1e6
            raise Fault(f"{self.place}: {free / 1e6:.0f} MB are free there, expected {expected:.0f} MB: make room")

    def _refused_by_disk(self, error: OSError) -> Fault:
        return Fault(f"{self.place}: cannot be written ({error.strerror or error})")

    def _remove(self) -> None:
        shutil.rmtree(self._partial, ignore_errors=True)
        for folder in self._made:
            with suppress(OSError):  # it has other scans by now
                folder.rmdir()


def _sync(folder: Path) -> None:
    """Everything in a folder onto the disk, a folder after what is in it."""
    for parent, _, files in os.walk(folder, topdown=False):
        for name in files:
            _sync_one(Path(parent, name))
        _sync_one(Path(parent))


def _sync_one(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

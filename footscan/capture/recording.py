"""Records a scan into the archive while it is filmed: as a whole, or not at all.

A separate thread writes the frames bit for bit into the Zarr arrays of a hidden folder beside the scan's place: a slow
disk delays no camera. Only a complete scan, synced to the disk, gets the scan's name; the next recording removes the
remains of a killed process.
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

from footscan.frames.ingest import FrameWriter, make_group
from footscan.frames.partial import partial_folder, sweep
from schemas.base.errors import Fault, RefusedInput
from schemas.base.image_size import FRAME_SIZE
from schemas.frames import GROUP, FrameManifest
from schemas.scan import Scan

WAITING_FRAMES = 400
"""Most frames that wait for the disk, a bound of memory: 10 MB, the frames of eight cameras in three
seconds."""
SPARE = 1.3
"""Free space needed, as a multiple of the expected size: JPEG pictures of a bright room are larger. Chosen by hand."""
LEAST_FREE_BYTES = 50_000_000
"""A disk with less is taken for full: other programs write to it too. Chosen by hand."""
FRAMES_A_LOOK = 100
"""Frames between two checks of the free space. Chosen by hand."""
SETTLE_SECONDS = 120.0
"""Longest wait for the disk at the end of a pass. Chosen by hand."""


class ScanRecording:
    """A scan in progress; a context manager, which leaves nothing if it ends without `finish`."""

    def __init__(self, place: Path, expected_bytes: int) -> None:
        """Open the recording.

        Parameters
        ----------
        place : `ARCHIVE/PATIENT/SCAN`, which must not exist.
        expected_bytes : size of all frames, as far as it can be known.

        Raises
        ------
        RefusedInput
            `place` exists.
        Fault
            The space is too small, or the archive is not writable.
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
        """End the thread, and remove an unfinished scan."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()
        self._remove()

    @property
    def folder(self) -> Path:
        """The folder of the scan until it has its name."""
        return self._partial

    def open_film(self, name: str) -> None:
        """Begin a film, `cam1` or `cam1-background`."""
        try:
            self._writers[name] = FrameWriter(self._partial / GROUP / name)
        except OSError as error:
            raise self._refused_by_disk(error) from None

    def take(self, name: str, arrival: int, jpeg: bytes) -> None:
        """Add a frame to the film `name`, by its number in the order of arrival; from any thread, without waiting.

        Raises
        ------
        queue.Full
            Too many frames wait for the disk, or the disk has failed: this frame is lost. `check` raises the reason.
        """
        if self._problem is not None:
            raise queue.Full
        with self._settled:
            self._waiting.put_nowait((name, arrival, jpeg))
            self._taken += 1

    def check(self) -> None:
        """Raise Fault if the disk has failed or is full; then the recording cannot be finished."""
        if self._problem is not None:
            raise self._problem

    def settle(self) -> None:
        """Wait until all frames are written; errors as in `check`."""
        with self._settled:
            done = self._settled.wait_for(lambda: not self._taken or self._problem, SETTLE_SECONDS)
        self.check()
        if not done:
            raise Fault(f"{self.place}: frames wait for the disk since {SETTLE_SECONDS:g} s: it does not keep up")

    def close_film(self, name: str, frames: Mapping[int, int], count: int) -> FrameManifest:
        """Complete a film with `count` frames; call `settle` before.

        Parameters
        ----------
        frames : arrival number of each frame k of the film, 0 <= k < `count`. Other arrivals are removed; a frame
            without an arrival is lost.
        """
        self.check()
        writer = self._writers.pop(name)
        try:
            writer.renumber(frames)
            return writer.finish(count, FRAME_SIZE)
        except OSError as error:
            raise self._refused_by_disk(error) from None

    def drop_film(self, name: str) -> None:
        """Remove a film."""
        del self._writers[name]
        shutil.rmtree(self._partial / GROUP / name, ignore_errors=True)

    def file(self, name: str) -> Path:
        """Returns the path for another file of the scan."""
        return self._partial / name

    def finish(self, scan: Scan) -> Path:
        """Sync the scan to the disk, move it to its place and return that.

        Raises
        ------
        Fault
            The scan cannot be written, or its place was taken meanwhile. Nothing of it is left.
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
            with suppress(OSError):  # it may hold other scans by now
                folder.rmdir()


def _sync(folder: Path) -> None:
    """Sync everything in a folder to the disk, each folder after its contents."""
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

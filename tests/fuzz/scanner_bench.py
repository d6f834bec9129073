"""A scanner of one board and eight cameras in this process, which film plain pictures, dark or lit, each with the
number of its exposure in it: what a scan holds can be compared with what was really so."""

import datetime
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from footscan.capture.film_frames import FilmFrames
from footscan.capture.grbl.settings import required_settings
from footscan.frames.film import open_film
from footscan.frames.travel import read_positions
from footscan.recordings.scans import read_scan
from footscan.virtual.board.board import Board
from footscan.virtual.filming.streams import SentFrame, VirtualStreams, free_running
from pipelines.live.light import light_by_hand
from pipelines.live.scan_order import LiveResult, ScanOrder
from pipelines.live.scanner import LiveScanner
from pipelines.live.storing import ScanName, next_scan_name
from schemas.base.json_files import read_json
from schemas.recording import RecordedCamera, Recording
from schemas.rig import Rig, RigBoard, RigCamera, RigLatency, RigTravel

CAMERAS = range(1, 9)
RATE = 10.0
LATENCY_S = 0.04
START_MM, LENGTH_MM, MM_PER_S = 0.0, 20.0, 10.0
STEP_MM = MM_PER_S / RATE
SETTINGS = RigBoard(
    max_mm_per_s=(400.0, 400.0, 400.0),
    mm_per_s2=(8000.0, 8000.0, 8000.0),
    homing_mm_per_s=400.0,
    homing_slow_mm_per_s=80.0,
)
QUICK = {**required_settings(SETTINGS), 26: 2}
"""A board that takes no time to speed up and to home."""
DAY = datetime.date(2026, 11, 20)
NUMBER = re.compile(rb"\xff\xfe..exposure (\d+)", re.DOTALL)
SIGMAS = 4.0
LOOKS_SECONDS = 0.01
MOST_DARK = 0.05
"""Share of a film's pictures: heads that are held stand in the dark once."""


def _picture(light: int) -> bytes:
    noise = np.random.default_rng(1).integers(0, 30, (480, 640, 3))
    return bytes(simplejpeg.encode_jpeg((light + noise).astype(np.uint8), 50, "RGB", "420"))


DARK, LIT = _picture(10), _picture(180)


@dataclass
class Bench:
    """A scanner, its world, and where its scans go."""

    scanner: LiveScanner
    board: Board
    streams: VirtualStreams
    archive: Path

    def order(self) -> ScanOrder:
        """The next scan."""
        scan = next_scan_name(self.archive, "P7", "right", DAY)
        light = light_by_hand(self.scanner.rig, 1.0, 10.0)
        return ScanOrder(ScanName("P7", scan, "right", DAY), self.archive, light=light)

    def is_dark_and_still(self) -> bool:
        """Whether light and motion have ended."""
        return self.board.laser_at(time.monotonic()) == 0.0 and not self.board.motion.is_moving

    def brightest_since(self, seconds: float) -> float:
        """The lasers' greatest power since then."""
        return max(self.board.laser_at(at) for at in np.arange(seconds, time.monotonic(), 0.001))

    def in_archive(self) -> set[str]:
        """Names of all that lies where scans lie, hidden or not."""
        return {place.name for place in self.archive.glob("*/*")} | {place.name for place in self.archive.glob("*/.*")}

    def check_scan(self, result: LiveResult, since: float) -> int:
        """A scan that began at `since` is whole, as it really was; how many frames of it are told to be lost."""
        scan = read_scan(result.stored.place)
        recording = read_json(scan.folder / "recording.json", Recording)
        assert [camera.id for camera in scan.document.cameras] == list(CAMERAS)
        for camera, told in zip(scan.document.cameras, recording.cameras, strict=True):
            frames = list(open_film(scan.film(camera)).stored())
            x_mm = read_positions(scan.folder / str(camera.positions))
            film = result.stored.films[camera.id]
            lost = [k for k, frame in enumerate(frames) if frame is None]
            assert [int(film.number[k]) for k in lost] == [one.number for one in told.lost]
            assert len(frames) == len(x_mm) == told.stored + len(lost)
            check_pictures([frame for frame in frames if frame is not None])
            exposures = [None if frame is None else exposure_of(frame) for frame in frames]
            self._check_places(told, exposures, x_mm, film, since)
        return sum(len(told.lost) for told in recording.cameras)

    def _check_places(
        self,
        told: RecordedCamera,
        exposures: Sequence[int | None],
        x_mm: NDArray[np.float64],
        film: FilmFrames,
        since: float,
    ) -> None:
        """Each frame is where it was taken, and what was taken on the way and is not there is told."""
        record = self.streams.sent(told.id)
        stored = {k: exposure for k, exposure in enumerate(exposures) if exposure is not None}
        for k, exposure in stored.items():
            off = abs(x_mm[k] - self.board.position_at(record[exposure].exposed)[told.head - 1])
            assert off <= max(SIGMAS * film.sd_mm[k], STEP_MM / 2), f"camera {told.id}: frame {k} is {off:.2f} mm off"
        ahead = {exposure - int(film.number[k]) for k, exposure in stored.items()}
        known = {*stored.values(), *(one.number + by for one in [*told.lost, *told.left_out] for by in ahead)}
        margin = max(SIGMAS * float(film.sd_mm.max()), STEP_MM)
        untold = self._exposed_on_the_way(record, told.head, since, margin) - known
        assert not untold, f"camera {told.id}: exposures {sorted(untold)} are not told of"

    def _exposed_on_the_way(self, record: Sequence[SentFrame], head: int, since: float, margin_mm: float) -> set[int]:
        lit = [one.exposed for one in record if one.exposed > since and self.board.laser_at(one.exposed)]
        low, high = START_MM + margin_mm, START_MM + LENGTH_MM - margin_mm
        return {
            one.number
            for one in record
            if lit[0] <= one.exposed <= lit[-1] and low < self.board.position_at(one.exposed)[head - 1] < high
        }


def check_pictures(frames: Sequence[bytes]) -> None:
    """All are as they were taken, and all but a few of a held head with the lasers on."""
    pictures = Counter(NUMBER.sub(b"", frame, count=1) for frame in frames)
    assert pictures.keys() <= {LIT, DARK}, "a picture is damaged"
    assert pictures[DARK] <= MOST_DARK * len(frames), f"{pictures[DARK]} of {len(frames)} pictures are dark"


def exposure_of(frame: bytes) -> int:
    """The number of a frame's exposure on its camera's own clock."""
    found = NUMBER.search(frame)
    assert found is not None
    return int(found[1])


class HostWatch(threading.Thread):
    """How long this computer lets a thread wait that wants to go on: frames are timed by it."""

    def __init__(self) -> None:
        super().__init__(name="host watch", daemon=True)
        self.longest_s = 0.0
        self._ends = threading.Event()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self.join()

    def run(self) -> None:
        before = time.monotonic()
        while not self._ends.wait(LOOKS_SECONDS):
            now = time.monotonic()
            self.longest_s = max(self.longest_s, now - before - LOOKS_SECONDS)
            before = now


@contextmanager
def open_bench(archive: Path) -> Iterator[Bench]:
    """A bench with everything connected."""
    with Board(settings=QUICK, heads_at=(-6.0, -4.0, -8.0)) as board:

        def picture(_: int, seconds: float) -> bytes:
            return LIT if board.laser_at(seconds) else DARK

        with VirtualStreams(CAMERAS, picture, free_running(RATE), latency_s=LATENCY_S) as streams:
            latency = RigLatency(seconds=LATENCY_S, sd_s=0.002, frame_sd_s=0.002)
            rig = Rig(
                format="footscan.rig/1",
                scanner="bench",
                port=board.port,
                cameras=[RigCamera(id=camera, device=streams.url(camera), latency=latency) for camera in CAMERAS],
                travel=RigTravel(start_mm=START_MM, length_mm=LENGTH_MM, mm_per_s=MM_PER_S),
                frames_per_second=RATE,
            )
            with LiveScanner(rig) as scanner:
                assert scanner.connect() == {}
                yield Bench(scanner, board, streams, archive)

"""A pass with a virtual board and virtual cameras: every stored picture is at the place where it was taken, or lost."""

import queue
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from footscan.capture import frame_positions
from footscan.capture.board.heads import Heads
from footscan.capture.cameras.deck import CameraDeck
from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.stream import CapturedFrame
from footscan.capture.film_frames import CameraTiming, FilmFrames, motion_of_head, place_frames, standing_frame
from footscan.capture.frame_positions import Timed
from footscan.capture.passes import FilmedPass, PassPlan, film_name, film_pass
from footscan.capture.recording import ScanRecording
from footscan.virtual.board.board import Board
from footscan.virtual.filming.stream_faults import StreamFault
from footscan.virtual.filming.streams import SentFrame, VirtualStreams, free_running
from schemas.base.errors import Fault
from schemas.rig import RigBoard
from tests.helpers.stored_frames import frame_bytes

pytestmark = pytest.mark.real_time  # cameras stream while heads move

QUICK = {24: 1200, 25: 12000, 26: 5, 110: 12000, 111: 12000, 112: 12000, 120: 2000, 121: 2000, 122: 2000}
SETTINGS = RigBoard(
    homing_mm_per_s=200.0, homing_slow_mm_per_s=20.0, max_mm_per_s=(200.0,) * 3, mm_per_s2=(2000.0,) * 3
)
CAMERAS = (1, 3, 5)
HEAD_OF = {1: 1, 3: 2, 5: 3}
LATENCIES = {1: 0.02, 3: 0.05, 5: 0.08}
RATE = 40.0
LARGEST_SD_MM = 2.0
"""A host that others keep busy times reports and frames badly, and says so."""
PLAN = PassPlan(50.0, 250.0, 60.0, 1.0)


@cache
def picture() -> bytes:
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(noise, 20, "RGB", "420"))


@pytest.fixture(autouse=True)
def _busy_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_positions, "LARGEST_SD_MM", LARGEST_SD_MM)


@dataclass
class Bench:
    """A scanner whose truth is known."""

    board: Board
    streams: VirtualStreams
    heads: Heads
    deck: CameraDeck
    recording: ScanRecording

    def film(self, plan: PassPlan = PLAN) -> FilmedPass:
        for camera in CAMERAS:
            self.recording.open_film(film_name(camera))
            self.recording.open_film(film_name(camera, background=True))
        filmed = film_pass(self.heads, self.deck, CAMERAS, plan, self.take, self.recording.check)
        self.recording.settle()
        return filmed

    def take(self, name: str, frame: CapturedFrame) -> None:
        self.recording.take(name, frame.arrival, frame.jpeg)

    def placed(self, filmed: FilmedPass, camera: int) -> FilmFrames:
        motion = motion_of_head(self.heads.log, HEAD_OF[camera], filmed.travel)
        tally = filmed.films[film_name(camera)]
        return place_frames(
            tally, filmed.times[camera], filmed.travel, motion, timing(camera), (50.0, 250.0), LARGEST_SD_MM
        )

    def stored(self, camera: int, film: FilmFrames, *, background: bool = False) -> dict[int, SentFrame]:
        """What the camera says of the picture that is stored as each frame."""
        name = film_name(camera, background=background)
        self.recording.close_film(name, film.arrivals, len(film.x_mm))
        sent = {frame.number: frame for frame in self.streams.sent(camera)}
        folder = self.recording.file("frames.zarr") / name
        return {k: sent[exposure_of(frame_bytes(folder, k))] for k in film.arrivals}


def timing(camera: int) -> CameraTiming:
    return CameraTiming(Timed(LATENCIES[camera], 0.001), 0.0, 0.001)


def exposure_of(jpeg: bytes) -> int:
    found = re.search(rb"exposure (\d+)", jpeg)
    assert found
    return int(found[1])


@contextmanager
def bench(tmp_path: Path, faults: Mapping[int, Sequence[StreamFault]] | None = None) -> Iterator[Bench]:
    with ExitStack() as stack:
        board = stack.enter_context(Board(settings=QUICK))
        streams = stack.enter_context(
            VirtualStreams(
                CAMERAS, lambda *_: picture(), free_running(RATE), latency_s=LATENCIES, jitter_s=0.002, faults=faults
            )
        )
        sources = {camera: CameraSource(streams.url(camera), frames_per_second=RATE) for camera in CAMERAS}
        deck = stack.enter_context(CameraDeck(sources))
        heads = stack.enter_context(Heads(board.port, SETTINGS))
        recording = stack.enter_context(ScanRecording(tmp_path / "archive/P1/S1", 1000))
        assert deck.open_only(CAMERAS) == {}
        heads.home()
        yield Bench(board, streams, heads, deck, recording)


def test_every_picture_is_where_it_was_taken(tmp_path: Path) -> None:
    with bench(tmp_path) as one:
        filmed = one.film()
        assert filmed.failed == {}
        for camera in CAMERAS:
            film = one.placed(filmed, camera)
            assert film.problem is None
            assert film.lost == {}
            assert len(film.x_mm) == pytest.approx(200.0 / 60.0 * RATE, abs=3)
            true = np.array(
                [one.board.position_at(s.exposed)[HEAD_OF[camera] - 1] for s in one.stored(camera, film).values()]
            )
            errors = np.abs(film.x_mm - true)
            # Where the host is slow to look, reports and frames are timed worse, and the film's own figures say so.
            assert np.all(errors < 0.1 + 5 * film.sd_mm)
            assert np.median(errors) < 0.3
            dark = standing_frame(
                filmed.films[film_name(camera, background=True)], filmed.times[camera], timing(camera), filmed.before
            )
            assert dark is not None
        assert one.board.laser_at(time.monotonic()) == 0.0


def test_lost_and_torn_frames_leave_their_places_empty(tmp_path: Path) -> None:
    # At 40 frames a second homing and the dark take up to some seconds: what goes wrong later is within the travel.
    kinds = ("drop", "tear", "repeat")
    faults = {
        camera: [StreamFault(kind, first, 1) for first in range(0, 4000, 50)]
        for camera, kind in zip(CAMERAS, kinds, strict=True)
    }
    with bench(tmp_path, faults) as one:
        filmed = one.film()
        for camera, kind in zip(CAMERAS, kinds, strict=True):
            film = one.placed(filmed, camera)
            assert film.problem is None
            assert 1 <= len(film.lost) <= 4
            word = {"drop": "dropped", "tear": "torn", "repeat": "repeated"}[kind]
            assert all(word in reason for reason in film.lost.values())
            stored = one.stored(camera, film)
            places = sorted(stored)
            numbers = np.array([stored[k].number for k in places])
            assert np.array_equal(numbers - numbers[0], np.array(places) - places[0]), "a lost frame keeps its number"
            assert all(frame.fault is None for frame in stored.values())


def test_a_camera_that_is_lost_on_the_way_is_told(tmp_path: Path) -> None:
    with bench(tmp_path) as one:
        plan = PassPlan(50.0, 250.0, 60.0, 1.0)
        stop = one.streams._cameras[3]

        def cut(_: str, frame: CapturedFrame) -> None:
            if frame.camera == 1:
                stop._cut(True)

        for camera in CAMERAS:
            one.recording.open_film(film_name(camera))
        filmed = film_pass(one.heads, one.deck, CAMERAS, plan, cut, one.recording.check)
        assert set(filmed.failed) == {3}


def test_a_camera_most_of_whose_frames_come_late_is_told(tmp_path: Path) -> None:
    late = [StreamFault("stall", first, 3) for first in range(0, 4000, 4)]  # one of four waits for two more
    with bench(tmp_path, {1: late}) as one:
        filmed = one.film()
        assert re.search(r"^\d+ of \d+ frames came late", filmed.failed[1])


def test_on_the_way_back_the_same_places_are_filmed_in_the_dark(tmp_path: Path) -> None:
    with bench(tmp_path) as one:
        filmed = one.film(PassPlan(50.0, 250.0, 100.0, 1.0, dark_return=True))
        assert filmed.back is not None
        motion = motion_of_head(one.heads.log, 1, filmed.back)
        tally = filmed.films[film_name(1, background=True)]
        dark = place_frames(tally, filmed.times[1], filmed.back, motion, timing(1), (50.0, 250.0), LARGEST_SD_MM)
        assert dark.problem is None
        assert dark.mm_per_s == pytest.approx(-100.0, abs=5.0)
        for frame in one.stored(1, dark, background=True).values():
            assert one.board.laser_at(frame.exposed) == 0.0


def test_a_fault_on_the_way_ends_the_pass_in_the_dark(tmp_path: Path) -> None:
    with bench(tmp_path) as one:

        def full(_: str, frame: CapturedFrame) -> None:
            if frame.camera == 1:
                one.board.stick(2)
            raise queue.Full

        def check() -> None:
            raise Fault("the disk is full")

        with pytest.raises(Fault):
            film_pass(one.heads, one.deck, CAMERAS, PLAN, full, check)
        assert one.board.laser_at(time.monotonic()) == 0.0

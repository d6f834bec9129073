"""A live scanner with a virtual board and cameras that film a made-up foot."""

import datetime
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import quick_rig
import simplejpeg

from footscan.frames.film import open_film
from footscan.virtual.board.board import Board
from footscan.virtual.filming.streams import VirtualStreams, free_running
from pipelines.live.light import light_by_hand
from pipelines.live.scan_order import ScanOrder
from pipelines.live.scanner import LiveScanner
from pipelines.live.storing import ScanName, next_scan_name
from schemas.rig import Rig, RigCamera, RigHead, RigLatency, RigTravel

DARK = bytes(simplejpeg.encode_jpeg(np.full((480, 640, 3), 20, np.uint8), 90, "RGB", "420"))
DAY = datetime.date(2026, 11, 20)
RATE = 20.0
LATENCY_S = 0.04
LENGTH_MM = 110.0
"""Of the travel: part of a foot, but where it is measured."""
FOOT_MM = 190.0
STEP_MM = 10.0
"""Spacing of the pictures of the made-up foot."""


@dataclass
class Bench:
    """A scanner, its world, and the folder of its scans."""

    scanner: LiveScanner
    board: Board
    streams: VirtualStreams
    home: Path
    states: list[str]

    def order(self, **changes: Any) -> ScanOrder:
        scan = next_scan_name(self.home / "archive", "P7", "right", DAY)
        order = ScanOrder(
            ScanName("P7", scan, "right", DAY, "sitting"),
            self.home / "archive",
            light=light_by_hand(self.scanner.rig, 1.0, 10.0),
        )
        return replace(order, **changes)

    def assert_dark_and_empty(self) -> None:
        assert self.board.laser_at(time.monotonic()) == 0.0
        assert not (self.home / "archive").exists()


THREE_HEADS = (RigHead(), RigHead(), RigHead())
TWO_CAMERAS = {1: 1, 5: 3}


@contextmanager
def open_bench(
    pristine: Path, home: Path, heads: tuple[RigHead, ...] = THREE_HEADS, on_head: Mapping[int, int] = TWO_CAMERAS
) -> Iterator[Bench]:
    """A scanner with these heads; `on_head` has the head of each camera."""
    films = {}
    for camera in (1, 5):
        film = open_film(pristine / f"archive/P0001/S1/cam{camera}.avi")
        films[camera] = [frame if isinstance(frame, bytes) else b"" for frame in film.stored()]
    with Board(heads_at=(-4.0, -4.0, -4.0), settings=quick_rig.SETTINGS) as board:

        def picture(camera: int, seconds: float) -> bytes:
            if not board.laser_at(seconds):
                return DARK
            head = on_head[camera]
            axis = heads[head - 1].axis or head
            x = board.position_at(seconds)[axis - 1]
            film = films[1 if axis == 1 else 5]
            return film[int(np.clip(round(x / STEP_MM), 0, len(film) - 1))]

        with VirtualStreams(tuple(on_head), picture, free_running(RATE), latency_s=LATENCY_S) as streams:
            latency = RigLatency(seconds=LATENCY_S, sd_s=0.001, frame_sd_s=0.002)
            rig = Rig(
                format="footscan.rig/1",
                scanner="bench",
                port=board.port,
                board=quick_rig.QUICK,
                heads=heads,
                cameras=[
                    RigCamera(id=camera, device=streams.url(camera), head=head, latency=latency)
                    for camera, head in on_head.items()
                ],
                travel=RigTravel(start_mm=0.0, length_mm=LENGTH_MM, mm_per_s=60.0),
                frames_per_second=RATE,
            )
            states: list[str] = []
            with LiveScanner(rig) as scanner:
                scanner.listen(lambda state: states.append(state.name))
                assert scanner.connect() == {}
                yield Bench(scanner, board, streams, home, states)

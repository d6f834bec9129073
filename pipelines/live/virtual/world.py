"""The world without hardware: a board, eight cameras, and what stands on the glass.

    python -m pipelines.live.virtual.world '{"pictures": "...", "subject": "right"}'

runs as a process of its own, as hardware does, and shares nothing with the scanner but a serial port and eight
addresses. It says on standard output, a JSON document a line, how far its pictures are and then what it offers; orders
come on standard input, a JSON document a line, and their end is its own.
"""

import json
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from math import ceil, floor
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field

from footscan.virtual.board.board import Board
from footscan.virtual.board.memory import SET_UP
from footscan.virtual.board.rails import Gait
from footscan.virtual.filming.streams import VirtualStreams
from footscan.virtual.foot.foot import Foot, FootShape, make_foot, sample_shape
from footscan.virtual.optics.scene import SKIN, Mesh
from footscan.virtual.stage.pictures import Light, Progress, StagePictures, Subject
from footscan.virtual.stage.reference_stage import NOTHING, block_subject
from footscan.virtual.stage.stage import Positions, Stage, indices_of_travel
from footscan.virtual.stage.standing import stand_in_the_middle
from schemas.base.model import Document
from schemas.parameters.simulation import Scale, Seed, SimulationSettings

CAMERAS = range(1, 9)
EXPOSURE_MS = 10.0
"""What the stage's pictures are exposed for at light 1, see `VirtualStreams.settings`."""
MOST_GAIN = 16.0
"""Of a camera's range, as a factor."""
LATENCIES_S = (0.02, 0.06)
WATCHED_EVERY_S = 0.02
MOVES_SECONDS = 0.1
RAIL_MM = (-20.0, 412.0)
BLOCK_MM_PER_S = 90.0
"""No faster do heads pass the block."""
EVEN_SECONDS = 0.3
"""Heads move evenly, with light, for so long before a travel and behind it; before that they gain speed."""
ACCELERATIONS = (120, 121, 122)
"""The board's settings of them, mm/s^2."""
SLACK_MM = 2.0
"""Heads are that far at most from where they were sent, or from one another."""
BLOCK_REACH_MM = 86.0
"""Before and behind the middle: the block is nowhere else, and heads need not be either."""

SubjectName = Literal["right", "left", "block", "nothing"]


class World(Document):
    """What a virtual world is like."""

    pictures: str
    """Folder of its pictures, kept from one start to the next."""
    subject: SubjectName = "nothing"
    """What stands on the glass."""
    foot_seed: Seed | None = None
    """Of the population that the feet are drawn from; default: the mean man's."""
    light: Literal["dark", "ambient", "bright"] = "ambient"
    scanner_seed: Seed = 1
    """Of mounting and lenses, and of the latencies of its cameras, which nobody is told."""
    start_mm: float = 0.0
    end_mm: float = 400.0
    mm_per_s: Annotated[float, Field(gt=0, le=200)] = 400.0 / 11.0
    """How fast heads travel along a foot."""
    grid_mm: Annotated[float, Field(gt=0, le=10)] = 0.5
    """Of the places that there are pictures of with light."""
    dark_grid_mm: Annotated[float, Field(gt=0, le=400)] = 100.0
    """Of those without: in the dark a head is shown at the nearest of these."""
    ripple: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Part of the speed that swings once a second."""
    pause_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    """How long the heads stand still in the middle of each travel with light."""
    jitter_ms: Annotated[float, Field(ge=0, le=25)] = 10.0
    """How far an exposure may be off the camera's clock, either way."""
    delivery_jitter_ms: Annotated[float, Field(ge=0, le=1000)] = 2.0
    """How much later than usual a picture may be sent."""
    brightness: Scale = 24.0
    """Of the lasers at full power, see `SimulationSettings.laser_exposure`."""


class VirtualWorld:
    """A world that runs; a context manager."""

    def __init__(self, world: World, progress: Progress | None = None) -> None:
        self._world = world
        self._settings = SimulationSettings(
            ambient=world.light, scanner_seed=world.scanner_seed, laser_exposure=world.brightness
        )
        self._ends, self._is_whole = threading.Event(), threading.Event()
        self._pictures = self._prepared(world.subject, progress)
        self.board = Board(gait=Gait(world.ripple)).start()
        self.stage = Stage(self._pictures, self._shown_at, self._power_at, self._light_of)
        random = np.random.default_rng([world.scanner_seed, 9])
        self.latencies_s = {camera: float(random.uniform(*LATENCIES_S)) for camera in CAMERAS}
        self.streams = VirtualStreams(
            CAMERAS,
            self.stage.picture,
            self._exposures,
            latency_s=self.latencies_s,
            jitter_s=world.delivery_jitter_ms / 1000,
        )
        self._is_whole.set()
        self._watch = threading.Thread(target=self._pause_in_the_middle, name="virtual pause", daemon=True)
        self._watch.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def offer(self) -> dict[str, Any]:
        """What a user of the scanner would plug in: the serial port, and the address of each camera."""
        return {"port": self.board.port, "cameras": {camera: self.streams.url(camera) for camera in CAMERAS}}

    def put(self, subject: SubjectName, progress: Progress | None = None) -> None:
        """Puts something else onto the glass."""
        before, self._pictures = self._pictures, self._prepared(subject, progress)
        self.stage.put(self._pictures)
        before.close()

    def close(self) -> None:
        """Ends all of it."""
        self._ends.set()
        self._watch.join()
        self.streams.close()
        self.stage.close()
        self.board.close()
        self._pictures.close()

    def _prepared(self, subject: SubjectName, progress: Progress | None) -> StagePictures:
        world = self._world
        made = self._subject(subject)
        pictures = StagePictures(made, self._settings, Path(world.pictures), world.grid_mm)
        rail = range(floor(RAIL_MM[0] / world.dark_grid_mm), ceil(RAIL_MM[1] / world.dark_grid_mm) + 1)
        dark = {round(k * world.dark_grid_mm / world.grid_mm) for k in rail}
        pictures.prepare(CAMERAS, dark, Light(0.0), progress)
        pictures.prepare(CAMERAS, indices_of_travel(*self._lit_mm(subject), world.grid_mm), Light(), progress)
        return pictures

    def _lit_mm(self, subject: SubjectName) -> tuple[float, float]:
        """Where heads come with light."""
        start, end, speed = self._world.start_mm, self._world.end_mm, self._world.mm_per_s
        if subject == "block":
            start, end = block_range_mm(self._world)
            speed = BLOCK_MM_PER_S
        run_up = EVEN_SECONDS * speed + speed**2 / (2.0 * min(SET_UP[axis] for axis in ACCELERATIONS)) + SLACK_MM
        return max(start - run_up, RAIL_MM[0]), min(end + run_up, RAIL_MM[1])

    def _shown_at(self, seconds: float) -> Positions:
        """Where the heads are shown: where they are, or in the dark near there."""
        x = self.board.position_at(seconds)
        if self.board.laser_at(seconds):
            return x
        dark = self._world.dark_grid_mm
        return round(x[0] / dark) * dark, round(x[1] / dark) * dark, round(x[2] / dark) * dark

    def _power_at(self, seconds: float) -> float:
        """The lasers' power; of heads that move the nearest that there are pictures of.

        While they gain and lose speed the board dims the lasers, and pictures of that would have to be made first.
        """
        power = self.board.laser_at(seconds)
        moves = self.board.position_at(seconds) != self.board.position_at(seconds - MOVES_SECONDS)
        return 1.0 if moves and power else power

    def _subject(self, subject: SubjectName) -> Subject:
        if subject == "nothing":
            return NOTHING
        middle_mm = (self._world.start_mm + self._world.end_mm) / 2
        if subject == "block":
            return block_subject(middle_mm)
        foot = virtual_foot(self._world, subject)
        travel = SimulationSettings(start_mm=middle_mm, step_mm=1, frames=1)
        return Subject(Mesh(stand_in_the_middle(foot.vertices, travel), foot.faces.astype(np.int64)), SKIN)

    def _exposures(self, camera: int) -> Iterator[float]:
        self._is_whole.wait()  # cameras have threads of their own before there are settings to ask them for
        yield from self.stage.exposures(camera, jitter_seconds=self._world.jitter_ms / 1000)

    def _light_of(self, camera: int) -> tuple[float, float]:
        settings = self.streams.settings(camera)
        return settings["exposure"] / EXPOSURE_MS, 1.0 + (MOST_GAIN - 1.0) * settings["gain"]

    def _pause_in_the_middle(self) -> None:
        """Holds the heads up once in each travel with light."""
        middle_mm = (self._world.start_mm + self._world.end_mm) / 2
        before: float | None = None
        while self._world.pause_s and not self._ends.wait(WATCHED_EVERY_S):
            now = time.monotonic()
            x = self.board.position_at(now)[0]
            if self.board.laser_at(now) and before is not None and (before < middle_mm) != (x < middle_mm):
                self.board.pause(self._world.pause_s)
            before = x


def block_range_mm(world: World) -> tuple[float, float]:
    """Between which places the heads travel for the latencies: past all of the block."""
    middle = (world.start_mm + world.end_mm) / 2
    return middle - BLOCK_REACH_MM, middle + BLOCK_REACH_MM


def virtual_foot(world: World, side: Literal["right", "left"]) -> Foot:
    """The foot that stands on the glass of a world, as it stands on a floor of its own."""
    seed = world.foot_seed
    shape = FootShape() if seed is None else sample_shape(np.random.default_rng(seed), "male")
    return make_foot(shape, side=side)


def obey(world: VirtualWorld, order: Mapping[str, Any]) -> None:
    """Carries out an order: `put` a subject, `pause` for seconds, `door` open or closed, `cable` in or out."""
    for name, value in order.items():
        match name:
            case "put":
                world.put(value, _tell_progress)
            case "pause":
                world.board.pause(float(value))
            case "door":
                world.board.open_door() if value == "open" else world.board.close_door()
            case "cable":
                world.board.pull_cable() if value == "out" else world.board.plug_cable()
            case "stick":
                world.board.stick(int(value))


def main() -> None:
    """Runs a world until its standard input ends."""
    world = World.model_validate_json(sys.argv[1])
    with VirtualWorld(world, _tell_progress) as running:
        _tell({"ready": running.offer})
        for line in sys.stdin:
            obey(running, json.loads(line))
            _tell({"done": line.strip()})


def _tell_progress(done: int, total: int) -> None:
    _tell({"pictures": [done, total]})


def _tell(document: Mapping[str, Any]) -> None:
    print(json.dumps(document), flush=True)


if __name__ == "__main__":
    main()

"""The virtual world: a board, eight cameras, and the subject on the glass.

    python -m pipelines.live.virtual.world '{"pictures": "...", "subject": "right"}' CLOCK

runs as a process of its own and, like hardware, shares only a serial port and eight addresses with the scanner, and a
clock, which waits for the pictures. On standard output it writes the addresses, on standard input it reads orders, each
a JSON document in one line. It ends when standard input ends.
"""

import json
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field

from footscan import clock
from footscan.calibration.travel.body import TURN_DEG
from footscan.mesh.formats.files import read_mesh
from footscan.virtual.board.board import Board
from footscan.virtual.board.rails import Gait
from footscan.virtual.filming.streams import VirtualStreams
from footscan.virtual.foot.foot import Foot, FootShape, make_foot, sample_shape
from footscan.virtual.optics.scene import SKIN, Mesh
from footscan.virtual.stage.pictures import StagePictures, Subject
from footscan.virtual.stage.reference import read_reference, standard_reference
from footscan.virtual.stage.reference_stage import NOTHING, block_subject, reference_subject
from footscan.virtual.stage.stage import Positions, Stage
from footscan.virtual.stage.standing import stand_on_glass
from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import RefusedInput
from schemas.base.model import Document
from schemas.known_measures import KnownMeasures
from schemas.parameters.simulation import Scale, Seed, SimulationSettings

CAMERAS = range(1, 9)
EXPOSURE_MS = 10.0
"""Exposure of the pictures of the stage at light 1, see `VirtualStreams.settings`."""
MOST_GAIN = 16.0
"""Largest gain of a camera, as a factor."""
LATENCIES_S = (0.02, 0.06)
"""Range from which the latencies of the cameras are drawn."""
WATCHED_EVERY_S = 0.02
"""Interval at which the middle of the travel is watched for."""
MOVES_SECONDS = 0.1
"""Heads move if their position differs from that so long before."""
BLOCK_REACH_MM = 86.0
"""Half of the travel over the block, from its middle: the block does not reach further."""

SubjectName = Annotated[str, Field(pattern=r"^(right|left|block|nothing|body|reference \d{1,4})$")]
"""`reference K`: the reference object in its placement K, counted from 0."""


class World(Document):
    """Settings of a virtual world."""

    pictures: str
    """Folder of the pictures, kept from one start to the next."""
    subject: SubjectName = "nothing"
    """The subject on the glass."""
    reference: str | None = None
    """File of the reference object; default: the standard one."""
    body: str | None = None
    """Mesh of the body that shows the laser planes, standing on Z = 0, mm."""
    foot_seed: Seed | None = None
    """Seed of the shape of the feet; default: the mean male foot."""
    light: Literal["dark", "ambient", "bright"] = "ambient"
    scanner_seed: Seed = 1
    """Seed of mounting, lenses and latencies of the cameras; the latencies are not revealed."""
    start_mm: float = 0.0
    end_mm: float = 400.0
    mm_per_s: Annotated[float, Field(gt=0, le=200)] = 400.0 / 11.0
    """Speed of the heads along a foot."""
    grid_mm: Annotated[float, Field(gt=0, le=10)] = 0.45
    """Spacing of the positions with pictures with light. The way between two frames is no multiple of it: exposures
    would all keep the same distance from the camera's clock."""
    dark_grid_mm: Annotated[float, Field(gt=0, le=400)] = 100.0
    """Spacing of the positions with pictures without light; in the dark a head is shown at the nearest one."""
    ripple: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share of the speed that oscillates once a second."""
    pause_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    """Pause of the heads in the middle of each travel with light."""
    jitter_ms: Annotated[float, Field(ge=0, le=25)] = 10.0
    """Largest deviation of an exposure from the clock of the camera, either way."""
    delivery_jitter_ms: Annotated[float, Field(ge=0, le=1000)] = 2.0
    """Largest additional delay of sending a picture."""
    brightness: Scale = 24.0
    """Brightness of the lasers at full power, see `SimulationSettings.laser_exposure`."""


class VirtualWorld:
    """A running virtual world; a context manager."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._settings = SimulationSettings(
            ambient=world.light, scanner_seed=world.scanner_seed, laser_exposure=world.brightness
        )
        self._foot: Foot | None = None
        self._ends, self._is_whole = threading.Event(), threading.Event()
        self._pictures = self._pictures_of(world.subject)
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

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def offer(self) -> dict[str, Any]:
        """The connections of the scanner: the serial port, and the address of each camera."""
        return {"port": self.board.port, "cameras": {camera: self.streams.url(camera) for camera in CAMERAS}}

    def put(self, subject: SubjectName) -> None:
        """Put another subject onto the glass."""
        before, self._pictures = self._pictures, self._pictures_of(subject)
        self.stage.put(self._pictures)
        before.close()

    def write_known(self, file: Path) -> None:
        """Write the known measures of the foot on the glass; RefusedInput if there is none."""
        if self._foot is None:
            raise RefusedInput("virtual world", "has no foot on its glass, expected one", field="subject")
        known = KnownMeasures(side=self._foot.side, measures=self._foot.measures)
        write_atomically(file, (known.model_dump_json(indent=2) + "\n").encode())

    def close(self) -> None:
        """End board, cameras and stage."""
        self._ends.set()
        self._watch.join()
        self.streams.close()
        self.stage.close()
        self.board.close()
        self._pictures.close()

    def _pictures_of(self, subject: SubjectName) -> StagePictures:
        return StagePictures(self._subject(subject), self._settings, Path(self._world.pictures), self._world.grid_mm)

    def _shown_at(self, seconds: float) -> Positions:
        """X of the heads in the picture, mm: their position, in the dark rounded to `dark_grid_mm`."""
        x = self.board.position_at(seconds)
        if self.board.laser_at(seconds):
            return x
        dark = self._world.dark_grid_mm
        return round(x[0] / dark) * dark, round(x[1] / dark) * dark, round(x[2] / dark) * dark

    def _power_at(self, seconds: float) -> float:
        """Power of the lasers in the picture: full power for any light on moving heads.

        While heads accelerate the board dims the lasers; pictures of many powers would be seen for a moment each.
        """
        power = self.board.laser_at(seconds)
        moves = self.board.position_at(seconds) != self.board.position_at(seconds - MOVES_SECONDS)
        return 1.0 if moves and power else power

    def _subject(self, subject: SubjectName) -> Subject:
        self._foot = None
        if subject == "nothing":
            return NOTHING
        middle_mm = self._middle_mm
        if subject == "block":
            return block_subject(middle_mm)
        if subject == "body":
            if self._world.body is None:
                raise RefusedInput("virtual world", "has no body", field="body")
            vertices, faces = read_mesh(Path(self._world.body))
            return Subject(Mesh(stand_on_glass(vertices, middle_mm, TURN_DEG), faces.astype(np.int64)))
        if subject.startswith("reference"):
            file = self._world.reference
            reference = standard_reference() if file is None else read_reference(Path(file))
            return reference_subject(middle_mm, int(subject.removeprefix("reference ")), reference)
        self._foot = foot = virtual_foot(self._world, "left" if subject == "left" else "right")
        return Subject(Mesh(stand_on_glass(foot.vertices, middle_mm), foot.faces.astype(np.int64)), SKIN)

    @property
    def _middle_mm(self) -> float:
        return (self._world.start_mm + self._world.end_mm) / 2

    def _exposures(self, camera: int) -> Iterator[float]:
        self._is_whole.wait()  # the threads of the cameras start before `self.streams` is set
        yield from self.stage.exposures(camera, jitter_seconds=self._world.jitter_ms / 1000)

    def _light_of(self, camera: int) -> tuple[float, float]:
        settings = self.streams.settings(camera)
        return settings["exposure"] / EXPOSURE_MS, 1.0 + (MOST_GAIN - 1.0) * settings["gain"]

    def _pause_in_the_middle(self) -> None:
        """Pause the heads once in each travel with light."""
        middle_mm = (self._world.start_mm + self._world.end_mm) / 2
        before: float | None = None
        while self._world.pause_s and not self._ends.wait(WATCHED_EVERY_S):
            now = clock.seconds()
            x = self.board.position_at(now)[0]
            if self.board.laser_at(now) and before is not None and (before < middle_mm) != (x < middle_mm):
                self.board.pause(self._world.pause_s)
            before = x


def block_range_mm(world: World) -> tuple[float, float]:
    """Range of X, mm, of the travel for the latencies: past the whole block."""
    middle = (world.start_mm + world.end_mm) / 2
    return middle - BLOCK_REACH_MM, middle + BLOCK_REACH_MM


def virtual_foot(world: World, side: Literal["right", "left"]) -> Foot:
    """The foot of a world, in its own frame on the floor."""
    seed = world.foot_seed
    shape = FootShape() if seed is None else sample_shape(np.random.default_rng(seed), "male")
    return make_foot(shape, side=side)


def obey(world: VirtualWorld, order: Mapping[str, Any]) -> None:
    """Carry out an order: `put` a subject, write what is `known` of it into a file, `pause` (s), `door` open or closed,
    `cable` in or out, `stick` a head."""
    for name, value in order.items():
        match name:
            case "put":
                world.put(value)
            case "known":
                world.write_known(Path(str(value)))
            case "pause":
                world.board.pause(float(value))
            case "door":
                world.board.open_door() if value == "open" else world.board.close_door()
            case "cable":
                world.board.pull_cable() if value == "out" else world.board.plug_cable()
            case "stick":
                world.board.stick(int(value))


def main() -> None:
    """Run a world until standard input ends."""
    world = World.model_validate_json(sys.argv[1])
    own_clock = clock.WorldClock(Path(sys.argv[2]))
    with clock.keeping(own_clock), VirtualWorld(world) as running:
        _tell({"ready": running.offer})
        for line in sys.stdin:
            obey(running, json.loads(line))
            _tell({"done": line.strip()})


def _tell(document: Mapping[str, Any]) -> None:
    print(json.dumps(document), flush=True)


if __name__ == "__main__":
    main()

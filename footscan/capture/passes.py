"""One pass of the heads along the foot: standing in the dark, with light, and optionally back in the dark."""

import threading
from collections import defaultdict
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from footscan import clock
from footscan.capture.board.head import Travel
from footscan.capture.board.heads import Heads
from footscan.capture.cameras.deck import CameraDeck
from footscan.capture.cameras.frame_clock import FrameTimes
from footscan.capture.cameras.stream import CapturedFrame
from schemas.base.errors import Fault

DARK_SECONDS = 0.4
"""Time for which the heads stand in the dark: several frames of a slow camera. Chosen by hand."""
AFTER_SECONDS = 0.2
"""A frame stamped this long after the end shows that all earlier frames have arrived. Chosen by hand."""
LATEST_SECONDS = 5.0
"""Longest wait for such a frame. Chosen by hand."""
LEAD_SECONDS = 0.3
"""Heads move evenly for this long before the first place of the scan and after the last: where the speed changes
between two reports of the board, the heads' places are uncertain. Chosen by hand."""

Take = Callable[[str, CapturedFrame], None]
"""Takes a frame of a film by its name; `queue.Full` where it has no room."""


@dataclass(frozen=True)
class PassPlan:
    """The travel, speed and light of a pass."""

    start_mm: float
    end_mm: float
    mm_per_s: float
    power: float
    """Of the lasers, 0 to 1."""
    dark_return: bool = False
    """True if the way back is filmed in the dark: the skin in the light of the room."""
    head: int | None = None
    """The only head that travels; None: all do."""


@dataclass
class FilmTally:
    """The frames that arrived for one film."""

    taken: set[int] = field(default_factory=set)
    """Arrivals."""
    problems: dict[int, str] = field(default_factory=dict)
    """Defects, by arrival."""


@dataclass(frozen=True)
class FilmedPass:
    """The films and travels of a pass. Films are called `cam1` and `cam1-background`."""

    cameras: tuple[int, ...]
    before: Travel
    """When the heads stood in the dark."""
    travel: Travel
    """With light."""
    back: Travel | None
    """In the dark."""
    films: dict[str, FilmTally]
    times: dict[int, tuple[int, FrameTimes]]
    """Of each camera, as `CameraStream.times` has them."""
    failed: dict[int, str]
    """Cameras that failed during the pass, with the reason."""


def film_name(camera: int, *, background: bool = False) -> str:
    """Returns the name of a film within the scan's group of arrays."""
    return f"cam{camera}-background" if background else f"cam{camera}"


def film_pass(
    heads: Heads, deck: CameraDeck, cameras: Collection[int], plan: PassPlan, take: Take, check: Callable[[], None]
) -> FilmedPass:
    """Film one pass with the cameras, which must be open.

    Parameters
    ----------
    take : gets each frame with the name of its film.
    check : called between the parts of the pass; an exception of it ends the pass.

    Raises
    ------
    Fault, RefusedInput
        As `Heads.travel`. The lasers are then off, and no frames are delivered.
    """
    sorter = _Sorter(take)
    connections = {camera: health.connections for camera, health in deck.health().items()}
    try:
        begin_mm, end_mm = _with_lead(plan, heads)
        heads.travel_to(begin_mm, head=plan.head)
        sorter.begin(background=True)
        deck.send_to(sorter.take)
        before = _stand(deck)
        check()
        sorter.begin(background=False)
        heads.lasers(plan.power)
        travel = heads.travel(begin_mm, end_mm, plan.mm_per_s, plan.head)
        deck.wait_beyond(travel.end_seconds + AFTER_SECONDS, LATEST_SECONDS)
        check()
        back = None
        if plan.dark_return:
            sorter.begin(background=True)
            heads.lasers(0.0)
            back = heads.travel(end_mm, begin_mm, plan.mm_per_s, plan.head)
            deck.wait_beyond(back.end_seconds + AFTER_SECONDS, LATEST_SECONDS)
            check()
    finally:
        heads.lasers(0.0)
        deck.send_to(None)
    failed = {}
    for camera, health in deck.health().items():
        if camera in cameras and (health.state != "streaming" or health.connections != connections.get(camera)):
            failed[camera] = health.problem or f"camera {camera}: the connection was lost for a while"
    times = {}
    for camera in cameras:
        try:
            times[camera] = deck.times(camera)
        except Fault as fault:
            failed[camera] = str(fault)
            continue
        problem = times[camera][1].problem(before.begin_seconds, (back or travel).end_seconds + AFTER_SECONDS)
        if problem is not None:
            failed.setdefault(camera, problem)
    return FilmedPass(tuple(sorted(cameras)), before, travel, back, sorter.films(), times, failed)


class _Sorter:
    """Passes each frame to the current film, and counts it."""

    def __init__(self, take: Take) -> None:
        self._take = take
        self._background = True
        self._films: dict[str, FilmTally] = defaultdict(FilmTally)
        self._lock = threading.Lock()

    def begin(self, *, background: bool) -> None:
        self._background = background

    def take(self, frame: CapturedFrame) -> None:
        name = film_name(frame.camera, background=self._background)
        self._take(name, frame)  # a frame that is refused is not counted, and so is lost
        with self._lock:
            tally = self._films[name]
            tally.taken.add(frame.arrival)
            if frame.problem is not None:
                tally.problems[frame.arrival] = frame.problem

    def films(self) -> dict[str, FilmTally]:
        with self._lock:
            return dict(self._films)


def _with_lead(plan: PassPlan, heads: Heads) -> tuple[float, float]:
    """Returns start and end of the travel with its lead, within the rails."""
    low, high = heads.reach_mm
    lead = LEAD_SECONDS * plan.mm_per_s * (1.0 if plan.end_mm >= plan.start_mm else -1.0)
    return min(max(plan.start_mm - lead, low), high), min(max(plan.end_mm + lead, low), high)


def _stand(deck: CameraDeck) -> Travel:
    begin = clock.seconds()
    deck.wait_beyond(begin + DARK_SECONDS, LATEST_SECONDS)
    return Travel(begin, clock.seconds())

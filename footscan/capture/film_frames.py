"""Selects the frames of a film: each has a known place, and a lost frame has a place without a picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.capture.board.head import Travel
from footscan.capture.board.position_log import PositionLog
from footscan.capture.cameras.frame_clock import FrameTimes
from footscan.capture.frame_positions import STANDING_MM, FramePositions, Timed, frame_positions
from footscan.capture.head_motion import HeadMotion, HeadReports, smooth_motion
from footscan.capture.passes import FilmTally
from schemas.base.errors import Finding

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MARGIN_SECONDS = 1.0
"""Reports and frames within this time before and after a travel belong to it. Chosen by hand."""
USUAL_JITTERS = 3.0
"""Delays within this many standard deviations are usual. Chosen by hand."""
MOST_LOST = 0.05
"""Largest share of lost frames in a complete film. Chosen by hand."""
WIDEST_GAP_STEPS = 4.0
"""Largest gap between two places with a picture, in usual steps. Chosen by hand."""


@dataclass(frozen=True)
class CameraTiming:
    """Latency and uncertainty of a camera's times."""

    latency: Timed
    exposure_share: float
    """Of a frame's delay, see `latency.Latency`."""
    frame_sd_s: float
    """Standard deviation of the time of a frame alone."""


@dataclass(frozen=True)
class FilmFrames:
    """The film of one camera; frames k = 0 to K - 1."""

    arrivals: dict[int, int]
    """Arrival number of each frame; a frame without one is lost."""
    x_mm: Floats
    """(K,) scanner frame."""
    sd_mm: Floats
    """(K,) of these, with that of the latency."""
    shared_sd_mm: float
    mm_per_s: float
    number: Ints
    """(K,) on the camera's own clock."""
    lost: dict[int, str]
    """Why frame k has no picture."""
    left_out: dict[int, str]
    """Why an exposure on the travel is not in the film, by its number on the camera's own clock."""
    problem: str | None
    """Why the film is incomplete; None if it is complete."""


def motion_of_head(log: PositionLog, head: int, travel: Travel) -> HeadMotion:
    """The motion of head 1, 2, ... on a travel."""
    entries = log.between(travel.begin_seconds - MARGIN_SECONDS, travel.end_seconds + MARGIN_SECONDS)
    seconds = np.array([entry.seconds for entry in entries], np.float64)
    sd = np.array([entry.seconds_sd for entry in entries], np.float64)
    x_mm = np.array([entry.x_mm[head - 1] for entry in entries], np.float64)
    stands = np.array([not entry.is_moving for entry in entries], bool)
    ascending = np.diff(seconds, prepend=-np.inf) > 0
    return smooth_motion(HeadReports(seconds[ascending], sd[ascending], x_mm[ascending], stands[ascending]))


def is_on_time(clock: FrameTimes) -> Bools:
    """(N,) frames whose delay may be one of their exposure; a longer one is of delivery, and tells nothing of it."""
    return np.asarray(np.abs(clock.delay_s) <= USUAL_JITTERS * clock.jitter_s)


def place_frames(
    tally: FilmTally,
    times: tuple[int, FrameTimes],
    travel: Travel,
    motion: HeadMotion,
    timing: CameraTiming,
    ends_mm: tuple[float, float],
    largest_sd_mm: float,
) -> FilmFrames:
    """The film of a camera on a travel, as far as that is between two places, in the order in which it was taken.

    Frames whose place is known less well than `largest_sd_mm` are lost.

    Raises
    ------
    Finding
        No frame was taken on the travel.
    """
    first, clock = times
    low, high = min(ends_mm), max(ends_mm)
    rows = np.array(sorted(arrival - first for arrival in tally.taken if arrival >= first), np.int64)
    rows = rows[rows < len(clock.number)]
    taken = clock.seconds[rows] - timing.latency.seconds
    rows = rows[(taken >= travel.begin_seconds) & (taken <= travel.end_seconds)]
    if not len(rows):
        raise Finding("gave no frame on the travel")
    problems = {arrival - first: problem for arrival, problem in tally.problems.items()}
    sound = [row for row in rows.tolist() if row not in problems]
    by_number = {int(clock.number[row]): row for row in reversed(sound)}
    number = np.array(sorted(by_number), np.int64)
    if not len(number):
        raise Finding(f"gave no sound frame on the travel: {next(iter(problems.values()))}")
    row = np.array([by_number[one] for one in number.tolist()])
    on_time = is_on_time(clock)[row]
    seconds = clock.seconds[row] + timing.exposure_share * np.where(on_time, clock.delay_s[row], 0.0)
    own_sd_s = np.where(
        on_time, timing.frame_sd_s, np.maximum(timing.exposure_share * clock.jitter_s, timing.frame_sd_s)
    )
    sd_s = np.hypot(clock.sd_s[row], own_sd_s)
    placed = frame_positions(number, seconds, sd_s, motion, timing.latency)
    inside = np.flatnonzero((placed.x_mm >= low) & (placed.x_mm <= high))
    if not len(inside):
        why = next(iter(placed.dropped.values()), "none was taken between its ends")
        raise Finding(f"gave no frame on the travel whose place is known: {why}")
    wrong = {int(clock.number[bad]): problem for bad, problem in problems.items() if 0 <= bad < len(clock.number)}
    unseen = _unseen_at_ends(number, seconds - timing.latency.seconds, clock.period_s, motion, travel, (low, high))
    arrivals, lost = {}, {}
    for k, place in enumerate(inside.tolist()):
        camera_number = int(placed.number[place])
        if placed.is_lost[place]:
            lost[k] = wrong.get(camera_number, "dropped: it never came")
        elif placed.sd_mm[place] > largest_sd_mm:
            lost[k] = f"its place is known to {placed.sd_mm[place]:.2f} mm only"
        else:
            arrivals[k] = by_number[camera_number] + first
    problem = _problem(placed, inside, arrivals, [*lost.values(), *unseen.values()], (low, high))
    return FilmFrames(
        arrivals=arrivals,
        x_mm=placed.x_mm[inside],
        sd_mm=placed.sd_mm[inside],
        shared_sd_mm=placed.shared_sd_mm,
        mm_per_s=placed.mm_per_s,
        number=placed.number[inside],
        lost=lost,
        left_out=placed.dropped | {one: wrong.get(one, why) for one, why in unseen.items()},
        problem=problem,
    )


def standing_frame(
    tally: FilmTally, times: tuple[int, FrameTimes], timing: CameraTiming, standing: Travel
) -> int | None:
    """The last sound arrival that was taken while the heads stood; None if there is none."""
    first, clock = times
    taken = clock.seconds - timing.latency.seconds
    fitting = [
        arrival
        for arrival in tally.taken
        if arrival not in tally.problems
        and 0 <= arrival - first < len(taken)
        and standing.begin_seconds <= taken[arrival - first] <= standing.end_seconds
    ]
    return max(fitting, default=None)


def nearest_frames(film: FilmFrames, dark: FilmFrames) -> dict[int, int]:
    """For each frame of a film the arrival of the frame in the dark that was taken nearest to it, where one is near.

    Near is within the usual step of either: beside it the skin is another.
    """
    known = sorted(dark.arrivals)
    if len(known) < 2 or len(film.x_mm) < 2:
        return {}
    at = dark.x_mm[known]
    step = max(float(np.median(np.abs(np.diff(film.x_mm)))), float(np.median(np.abs(np.diff(at)))))
    nearest = np.abs(film.x_mm[:, None] - at[None, :]).argmin(axis=1)
    near = np.abs(film.x_mm - at[nearest]) <= step
    return {k: dark.arrivals[known[nearest[k]]] for k in np.flatnonzero(near).tolist()}


def _unseen_at_ends(
    number: Ints, taken: Floats, period_s: float, motion: HeadMotion, travel: Travel, ends_mm: tuple[float, float]
) -> dict[int, str]:
    """Exposures of the film, by their number, before the first sound frame on the travel and behind the last one."""
    begin, end = max(travel.begin_seconds, motion.seconds[0]), min(travel.end_seconds, motion.seconds[-1])
    before = np.arange(1, int((taken[0] - begin) / period_s) + 1)
    behind = np.arange(1, int((end - taken[-1]) / period_s) + 1)
    beyond = np.concatenate([number[0] - before, number[-1] + behind])
    seconds = np.concatenate([taken[0] - period_s * before, taken[-1] + period_s * behind])
    x, _, _ = motion.at(seconds)
    of_film = (beyond >= 0) & (x >= ends_mm[0]) & (x <= ends_mm[1])
    of_film &= ~motion.may_stand(seconds, np.full(len(seconds), STANDING_MM))
    return dict.fromkeys(sorted(beyond[of_film].tolist()), "lost at an end of the film")


def _problem(
    placed: FramePositions,
    inside: NDArray[np.intp],
    arrivals: dict[int, int],
    lost: Sequence[str],
    ends_mm: tuple[float, float],
) -> str | None:
    x = placed.x_mm[inside]
    frames = len(arrivals) + len(lost)
    if len(lost) > MOST_LOST * frames:
        return f"{len(lost)} of {frames} frames are lost, the first one: {lost[0]}"
    step = float(np.median(np.abs(np.diff(x)))) if len(x) > 1 else float("inf")
    pictured = np.sort(x[sorted(arrivals)])
    gaps = np.diff(np.concatenate([[ends_mm[0]], pictured, [ends_mm[1]]]))
    widest = int(np.argmax(gaps))
    if gaps[widest] > WIDEST_GAP_STEPS * step:
        after = ends_mm[0] if widest == 0 else float(pictured[widest - 1])
        return f"no picture for {gaps[widest]:.1f} mm behind X = {after:.1f} mm"
    return None

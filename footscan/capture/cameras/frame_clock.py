"""Which exposure of a camera each of its frames is, from the times they were stamped with.

A camera exposes at an even period. Its frames arrive with a delay that varies, in bursts after a stall, and some never.
A frame's X depends on its number, so a frame that is lost must leave its number empty, and a number that cannot be told
for certain must say so in its standard deviation.
"""

from collections import deque
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from footscan.robust import MAD_TO_SD
from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FIRST_FRAMES = 400
"""Number of frames in the first fit; its period is exact enough to number four times as many. Chosen by hand."""
NEAR, FAR = 0.01, 0.2
"""Search ranges about the nominal period and about the median interval, as shares of them. Chosen by hand."""
PLAINLY = 1.2
"""Factor by which stamps must be more even at a short interval than at the median one. Chosen by hand."""
PROMISE_HOLDS = 0.5
"""The nominal period is kept unless another one increases the coherence of the stamps by this much. Chosen by hand."""
LATE_PERIODS = 0.5
WAKE_PERIODS = 0.1
EARLY_SIGMAS = 4.0
EARLY_PERIODS = (0.1, 0.5)
"""A frame cannot come before its exposure: what looks earlier than this much of a period is a frame before, late."""
RECENT = 16
MOST_LATE = 0.2
"""Share of late frames beyond which nobody can tell which exposure a frame is: the line then lies among late frames,
and a whole film may be numbered one period off. Tuned on films of 170 frames that a busy host delays at random, as in
the tests of this module: of some six hundred films with a frame half a period off, four had fewer late frames."""


@dataclass(frozen=True)
class FrameTimes:
    """The frames of one camera in the order of arrival, by its own clock. All arrays have shape (N,) but `missing`."""

    number: Ints
    """Exposures since the first frame's. Increases; only a frame sent twice has the number of the one before."""
    seconds: Floats
    """Time at which the exposure was due, plus a latency that is constant for the camera."""
    sd_s: Floats
    """Standard deviation of `seconds`, if the camera exposes evenly: that of the fit, and of the number itself where
    frames were lost in a stall and nobody can tell which."""
    delay_s: Floats
    """Time stamp of the frame minus `seconds`."""
    is_late: Bools
    """True for frames with a stamp half a period after `seconds` or later."""
    is_certain: Bools
    """True if no other number is possible with usual delays. Never of a last frame behind a gap."""
    missing: Ints
    """Numbers between the first and the last that no frame has, shape (M,)."""
    period_s: float
    jitter_s: float
    """Robust standard deviation of `delay_s`: of delivery if the camera exposes evenly, as a camera with fixed exposure
    does; for one that does not, `seconds + delay_s` is the better time, and this its standard deviation."""

    def problem(self, begin: float, end: float) -> str | None:
        """Why the numbers of frames with stamps from `begin` to `end` are doubtful; None if they are not."""
        stamps = self.seconds + self.delay_s
        is_late = self.is_late[(stamps >= begin) & (stamps <= end)]
        late, frames = int(is_late.sum()), len(is_late)
        if late <= MOST_LATE * frames:
            return None
        return (
            f"{late} of {frames} frames came late, which leaves open when each was exposed: the computer or the line "
            "to the camera is too busy. Film again when it is not"
        )


def number_frames(stamps: Floats, is_repeated: Bools | None = None, period_s: float | None = None) -> FrameTimes:
    """Number the frames of a camera, and smooth their times.

    Parameters
    ----------
    stamps : (N,) float64, seconds, in the order of arrival
    is_repeated : (N,) bool, optional
        Frames with the very bytes of the frame before. One that came in the same period is a copy, and no exposure.
    period_s : float, optional
        What the camera promises; it is kept to a hundredth as long as the stamps do not speak against it.

    Raises
    ------
    RefusedInput
        No frames; a stamp before the one before it; one frame and no period.
    """
    _check(stamps, period_s)
    expected = period_s or float(np.median(np.diff(stamps)))
    repeated = np.zeros(len(stamps), bool) if is_repeated is None else is_repeated
    is_copy = repeated & (np.diff(stamps, prepend=-np.inf) < LATE_PERIODS * expected)
    at = stamps[~is_copy]
    line = _first_line(at[:FIRST_FRAMES], period_s)
    seen = min(FIRST_FRAMES, len(at))
    while True:
        line = _refined(at[:seen], line)
        if seen == len(at):
            break
        seen = min(4 * seen, len(at))
    latest, is_late = _latest_numbers(at, line)
    slack = _slack(at, latest, is_late, line)
    number = latest - slack // 2
    fit_sd = line.sd(number)
    sd = np.hypot(fit_sd, line.period * np.sqrt(_mean_square_error(slack)))
    is_certain = slack == 0
    if np.any(np.diff(number[-2:]) > 1):
        is_certain[-1] = False  # frames were lost, or this one is late: no frame follows that would show which
    of_frame = np.cumsum(~is_copy) - 1  # a copy goes with the frame before
    seconds = line.at(number)
    return FrameTimes(
        number=(number - number[0])[of_frame],
        seconds=seconds[of_frame],
        sd_s=sd[of_frame],
        delay_s=stamps - seconds[of_frame],
        is_late=(stamps - seconds[of_frame] >= LATE_PERIODS * line.period),
        is_certain=is_certain[of_frame],
        missing=np.setdiff1d(np.arange(number[0], number[-1]), number) - number[0],
        period_s=line.period,
        jitter_s=line.jitter,
    )


class RunningNumber:
    """Numbers each frame as it arrives. Provisional: later frames show whether one was late or lost."""

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=RECENT)
        self._before = self._due = 0.0
        self._number = -1

    def next(self, stamp: float) -> int:
        """Return the number of a frame with the stamp `seconds`."""
        if self._number < 0:
            self._number, self._due = 0, stamp
        else:
            self._intervals.append(stamp - self._before)
            period = max(median(self._intervals), 1e-6)
            steps = max(1, round((stamp - self._due) / period))
            self._number += steps
            due = self._due + steps * period
            self._due = due + (stamp - due) / 4
        self._before = stamp
        return self._number


@dataclass(frozen=True)
class _Line:
    """A line: exposure n is due at phase + n * period, s, around the number `centre`."""

    phase: float
    period: float
    jitter: float
    centre: float = 0.0
    phase_sd: float = 0.0
    period_sd: float = 0.0

    def at(self, number: Ints) -> Floats:
        return np.asarray(self.phase + self.period * (number - self.centre), np.float64)

    def sd(self, number: Ints) -> Floats:
        return np.asarray(np.hypot(self.phase_sd, self.period_sd * (number - self.centre)), np.float64)

    def position(self, stamps: Floats) -> Floats:
        """Convert stamps to periods since exposure 0."""
        return np.asarray((stamps - self.phase) / self.period + self.centre, np.float64)


def _check(stamps: Floats, period_s: float | None) -> None:
    if len(stamps) == 0:
        raise RefusedInput("camera", "expected at least one frame, found none", field="frames")
    if np.any(np.diff(stamps) < 0) or not np.all(np.isfinite(stamps)):
        raise RefusedInput("camera", "expected time stamps that never run back", field="frames")
    if period_s is None and np.ptp(stamps) == 0:
        raise RefusedInput("camera", "expected two frames at different times, or a period", field="frames")


def _first_line(stamps: Floats, promised: float | None) -> _Line:
    found = []
    if promised is not None:
        found.append(_evenness(stamps, promised, NEAR))
    if len(stamps) > 1 and np.ptp(stamps) > 0:
        short, median = (max(float(value), 1e-3) for value in np.quantile(np.diff(stamps), (0.25, 0.5)))
        by_median = _evenness(stamps, median, FAR)
        # Where a third of the frames is lost, the median interval may be two periods long.
        by_short = _evenness(stamps, short, FAR)
        found.append(by_short if by_short[0] > PLAINLY * by_median[0] else by_median)
    if promised is not None and found[0][0] >= PROMISE_HOLDS * found[-1][0]:
        return found[0][1]
    return found[-1][1]


def _evenness(stamps: Floats, around: float, share: float) -> tuple[float, _Line]:
    """The period near `around` at which the stamps are most alike modulo it, and how alike: 1 for an even row.

    It is where the stamps' Fourier sum is greatest. Frames that are lost take nothing from it but strength, and late
    ones add noise, so that no frame need be numbered yet.
    """
    start, length = stamps[0], max(np.ptp(stamps), around)
    low, high = 1 / ((1 + share) * around), 1 / ((1 - share) * around)
    frequencies = np.linspace(low, high, 2 + int((high - low) * 8 * length))
    sums = np.exp(-2j * np.pi * np.outer(frequencies, stamps - start)).mean(axis=1)
    # An even row has no greatest period but its own; where several are as good, as for one frame, the expected one.
    best = int(np.argmax(np.abs(sums) - 1e-6 * np.abs(frequencies * around - 1)))
    period = float(1 / frequencies[best])
    phase = start - float(np.angle(sums[best])) / (2 * np.pi) * period
    return float(np.abs(sums[best])), _Line(phase, period, jitter=EARLY_PERIODS[1] * period / EARLY_SIGMAS)


def _refined(stamps: Floats, line: _Line) -> _Line:
    """Fit `line` to the frames that are on time, until their numbers no longer change."""
    numbers: Ints | None = None
    for _ in range(10):
        latest, is_late = _latest_numbers(stamps, line)
        if numbers is not None and np.array_equal(latest, numbers):
            break
        numbers = latest
        line = _fitted(stamps[~is_late], latest[~is_late], line)
    return line


def _latest_numbers(stamps: Floats, line: _Line) -> tuple[Ints, Bools]:
    """Return the highest increasing numbers that are not in the future, and the frames that are late for them."""
    early = np.clip(EARLY_SIGMAS * line.jitter / line.period, *EARLY_PERIODS)
    position = line.position(stamps)
    rank = np.arange(len(stamps))
    free = np.floor(position + early).astype(np.int64) - rank
    latest = np.minimum.accumulate(free[::-1])[::-1] + rank
    return latest, position - latest >= LATE_PERIODS


def _fitted(stamps: Floats, number: Ints, before: _Line) -> _Line:
    """Fit a line by least squares to the frames within three robust standard deviations of `before`."""
    residual = stamps - before.at(number)
    if len(stamps) < 3 or number[0] == number[-1]:
        return before
    middle = np.median(residual)
    jitter = float(MAD_TO_SD * np.median(np.abs(residual - middle)))
    is_near = np.abs(residual - middle) <= max(3 * jitter, 1e-6)
    stamps, number = stamps[is_near], number[is_near]
    if len(stamps) < 3:
        return before
    centre = float(number.mean())
    away = number - centre
    spread = float(away @ away)
    phase, period = float(stamps.mean()), float(away @ (stamps - stamps.mean()) / spread)
    scatter = stamps - phase - period * away
    sigma = float(np.sqrt(scatter @ scatter / (len(stamps) - 2)))
    return _Line(phase, period, max(jitter, sigma), centre, sigma / len(stamps) ** 0.5, sigma / spread**0.5)


def _slack(stamps: Floats, latest: Ints, is_late: Bools, line: _Line) -> Ints:
    """(N,) how many numbers lower each frame of a burst could be: what was lost with it may have been newer.

    A burst goes on from a late frame to the first that comes by itself, or on time and not in the wake of another.
    """
    slack = np.zeros(len(stamps), np.int64)
    interval = np.diff(stamps, prepend=-np.inf) / line.period
    on_time = min(3 * line.jitter / line.period, LATE_PERIODS / 2)
    is_alone = interval >= LATE_PERIODS
    is_on_time = (np.abs(line.position(stamps) - latest) <= max(on_time, 1e-6)) & (interval >= WAKE_PERIODS)
    in_burst = False
    for k in range(1, len(stamps)):
        goes_on = in_burst and not is_alone[k] and not is_on_time[k]
        if is_late[k] or goes_on:
            slack[k] = (slack[k - 1] if in_burst else 0) + latest[k] - latest[k - 1] - 1
        in_burst = bool(is_late[k] or goes_on)
    return slack


def _mean_square_error(slack: Ints) -> Floats:
    """(N,) variance of the middle one of slack + 1 equally likely numbers, in periods squared."""
    below = slack - slack // 2
    lengths = np.stack([slack // 2, below]).astype(np.float64)
    squares = lengths * (lengths + 1) * (2 * lengths + 1) / 6
    return np.asarray(squares.sum(axis=0) / (slack + 1))

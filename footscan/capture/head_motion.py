"""Smooths the motion of a head from the controller's reports of its place.

The reports, ten or twenty a second, are exact in place (whole steps) and uncertain in time (some milliseconds, since
they were true at an unknown moment between question and answer). Between them a head can speed up, slow down or stop.
So the motion is smoothed as a velocity that wanders (Rauch, Tung, Striebel: "Maximum likelihood estimates of linear
dynamic systems", AIAA Journal 3 (1965) 1445-1450), by an amount inferred from the reports around: evenly moving heads
are averaged over many reports, and where the speed changes only the nearest ones count, and the uncertainty says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STEP_MM = 0.0125
"""One step of 80 a millimetre: places between two are not told apart."""
FASTEST_MM_PER_S = 200.0
LEAST_WANDER = 0.05
"""mm^2/s^3: changes of speed that an even motion may still have; within a second about 0.2 mm/s."""
NEIGHBOURS = 6
"""Changes of speed at this many reports to either side count for an interval. Chosen by hand."""


@dataclass(frozen=True)
class HeadReports:
    """Where one head was reported to be. All arrays have shape (L,)."""

    seconds: Floats
    """`time.monotonic()`, ascending."""
    seconds_sd: Floats
    """Standard deviation of these."""
    x_mm: Floats
    """X in mm, scanner frame."""
    stands: Bools | None = None
    """True where the controller holds the head or has given it no target; None: False everywhere."""


@dataclass(frozen=True)
class HeadMotion:
    """A head's motion: place and speed at each report, and all that is needed to interpolate."""

    seconds: Floats
    """(L,)"""
    states: Floats
    """(L, 2) X in mm and speed in mm/s."""
    covariances: Floats
    """(L, 2, 2)"""
    crossed: Floats
    """(L - 1, 2, 2) covariances of each state with the next."""
    range_mm: Floats
    """(L - 1, 2) least and greatest X of the two reports to either side of an interval: no curve goes beyond, for a
    head that has stopped does not swing back."""
    wander: Floats
    """(L - 1,) spectral density of the acceleration between two reports, mm^2/s^3."""
    stands: Bools
    """(L,) where the controller says that the head stands."""

    def at(self, seconds: Floats) -> tuple[Floats, Floats, Floats]:
        """X in mm, speed in mm/s and standard deviation of X in mm at times within the reports, each (N,)."""
        k = np.clip(np.searchsorted(self.seconds, seconds, side="right") - 1, 0, len(self.wander) - 1)
        step = self.seconds[k + 1] - self.seconds[k]
        u = (seconds - self.seconds[k]) / step
        # The mean of a motion whose velocity wanders, its ends given, is Hermite's cubic.
        place = _hermite(u, step)
        slope = _hermite_slope(u, step)
        ends = np.concatenate([self.states[k], self.states[k + 1]], axis=1)
        joint = np.block(
            [
                [self.covariances[k], self.crossed[k]],
                [np.swapaxes(self.crossed[k], 1, 2), self.covariances[k + 1]],
            ]
        )
        of_ends = np.einsum("na,nab,nb->n", place, joint, place)
        between = self.wander[k] * (step * u * (1.0 - u)) ** 3 / 3.0
        sd = np.sqrt(np.maximum(of_ends + between, 0.0))
        x = np.clip(np.einsum("na,na->n", place, ends), *self.range_mm[k].T)
        return x, np.einsum("na,na->n", slope, ends), sd

    def may_stand(self, seconds: Floats, within_mm: Floats) -> Bools:
        """(N,) whether the controller may have held the head at times within the reports: the report before or behind
        says so, and the head was no farther from there. Of a motor that pauses the controller knows nothing."""
        x, _, _ = self.at(seconds)
        before = np.clip(np.searchsorted(self.seconds, seconds, side="right") - 1, 0, len(self.wander) - 1)
        near = [self.stands[k] & (np.abs(x - self.states[k, 0]) <= within_mm) for k in (before, before + 1)]
        return np.asarray(near[0] | near[1])


def smooth_motion(reports: HeadReports, step_mm: float = STEP_MM) -> HeadMotion:
    """The motion behind `reports`; `step_mm` is how finely the controller tells places apart.

    Raises
    ------
    RefusedInput
        Fewer than three reports, or times that do not ascend.
    """
    if len(reports.seconds) < 3 or not np.all(np.diff(reports.seconds) > 0.0):
        raise RefusedInput("position log", f"{len(reports.seconds)} reports, expected three or more at ascending times")
    steps = np.diff(reports.seconds)
    speeds = np.diff(reports.x_mm) / steps
    # Of the speeds before and after a report the greater one: it may have been true just before a stop.
    at_reports = np.maximum(np.abs(np.append(speeds[:1], speeds)), np.abs(np.append(speeds, speeds[-1:])))
    variances = (at_reports * reports.seconds_sd) ** 2 + step_mm**2 / 12.0
    wander = _wander(steps, speeds, variances)

    count = len(steps) + 1
    states, covariances = np.zeros((count, 2)), np.zeros((count, 2, 2))
    ahead, ahead_covariances = np.zeros((count, 2)), np.zeros((count, 2, 2))
    state, covariance = np.array([reports.x_mm[0], 0.0]), np.diag([1e4, FASTEST_MM_PER_S**2])
    for k in range(count):
        if k > 0:
            moved = _transition(steps[k - 1])
            state, covariance = moved @ state, moved @ covariance @ moved.T + _noise(steps[k - 1], wander[k - 1])
        ahead[k], ahead_covariances[k] = state, covariance
        gain = covariance[:, 0] / (covariance[0, 0] + variances[k])
        state = state + gain * (reports.x_mm[k] - state[0])
        covariance = covariance - np.outer(gain, covariance[0])
        states[k], covariances[k] = state, covariance

    crossed = np.zeros((count - 1, 2, 2))
    for k in range(count - 2, -1, -1):
        back = covariances[k] @ _transition(steps[k]).T @ np.linalg.inv(ahead_covariances[k + 1])
        states[k] += back @ (states[k + 1] - ahead[k + 1])
        covariances[k] += back @ (covariances[k + 1] - ahead_covariances[k + 1]) @ back.T
        crossed[k] = back @ covariances[k + 1]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(reports.x_mm, 1, mode="edge"), 4)
    range_mm = np.stack([around.min(axis=1), around.max(axis=1)], axis=1)
    stands = np.zeros(count, bool) if reports.stands is None else reports.stands
    return HeadMotion(reports.seconds, states, covariances, crossed, range_mm, wander, stands)


def _wander(steps: Floats, speeds: Floats, variances: Floats) -> Floats:
    """How much the velocity wanders in each interval, from how much mean speeds differ from one to the next.

    For a wander q, mean speeds over neighbouring intervals h and h' differ by a variance of q (h + h') / 3, and by that
    of the three reports besides.
    """
    change = np.diff(speeds) ** 2
    before, after = steps[:-1], steps[1:]
    of_reports = variances[:-2] / before**2 + variances[1:-1] * (1 / before + 1 / after) ** 2 + variances[2:] / after**2
    wander = 3.0 * np.maximum(change - of_reports, 0.0) / (before + after)
    padded = np.pad(wander, NEIGHBOURS, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    # An interval between two reports has the larger of the changes at its ends, and no less than is usual around it.
    at_reports = np.concatenate([wander[:1], wander, wander[-1:]])
    usual = np.concatenate([around.mean(axis=1)[:1], around.mean(axis=1), around.mean(axis=1)[-1:]])
    return np.asarray(
        np.maximum.reduce([at_reports[:-1], at_reports[1:], usual[:-1], usual[1:]]) + LEAST_WANDER, np.float64
    )


def _transition(step: float) -> Floats:
    return np.array([[1.0, step], [0.0, 1.0]])


def _noise(step: float, wander: float) -> Floats:
    return wander * np.array([[step**3 / 3.0, step**2 / 2.0], [step**2 / 2.0, step]])


def _hermite(u: Floats, step: Floats) -> Floats:
    """(N, 4) weights of X and speed at the start and the end of an interval in X at the part `u` of it."""
    return np.stack(
        [(1 + 2 * u) * (1 - u) ** 2, step * u * (1 - u) ** 2, u**2 * (3 - 2 * u), -step * u**2 * (1 - u)], axis=1
    )


def _hermite_slope(u: Floats, step: Floats) -> Floats:
    """The same for the speed."""
    return np.stack([-6 * u * (1 - u) / step, (1 - u) * (1 - 3 * u), 6 * u * (1 - u) / step, u * (3 * u - 2)], axis=1)

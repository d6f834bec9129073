"""The motion behind a controller's reports: right where speed changes, and as uncertain as it says."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.capture.head_motion import HeadReports, smooth_motion
from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]

SPEED, ACCELERATION, LENGTH = 36.4, 500.0, 400.0


def true_travel(pause_at: float, ripple: float = 0.05, ripple_hz: float = 1.3) -> tuple[Floats, Floats]:
    """Seconds and X of a travel of 40 cm with a ripple in its speed and a pause of a second."""
    step = 5e-4
    seconds = np.arange(0.0, 16.0, step)
    x, speed, place = np.zeros(len(seconds)), 0.0, 0.0
    for k, now in enumerate(seconds):
        x[k] = place
        wanted = 0.0 if now < 1.0 or pause_at <= now < pause_at + 1.0 else SPEED
        wanted = min(wanted, np.sqrt(2.0 * ACCELERATION * max(LENGTH - place, 0.0)))
        speed += float(np.clip(wanted - speed, -ACCELERATION * step, ACCELERATION * step))
        place = min(place + speed * (1.0 + ripple * np.sin(2.0 * np.pi * ripple_hz * now)) * step, LENGTH)
    return seconds, x


def reported(seconds: Floats, x: Floats, hz: float, sd_s: float, seed: int) -> HeadReports:
    """What a controller would say: whole steps, at times that are known to some milliseconds."""
    random = np.random.default_rng(seed)
    at = np.arange(0.05, seconds[-1] - 0.05, 1.0 / hz)
    at = at + random.uniform(0.0, 0.3 / hz, len(at))
    places = np.round(np.interp(at, seconds, x) * 80.0) / 80.0
    return HeadReports(at + random.normal(0.0, sd_s, len(at)), np.full(len(at), sd_s), places)


@pytest.mark.parametrize(("hz", "sd_s", "largest_mm"), [(10.0, 0.003, 0.5), (20.0, 0.0005, 0.12)])
def test_ripple_and_pause_are_followed_and_uncertainty_is_true(hz: float, sd_s: float, largest_mm: float) -> None:
    errors, deviations = [], []
    for seed in range(6):
        seconds, x = true_travel(pause_at=3.0 + 0.31 * seed)
        motion = smooth_motion(reported(seconds, x, hz, sd_s, seed))
        at = np.arange(0.5, 15.0, 0.055)
        found, speed, sd = motion.at(at)
        errors.append(found - np.interp(at, seconds, x))
        deviations.append(sd)
        assert np.median(speed[(at > 1.5) & (at < 3.0)]) == pytest.approx(SPEED, rel=0.04)
        standing = (at > 3.4 + 0.31 * seed) & (at < 3.7 + 0.31 * seed)
        assert np.abs(errors[-1][standing]).max() < 0.02
    error, deviation = np.concatenate(errors), np.concatenate(deviations)
    assert np.abs(error).max() < largest_mm
    ratio = error / deviation
    assert 0.93 < np.mean(np.abs(ratio) < 2.0) <= 1.0
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.25


def test_even_motion_is_averaged_over_many_reports() -> None:
    random = np.random.default_rng(1)
    at = np.arange(0.0, 10.0, 0.1)
    motion = smooth_motion(HeadReports(at + random.normal(0.0, 0.005, 100), np.full(100, 0.005), 36.0 * at))
    middle = np.arange(2.0, 8.0, 0.05)
    found, _, sd = motion.at(middle)
    # One report is good to 36 mm/s x 5 ms = 0.18 mm.
    assert np.sqrt(np.mean((found - 36.0 * middle) ** 2)) < 0.1
    assert np.median(sd) < 0.12


def test_reports_that_are_missing_make_places_uncertain() -> None:
    seconds, x = true_travel(pause_at=20.0)
    reports = reported(seconds, x, 10.0, 0.001, 1)
    kept = (reports.seconds < 5.0) | (reports.seconds > 6.5)
    motion = smooth_motion(HeadReports(reports.seconds[kept], reports.seconds_sd[kept], reports.x_mm[kept]))
    _, _, sd = motion.at(np.array([4.0, 5.75]))
    assert sd[0] < 0.1
    assert sd[1] > 5 * sd[0]


def test_exact_reports_of_an_even_motion_give_it_back() -> None:
    at = np.linspace(0.0, 1.0, 11)
    found, speed, sd = smooth_motion(HeadReports(at, np.full(11, 1e-6), 100.0 - 20.0 * at)).at(
        np.array([0.05, 0.5, 0.91])
    )
    assert found == pytest.approx([99.0, 90.0, 81.8], abs=0.01)
    assert speed == pytest.approx([-20.0] * 3, abs=0.1)
    assert np.all(sd < 0.02)


@pytest.mark.parametrize("seconds", [[0.0, 0.1], [0.0, 0.2, 0.1], [0.0, 0.1, 0.1]])
def test_too_few_reports_and_time_that_runs_back_are_refused(seconds: list[float]) -> None:
    at = np.array(seconds)
    with pytest.raises(RefusedInput, match="expected three or more at ascending times"):
        smooth_motion(HeadReports(at, np.full(len(at), 0.001), at))

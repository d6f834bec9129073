"""The latency of a camera from passes over a block: true within its uncertainty, or refused."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.capture.head_motion import HeadReports, smooth_motion
from footscan.capture.latency import Latency, Pass, estimate_latency
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from schemas.base.errors import Finding

Floats = NDArray[np.float64]

LENGTH, BREADTH, HEIGHT, TURN = 150.0, 100.0, 50.0, np.radians(5.0)
PIXELS = np.array([[3.2, 1.1], [-0.9, 2.7]])
"""Of an oblique camera far away, px a mm of Y and Z."""
CENTRE = np.array([300.0, 170.0])
PERIOD = 0.055
REPORT_SD = 0.002
FORTH_AND_BACK = (36.0, -36.0, 12.0, -12.0)


def block_stripe(x: float, random: np.random.Generator) -> Floats:
    """(N, 2) px of the stripe over the top and one side of a turned block, the laser plane standing at X = `x`."""
    across = np.arange(-BREADTH / 2.0, BREADTH / 2.0, 0.35)
    along = (x + np.sin(TURN) * across) / np.cos(TURN)
    y = (np.sin(TURN) * along + np.cos(TURN) * across)[np.abs(along) <= LENGTH / 2.0]
    places = [np.column_stack([y, np.full(len(y), HEIGHT)])]
    if len(y):
        upright = np.arange(0.0, HEIGHT, 0.35)
        places.append(np.column_stack([np.full(len(upright), y.max()), upright]))
    pixels = np.concatenate(places) @ PIXELS.T + CENTRE
    pixels += random.normal(0.0, 0.15, pixels.shape)
    return pixels[random.random(len(pixels)) > 0.02]


def one_pass(
    speed: float,
    latency: float,
    random: np.random.Generator,
    *,
    start: float,
    exposure_jitter: float = 0.0,
    delivery_jitter: float = 0.0,
    play: float = 0.0,
    shift: float = 0.0,
) -> Pass:
    """A pass at `speed` with a ripple of 5 %; the object was moved by `shift`."""
    lasting = 220.0 / abs(speed)
    at = np.arange(0.0, lasting + 1.6, 1e-3)
    gone = np.clip(at - 0.8, 0.0, lasting)
    gone = np.clip(gone + 0.05 / (2 * np.pi * 1.3) * (1.0 - np.cos(2 * np.pi * 1.3 * gone)), 0.0, lasting)
    x = np.sign(speed) * (abs(speed) * gone - 110.0)
    reports = np.arange(0.02, at[-1], 0.1)
    motion = smooth_motion(
        HeadReports(
            start + reports + random.normal(0.0, REPORT_SD, len(reports)),
            np.full(len(reports), REPORT_SD),
            np.round(np.interp(reports, at, x) * 80.0) / 80.0,
        )
    )
    due = np.arange(0.3 + PERIOD * random.random(), at[-1] - 0.3, PERIOD)
    exposed = due + random.uniform(-exposure_jitter, exposure_jitter, len(due))
    rows: list[StripePoints] = []
    for frame, seconds in enumerate(exposed):
        pixels = block_stripe(float(np.interp(seconds, at, x)) - play * np.sign(speed) / 2.0 - shift, random)
        points = np.zeros(len(pixels), STRIPE_DTYPE)
        points["frame"], points["i"], points["j"] = frame, *pixels.T
        rows.append(points)
    delay = exposed - due + random.uniform(-delivery_jitter, delivery_jitter, len(due))
    return Pass(np.concatenate(rows), start + due + latency, delay, motion)


def passes(seed: int, latency: float, speeds: tuple[float, ...] = FORTH_AND_BACK, **how: float) -> list[Pass]:
    random = np.random.default_rng(seed)
    return [one_pass(speed, latency, random, start=100.0 * k, **how) for k, speed in enumerate(speeds)]


@pytest.fixture(scope="module")
def estimates() -> list[tuple[float, Latency]]:
    """True and estimated latencies of cameras between 20 and 120 ms, their exposures uneven by up to 10 ms."""
    latencies = np.linspace(0.02, 0.12, 5)
    return [
        (float(latency), estimate_latency(1, passes(seed, float(latency), exposure_jitter=0.01, play=0.15)))
        for seed, latency in enumerate(latencies)
    ]


def test_latency_is_true_within_its_uncertainty(estimates: list[tuple[float, Latency]]) -> None:
    off = np.array([found.seconds - true for true, found in estimates])
    sd = np.array([found.sd_s for _, found in estimates])
    assert np.abs(off).max() < 0.004
    assert np.all(sd < 0.002)
    assert np.all(np.abs(off) < 4.0 * sd)
    assert np.sqrt(np.mean((off / sd) ** 2)) < 2.5


def test_play_is_told_from_latency_by_two_speeds(estimates: list[tuple[float, Latency]]) -> None:
    assert np.mean([found.play_mm for _, found in estimates]) == pytest.approx(0.15, abs=0.05)


def test_whose_delays_they_are_is_told(estimates: list[tuple[float, Latency]]) -> None:
    assert min(found.exposure_share for _, found in estimates) > 0.6
    of_delivery = estimate_latency(1, passes(7, 0.05, delivery_jitter=0.01))
    assert of_delivery.exposure_share < 0.4
    assert of_delivery.seconds == pytest.approx(0.05, abs=0.004)


def test_an_even_camera_has_no_share_to_find() -> None:
    assert estimate_latency(1, passes(8, 0.03)).exposure_share == 0.0


def test_at_one_speed_play_makes_the_latency_less_certain() -> None:
    found = estimate_latency(1, passes(3, 0.05, speeds=(36.0, -36.0, 36.0, -36.0), play=0.1))
    # 0.1 mm of play is as a latency of 0.1 / 2 / 36 = 1.4 ms.
    assert found.sd_s > 0.001
    assert abs(found.seconds - 0.05) < 3.0 * found.sd_s


def test_passes_one_way_tell_nothing() -> None:
    with pytest.raises(Finding, match=r"camera 3: all passes go at 36 mm/s, expected passes in both directions"):
        estimate_latency(3, passes(1, 0.05, speeds=(36.0, 36.0)))


def test_an_object_that_is_not_seen_is_told() -> None:
    blind = passes(1, 0.05, speeds=(36.0, -36.0))
    blind[1] = Pass(blind[1].stripe[:0], blind[1].seconds, blind[1].delay_s, blind[1].motion)
    with pytest.raises(Finding, match="camera 2 sees the object in 0 frames of a pass, expected 20"):
        estimate_latency(2, blind)


def test_an_object_that_was_moved_between_passes_is_told() -> None:
    still, moved = passes(1, 0.05), passes(2, 0.05, shift=5.0)
    with pytest.raises(Finding, match=r"camera 1: .*(moved|passes)"):
        estimate_latency(1, [still[0], moved[1], still[2], moved[3]])

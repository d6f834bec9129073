import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from footscan.capture.cameras.frame_clock import FrameTimes, RunningNumber, number_frames
from schemas.base.errors import RefusedInput

PERIOD_S = 0.055
"""200 frames in 11 s."""


def test_an_even_row() -> None:
    stamps = 100 + PERIOD_S * np.arange(50)
    times = number_frames(stamps)
    assert times.number.tolist() == list(range(50))
    assert times.period_s == pytest.approx(PERIOD_S, abs=1e-9)
    assert times.seconds == pytest.approx(stamps, abs=1e-6)
    assert times.missing.size == 0
    assert not times.is_late.any()
    assert times.is_certain.all()


def test_lost_frames_leave_their_numbers_empty() -> None:
    numbers = np.delete(np.arange(60), [7, 20, 21, 22])
    times = number_frames(PERIOD_S * numbers)
    assert times.number.tolist() == numbers.tolist()
    assert times.missing.tolist() == [7, 20, 21, 22]
    assert times.is_certain.all()


def test_a_late_frame_keeps_its_number() -> None:
    stamps = PERIOD_S * np.arange(40)
    stamps[[12, 30]] += 0.8 * PERIOD_S
    times = number_frames(stamps)
    assert times.number.tolist() == list(range(40))
    assert np.flatnonzero(times.is_late).tolist() == [12, 30]
    assert times.delay_s[12] == pytest.approx(0.8 * PERIOD_S, abs=1e-6)
    assert times.seconds[12] == pytest.approx(PERIOD_S * 12, abs=1e-6)


def test_a_late_frame_before_a_lost_one_is_not_taken_for_it() -> None:
    numbers = np.delete(np.arange(40), 13)
    stamps = PERIOD_S * numbers
    stamps[12] += 0.6 * PERIOD_S
    times = number_frames(stamps)
    assert times.number.tolist() == numbers.tolist()
    assert times.missing.tolist() == [13]


def test_a_burst_after_a_stall_is_numbered_backwards_from_what_follows() -> None:
    stamps = PERIOD_S * np.arange(60)
    stamps[20:30] = PERIOD_S * 29.2 + 0.001 * np.arange(10)
    times = number_frames(stamps)
    assert times.number.tolist() == list(range(60))
    assert np.flatnonzero(times.is_late).tolist() == list(range(20, 29))
    assert times.is_certain.all()


def test_numbers_that_nobody_can_tell_say_so() -> None:
    """Ten exposures in a stall, seven frames in the burst after it: the three lost ones may be any."""
    stamps = PERIOD_S * np.arange(60)
    stamps[20:30] = PERIOD_S * 29.2 + 0.001 * np.arange(10)
    kept = np.delete(np.arange(60), [22, 25, 26])
    times = number_frames(stamps[kept])
    assert np.flatnonzero(~times.is_certain).tolist() == list(range(20, 27))
    assert (times.number[times.is_certain] == kept[times.is_certain]).all()
    off = np.abs(times.number - kept) * PERIOD_S
    assert (off <= 2 * PERIOD_S + 1e-9).all()
    # Of four equally likely numbers the second highest: off by 1, 0, 1 or 2, so by the root of (1 + 0 + 1 + 4) / 4.
    assert times.sd_s[20:27] == pytest.approx(np.full(7, PERIOD_S * 1.5**0.5), rel=1e-6)
    assert times.sd_s[times.is_certain].max() < 1e-6


def test_a_copy_has_the_number_of_the_frame_before() -> None:
    stamps = np.insert(PERIOD_S * np.arange(40), 11, PERIOD_S * 10 + 0.002)
    is_repeated = np.arange(41) == 11
    times = number_frames(stamps, is_repeated)
    assert times.number.tolist() == [*range(11), 10, *range(11, 40)]


def test_a_frozen_picture_has_numbers_of_its_own() -> None:
    is_repeated = (np.arange(40) >= 15) & (np.arange(40) < 20)
    assert number_frames(PERIOD_S * np.arange(40), is_repeated).number.tolist() == list(range(40))


def test_the_camera_runs_a_little_faster_than_it_says() -> None:
    times = number_frames(0.98 * PERIOD_S * np.arange(300), period_s=PERIOD_S)
    assert times.number.tolist() == list(range(300))
    assert times.period_s == pytest.approx(0.98 * PERIOD_S, abs=1e-9)


def test_every_second_frame_of_the_promised_rate_is_missing() -> None:
    times = number_frames(2 * PERIOD_S * np.arange(100), period_s=PERIOD_S)
    assert times.number.tolist() == list(range(0, 200, 2))
    assert times.missing.tolist() == list(range(1, 198, 2))


def test_the_camera_does_not_keep_what_it_promised() -> None:
    """25 frames a second instead of 30, as many do in weak light."""
    times = number_frames(np.arange(100) / 25, period_s=1 / 30)
    assert times.number.tolist() == list(range(100))
    assert times.period_s == pytest.approx(1 / 25, abs=1e-9)


def test_one_frame_and_a_period() -> None:
    assert number_frames(np.array([5.0]), period_s=PERIOD_S).number.tolist() == [0]


@pytest.mark.parametrize(
    ("stamps", "problem"),
    [([], "at least one frame"), ([1.0, 0.9], "never run back"), ([1.0, np.nan], "never run back"), ([1.0], "period")],
)
def test_stamps_that_cannot_be_numbered(stamps: list[float], problem: str) -> None:
    with pytest.raises(RefusedInput, match=problem):
        number_frames(np.array(stamps))


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    frames=st.integers(60, 800),
    rate=st.floats(15, 25),
    lost=st.floats(0, 0.3),
    jitter_ms=st.floats(0, 10),
)
@example(seed=2_505_324_316, frames=60, rate=15.0, lost=0.28125, jitter_ms=0.0)  # the median interval is two periods
def test_jitter_and_losses_do_not_move_a_number(
    seed: int, frames: int, rate: float, lost: float, jitter_ms: float
) -> None:
    random = np.random.default_rng(seed)
    numbers = np.flatnonzero(random.random(frames) >= lost)
    exposed = 1e5 * random.random() + numbers / rate
    times = number_frames(exposed + random.uniform(0, 1e-3 * jitter_ms, len(numbers)))
    assert (times.number == numbers - numbers[0]).all()
    assert times.is_certain[:-1].all()
    assert times.is_certain[-1] == (numbers[-1] - numbers[-2] == 1)  # nothing shows whether it was late
    _assert_covers(times, exposed)


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    stalls=st.integers(1, 4),
    length=st.integers(2, 15),
    lost=st.floats(0, 0.15),
    jitter_ms=st.floats(0, 10),
)
def test_bursts_never_give_a_wrong_number_for_certain(
    seed: int, stalls: int, length: int, lost: float, jitter_ms: float
) -> None:
    """A stall holds frames back; those that follow it are certain, those of the burst are if none of them was lost."""
    random = np.random.default_rng(seed)
    numbers = np.flatnonzero(random.random(200) >= lost)
    stamps = PERIOD_S * numbers + random.uniform(0, 1e-3 * jitter_ms, len(numbers))
    in_stall = np.zeros(len(numbers), bool)
    for place in range(stalls):
        first = 30 + 40 * place
        held = (numbers >= first) & (numbers < first + length)
        stamps[held] = np.maximum(stamps[held], PERIOD_S * (first + length - 0.2))
        in_stall |= held
    stamps = np.maximum.accumulate(stamps)
    times = number_frames(stamps)
    right = times.number == numbers - numbers[0]
    is_apart = np.diff(stamps, prepend=-np.inf) >= PERIOD_S / 2
    assert right[~in_stall & is_apart].all()
    assert right[times.is_certain & ~_after_a_loss_in_the_stall(numbers, in_stall)].all()
    assert (np.abs(times.number - numbers + numbers[0])[~right] * PERIOD_S <= length * PERIOD_S).all()


def delayed_by_a_busy_host(random: np.random.Generator, mean_s: float, goes_s: float) -> tuple[np.ndarray, float]:
    """Stamps of 170 frames of which none is lost, of a host that is busy in spells, and their usual latency."""
    latency = random.uniform(0.02, 0.06)
    exposed = PERIOD_S * np.arange(170)
    is_busy, waits = False, np.zeros(170)
    for frame in range(170):
        is_busy = random.random() >= goes_s if is_busy else random.random() < 0.02
        waits[frame] = random.exponential(mean_s if is_busy else 0.001)
    return np.maximum.accumulate(exposed + latency + random.uniform(-0.01, 0.01, 170) + waits), latency


def test_a_busy_host_makes_no_film_that_is_a_frame_off_unnoticed() -> None:
    refused, off_by_a_period = 0, 0
    for seed in range(150):
        random = np.random.default_rng([seed, 1])
        stamps, latency = delayed_by_a_busy_host(random, random.choice([0.01, 0.03, 0.06]), 0.02)
        times = number_frames(stamps, None, PERIOD_S)
        off = np.abs(times.seconds - latency - PERIOD_S * np.arange(170)) / PERIOD_S
        off_by_a_period += bool(np.median(off) > 0.5)
        problem = times.problem(0.0, np.inf)
        refused += problem is not None
        assert problem is not None or np.median(off) < 0.5
    assert off_by_a_period
    assert refused < 150


def test_a_few_late_frames_make_no_film_doubtful() -> None:
    stamps = PERIOD_S * np.arange(100)
    stamps[5:100:6] += 0.7 * PERIOD_S
    assert number_frames(stamps).problem(0.0, np.inf) is None


def test_frames_that_were_late_at_another_time_make_no_film_doubtful() -> None:
    stamps = PERIOD_S * np.arange(1000)
    stamps[4:100:4] += 0.7 * PERIOD_S
    times = number_frames(stamps)
    assert times.problem(stamps[100], np.inf) is None
    assert str(times.problem(0.0, stamps[99])).startswith("24 of 100 frames came late, which leaves open when ")


def test_a_running_number_leaves_gaps() -> None:
    running = RunningNumber()
    numbers = np.delete(np.arange(40), [10, 20, 21])
    assert [running.next(PERIOD_S * n) for n in numbers] == numbers.tolist()


def test_eight_thousand_frames_are_numbered() -> None:
    random = np.random.default_rng(1)
    numbers = np.flatnonzero(random.random(8000) > 0.01)
    times = number_frames(PERIOD_S * 1.0003 * numbers + random.uniform(0, 0.01, len(numbers)), period_s=PERIOD_S)
    assert (times.number == numbers - numbers[0]).all()


def _after_a_loss_in_the_stall(numbers: np.ndarray, in_stall: np.ndarray) -> np.ndarray:
    """A frame that was held back behind a lost one may come just when the lost one's follower is due."""
    lost_before = np.diff(numbers, prepend=numbers[0] - 1) > 1
    lost_after = np.diff(numbers, append=numbers[-1] + 1) > 1
    touched = np.zeros(len(numbers), bool)
    for start in np.flatnonzero(in_stall & ~np.roll(in_stall, 1)):
        stop = start + int(np.argmin(np.append(in_stall[start:], False)))
        touched[start:stop] = lost_before[start : stop + 1].any() or lost_after[max(start - 1, 0) : stop].any()
    return touched


def _assert_covers(times: FrameTimes, exposed: np.ndarray) -> None:
    """The times are the exposures', but for one latency: up to five of their standard deviations."""
    off = times.seconds - exposed
    assert (np.abs(off - np.mean(off)) <= 5 * times.sd_s + 1e-6).all()

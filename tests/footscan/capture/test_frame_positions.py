"""X of each frame: lost frames keep their place, frames of a standing head are left out, nothing is guessed."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.capture.frame_positions import FramePositions, Timed, frame_positions, write_positions
from footscan.capture.head_motion import HeadMotion, HeadReports, smooth_motion
from footscan.frames.travel import read_positions
from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PERIOD = 0.055


def true_x(seconds: Floats) -> Floats:
    """Stands at 0 until 1 s, goes 36 mm/s, stands from 4 s to 5 s, goes on until 8 s."""
    return 36.0 * (np.clip(seconds, 1.0, 4.0) - 1.0 + np.clip(seconds, 5.0, 8.0) - 5.0)


@pytest.fixture(scope="module")
def motion() -> HeadMotion:
    at = np.arange(0.0, 9.01, 0.05)
    return smooth_motion(HeadReports(at, np.full(len(at), 0.001), true_x(at)))


def film(motion: HeadMotion, number: Ints, latency: float = 0.08, sd_s: float = 0.001) -> FramePositions:
    seconds = 0.2 + PERIOD * number + latency
    return frame_positions(number, seconds, np.full(len(number), sd_s), motion, Timed(latency, 0.001))


def test_frames_are_where_the_head_was_when_they_were_taken(motion: HeadMotion) -> None:
    positions = film(motion, np.arange(150))
    error = positions.x_mm - true_x(0.2 + PERIOD * positions.number)
    assert np.abs(error).max() < 0.2
    assert np.mean(np.abs(error) < 2.0 * positions.sd_mm) > 0.95
    assert positions.mm_per_s == pytest.approx(36.0, rel=0.01)
    assert positions.shared_sd_mm == pytest.approx(0.036, rel=0.02)
    assert not positions.is_lost.any()


def test_of_a_standing_head_one_frame_is_kept(motion: HeadMotion) -> None:
    positions = film(motion, np.arange(150))
    assert np.diff(positions.x_mm).min() > 0.09
    # 18 exposures in the second, of which the first shows what all show.
    standing = [number for number in positions.dropped if 4.05 < 0.2 + PERIOD * number < 5.0]
    assert 16 <= len(standing) <= 18
    assert all("the head stood where it was at frame" in positions.dropped[number] for number in standing)
    assert len(positions.number) + len(positions.dropped) == 150


def test_a_lost_frame_keeps_its_place(motion: HeadMotion) -> None:
    every = np.arange(150)
    positions = film(motion, np.delete(every, [30, 31, 45]))
    whole = film(motion, every)
    assert positions.number.tolist() == whole.number.tolist()
    assert positions.number[positions.is_lost].tolist() == [30, 31, 45]
    assert positions.x_mm == pytest.approx(whole.x_mm, abs=1e-6)


def test_a_standing_head_s_lost_frame_is_made_up_for_by_the_next(motion: HeadMotion) -> None:
    first_standing = int(film(motion, np.arange(150)).number[0])
    positions = film(motion, np.delete(np.arange(150), 1))
    assert first_standing == 0
    assert positions.number[0] == 0
    later = next(number for number in film(motion, np.arange(150)).number if 4.0 < 0.2 + PERIOD * number < 4.2)
    positions = film(motion, np.delete(np.arange(150), later))
    assert "lost, at the place of frame" in positions.dropped[int(later)]
    assert not positions.is_lost.any()


def test_frames_outside_of_the_reports_are_dropped_with_the_reason(motion: HeadMotion) -> None:
    positions = film(motion, np.arange(-10, 170))
    assert positions.dropped[-10] == "taken before the first report of the head's place"
    assert positions.dropped[169] == "taken after the last report of the head's place"


def test_a_frame_whose_place_nobody_knows_is_dropped() -> None:
    at = np.concatenate([np.arange(0.0, 4.0, 0.1), np.arange(6.0, 9.0, 0.1)])  # two seconds are missing
    motion = smooth_motion(HeadReports(at, np.full(len(at), 0.002), true_x(at)))
    positions = film(motion, np.arange(10, 140))
    inside = [number for number in range(10, 140) if 4.3 < 0.2 + PERIOD * number < 5.7]
    assert all("reports are missing around it" in positions.dropped[number] for number in inside)


@pytest.mark.parametrize("number", [[], [3, 3], [4, 2]])
def test_frames_that_are_none_or_out_of_order_are_refused(motion: HeadMotion, number: list[int]) -> None:
    with pytest.raises(RefusedInput, match="expected some, their numbers ascending"):
        film(motion, np.array(number, np.int64))


def test_positions_are_written_as_a_scan_reads_them(tmp_path: Path) -> None:
    write_positions(tmp_path / "cam1.csv", [0.0, 1.98765432, -3.5])
    assert (tmp_path / "cam1.csv").read_text() == "frame,x_mm\n0,0.0000\n1,1.9877\n2,-3.5000\n"
    assert read_positions(tmp_path / "cam1.csv") == pytest.approx([0.0, 1.9877, -3.5])

"""Which frames make a film: none that is missing goes unsaid, none of a held head passes for a picture."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.capture.board.head import Travel
from footscan.capture.board.position_log import HeadPosition, PositionLog
from footscan.capture.cameras.frame_clock import number_frames
from footscan.capture.film_frames import CameraTiming, FilmFrames, motion_of_head, place_frames
from footscan.capture.frame_positions import Timed
from footscan.capture.passes import FilmTally

Floats = NDArray[np.float64]

PERIOD_S, LATENCY_S = 0.05, 0.04
STEP_MM = 1.0
HELD_S = (3.0, 4.0)
ENDS_MM = (0.0, 100.0)
TRAVEL = Travel(0.0, 7.0)


def goes_on(seconds: Floats) -> Floats:
    """20 mm/s from -10 mm on, through all of the film."""
    return 20.0 * seconds - 10.0


def is_held(seconds: Floats) -> Floats:
    """The same, but held for a second."""
    return goes_on(np.minimum(seconds, HELD_S[0]) + np.maximum(seconds - HELD_S[1], 0.0))


def film(where: Callable[[Floats], Floats], arrived: NDArray[np.int64], torn: tuple[int, ...] = ()) -> FilmFrames:
    """The film of a camera of whose exposures so many have arrived."""
    log = PositionLog()
    for seconds in np.arange(0.0, 7.01, 0.05):
        x = float(where(np.array(seconds)))
        log.add(HeadPosition(seconds, (x, x, x), 0.001, where is goes_on or not HELD_S[0] <= seconds <= HELD_S[1]))
    clock = number_frames(0.01 + PERIOD_S * arrived + LATENCY_S, None, PERIOD_S)
    problems = {int(np.flatnonzero(arrived == one)[0]): "torn: its end is missing" for one in torn}
    tally = FilmTally(set(range(len(arrived))), problems)
    timing = CameraTiming(Timed(LATENCY_S, 0.001), 0.0, 0.001)
    return place_frames(tally, (0, clock), TRAVEL, motion_of_head(log, 1, TRAVEL), timing, ENDS_MM, 0.3)


EVERY = np.arange(140)


def test_a_film_without_losses_leaves_nothing_out() -> None:
    whole = film(goes_on, EVERY)
    assert (len(whole.arrivals), whole.lost, whole.left_out, whole.problem) == (100, {}, {}, None)


@pytest.mark.parametrize(("arrived", "missing"), [(EVERY[:107], [107, 108, 109]), (EVERY[12:], [])])
def test_what_is_missing_at_an_end_is_told(arrived: NDArray[np.int64], missing: list[int]) -> None:
    made = film(goes_on, arrived)
    assert made.problem is None
    assert sorted(made.left_out) == missing  # before the first frame there are no numbers


def test_frames_that_are_torn_at_the_ends_are_told() -> None:
    ends = (*range(12), *range(108, 140))
    made = film(goes_on, EVERY, torn=ends)
    assert made.left_out == dict.fromkeys([10, 11, 108, 109], "torn: its end is missing")
    assert made.problem is None


def test_more_than_a_few_frames_missing_at_an_end_are_a_hole() -> None:
    made = film(goes_on, EVERY[:104])
    assert made.problem == "6 of 100 frames are lost, the first one: lost at an end of the film"


def test_a_held_head_is_dark_and_gives_no_frame() -> None:
    made = film(is_held, EVERY)
    held = [number for number, why in made.left_out.items() if why.startswith("the controller held the head")]
    exposed = 0.01 + PERIOD_S * made.number
    assert not np.any((exposed >= HELD_S[0]) & (exposed <= HELD_S[1]))
    assert 20 <= len(held) <= 22
    assert made.problem is None

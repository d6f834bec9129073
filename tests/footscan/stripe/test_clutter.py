"""Static pieces and pieces of a single frame, in films written down point by point."""

import numpy as np
import pytest

from footscan.stripe.clutter import is_moving_stripe, number_pieces
from schemas.parameters.extraction import ExtractionParameters

FRAMES = 100
PARAMETERS = ExtractionParameters(glint_share=0.1, glint_length_px=40.0, follow_reach_px=12.0, lonely_length_px=60.0)


def kept(pieces, frames=FRAMES, **parameters):
    """For each piece, (frame, i, j), whether it is kept; by frames, as the film has them."""
    by_frame = sorted(range(len(pieces)), key=lambda n: pieces[n][0])
    centres = np.concatenate([np.stack(np.broadcast_arrays(*pieces[n][1:]), axis=1) for n in by_frame])
    sizes = [np.broadcast(*pieces[n][1:]).size for n in by_frame]
    frame = np.repeat(np.array([pieces[n][0] for n in by_frame], np.int32), sizes)
    piece = np.repeat(np.arange(len(pieces), dtype=np.int32), sizes)
    keep = is_moving_stripe(centres.astype(float), frame, piece, frames, PARAMETERS.model_copy(update=parameters))
    result = [False] * len(pieces)
    for part, n in zip(np.split(keep, np.cumsum(sizes)[:-1]), by_frame, strict=True):
        assert part.all() or not part.any()  # pieces are judged, not points
        result[n] = bool(part.all())
    return result


def row(frame, start, j, length=15):
    return frame, start + np.arange(float(length)), np.float64(j)


def test_a_short_piece_that_stands_still_is_a_glint_and_one_that_moves_is_not():
    still, moving = [row(k, 500, 60) for k in range(12)], [row(k, 100, 50 + 9 * k) for k in range(12)]
    assert kept(still + moving) == [False] * 12 + [True] * 12


def test_a_glint_may_flicker():
    generator = np.random.default_rng(4)
    flicker = [row(k, 500 + generator.uniform(-1.5, 1.5), 62 + generator.uniform(-1.5, 1.5)) for k in range(12)]
    assert not any(kept(flicker))


def test_a_long_piece_may_stand_still():
    assert kept([row(k, 100, 200, 42) for k in range(30)]) == [True] * 30
    assert kept([row(k, 100, 200, 40) for k in range(30)]) == [False] * 30  # from 100 to 139: 39 px


@pytest.mark.parametrize(
    ("frames", "times", "stays"), [(100, 9, True), (100, 10, False), (50, 7, True), (50, 8, False)]
)
def test_a_few_frames_are_no_standing_still(frames, times, stays):
    # a tenth of the film, and eight frames at least
    assert kept([row(k, 500, 60) for k in range(times)], frames) == [stays] * times


def test_a_film_of_a_few_frames_has_no_glints():
    assert kept([row(k, 500, 60) for k in range(7)], frames=7) == [True] * 7
    assert kept([row(k, 500, 60) for k in range(8)], frames=8) == [False] * 8


def test_the_pivot_of_a_turning_stripe_stays():
    t = np.linspace(-40, 40, 81)
    assert kept([(k, 300 + t, 200 + t * np.tan(0.05 * (k - 6))) for k in range(13)]) == [True] * 13


def test_a_piece_of_one_frame_alone_is_noise_unless_it_is_long():
    stripe = [row(k, 100, 50 + 3 * k, 300) for k in range(20)]
    assert kept([*stripe, row(10, 500, 400, 15)]) == [True] * 20 + [False]
    assert kept([*stripe, row(10, 500, 400, 60)]) == [True] * 20 + [False]  # from 500 to 559: 59 px
    assert kept([*stripe, row(10, 500, 400, 61)]) == [True] * 21


def test_a_piece_is_followed_in_the_frame_before_or_after():
    stripe = [row(k, 100, 50 + 3 * k, 300) for k in range(20)]
    assert kept([*stripe, row(10, 500, 400), row(11, 500, 409)]) == [True] * 22  # 9 px on
    assert kept([*stripe, row(10, 500, 400), row(12, 500, 409)]) == [True] * 20 + [False] * 2  # a frame between
    assert kept([*stripe, row(10, 500, 400), row(11, 500, 440)]) == [True] * 20 + [False] * 2  # 40 px on
    # at the ends of the film one side will do
    assert kept([*stripe, row(0, 500, 400), row(1, 500, 409)]) == [True] * 22


def test_a_short_piece_beside_the_moving_stripe_stays():
    stripe = [row(k, 100, 50 + 3 * k, 300) for k in range(20)]
    part = row(10, 405, 80)  # behind a gap, where the stripe of its neighbours ends 6 px before
    assert kept([*stripe, part])[-1] is True


def test_a_glint_is_nobodys_neighbour():
    # twelve frames of a glint, and noise beside it that is nowhere else
    glint = [row(k, 500, 60) for k in range(0, 24, 2)]
    assert kept([*glint, row(5, 500, 70)]) == [False] * 13


def test_two_frames_are_not_held_against_each_other():
    assert kept([row(0, 100, 50), row(1, 100, 400)], frames=2) == [True, True]
    assert kept([row(0, 100, 50), row(1, 100, 400)], frames=3) == [False, False]


def test_points_beside_the_image_have_a_place_too():
    assert kept([(k, np.full(15, -0.4), np.arange(15.0)) for k in range(12)]) == [False] * 12


def test_no_points():
    none = np.zeros(0, np.int32)
    assert is_moving_stripe(np.zeros((0, 2)), none, none, FRAMES, PARAMETERS).shape == (0,)
    assert number_pieces(none, np.zeros(0)).shape == (0,)


def test_pieces_are_numbered_through_the_film():
    frame = np.array([0, 0, 0, 2, 2, 3, 3, 3], np.int32)
    piece = np.array([0.0, 3.0, 0.0, 0.0, 3.0, 5.0, 5.0, 1.0])
    assert number_pieces(frame, piece).tolist() == [0, 1, 0, 2, 3, 4, 4, 5]

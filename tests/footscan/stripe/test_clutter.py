import numpy as np

from footscan.stripe.clutter import on_glint
from footscan.stripe.points import STRIPE_DTYPE
from schemas.parameters.extraction import ExtractionParameters

FRAMES = 100
PARAMETERS = ExtractionParameters(glint_share=0.1, glint_length_px=40.0)


def piece(frame: int, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    points = np.zeros(len(i), STRIPE_DTYPE)
    points["frame"], points["i"], points["j"] = frame, i, j
    return points


def test_a_short_piece_that_stands_still_is_a_glint_and_one_that_moves_is_not() -> None:
    i = np.arange(15.0)
    film = [(piece(k, i + 500, np.full(15, 60.0)), piece(k, i + 100, np.full(15, 50.0 + 9 * k))) for k in range(12)]
    still, moving = np.concatenate([a for a, _ in film]), np.concatenate([b for _, b in film])
    glint = on_glint(np.concatenate([still, moving]), FRAMES, PARAMETERS)
    assert glint[: len(still)].all()
    assert not glint[len(still) :].any()


def test_a_long_piece_may_stand_still() -> None:
    i = np.arange(60.0)
    film = np.concatenate([piece(k, i + 100, np.full(60, 200.0)) for k in range(30)])
    assert not on_glint(film, FRAMES, PARAMETERS).any()


def test_a_few_frames_are_no_standing_still() -> None:
    film = np.concatenate([piece(k, np.arange(15.0), np.full(15, 60.0)) for k in range(9)])
    assert not on_glint(film, FRAMES, PARAMETERS).any()


def test_the_pivot_of_a_turning_stripe_stays() -> None:
    t = np.linspace(-40, 40, 81)
    film = np.concatenate([piece(k, 300 + t, 200 + t * np.tan(0.05 * (k - 6))) for k in range(13)])
    assert not on_glint(film, FRAMES, PARAMETERS).any()


def test_no_points() -> None:
    assert on_glint(np.zeros(0, STRIPE_DTYPE), FRAMES, PARAMETERS).shape == (0,)

"""Points of a film."""

import numpy as np

from footscan.stripe.points import STRIPE_DTYPE, film_points


def test_frames_are_numbered_and_joined():
    one = np.array([(0, 1.0, 2.0, 3, 4, 0.5)], STRIPE_DTYPE)
    none = np.empty(0, STRIPE_DTYPE)
    two = np.array([(0, 5.0, 6.0, 7, 8, 0.25), (0, 9.0, 9.0, 9, 9, 1)], STRIPE_DTYPE)
    film = film_points([(0, one), (1, none), (7, two)])
    assert film["frame"].tolist() == [0, 7, 7]
    assert film["i"].tolist() == [1, 5, 9]
    assert two["frame"].tolist() == [0, 0]


def test_a_film_without_points():
    film = film_points([])
    assert film.dtype == STRIPE_DTYPE
    assert len(film) == 0


def test_three_decimals_survive_in_the_widest_image():
    assert np.array([(0, 7999.123, 0, 0, 0, 0)], STRIPE_DTYPE)["i"][0] == 7999.123

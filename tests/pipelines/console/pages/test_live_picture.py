"""The extracted stripe, drawn at its position."""

import numpy as np
import pytest
from stand_in import stripe_jpeg

from footscan.frames.image import decode_image
from pipelines.console.pages.live_picture import LivePictures


def test_dots_lie_on_the_stripe_and_nowhere_else() -> None:
    drawn, points = LivePictures().drawn(1, stripe_jpeg(True))
    image = decode_image(drawn).astype(int)
    assert image.shape == (240, 320, 3)
    green = np.argwhere((image[..., 1] > 150) & (image[..., 0] < 110))
    assert points > 600
    assert len(np.unique(green[:, 1])) > 310, "in nearly every column"
    truth = 120.0 + 30.0 * np.sin(2.0 * green[:, 1] / 130.0)
    assert np.abs(green[:, 0] - truth).max() < 3.0


def test_a_dark_picture_has_none_and_a_torn_one_is_refused() -> None:
    pictures = LivePictures()
    assert pictures.drawn(1, stripe_jpeg(False))[1] == 0
    with pytest.raises(ValueError, match=r"\w"):
        pictures.drawn(1, stripe_jpeg(True)[:3000])


def test_a_picture_is_shown_while_nothing_can_find_the_stripe() -> None:
    pictures, jpeg = LivePictures(), stripe_jpeg(True)
    shown, points = pictures.drawn(1, jpeg, with_stripe=False)
    assert points == 0
    assert decode_image(shown).shape == decode_image(pictures.drawn(2, jpeg)[0]).shape


def test_a_picture_is_made_once_for_all_who_look() -> None:
    pictures, jpeg = LivePictures(), stripe_jpeg(True)
    assert pictures.drawn(2, jpeg)[0] is pictures.drawn(2, jpeg)[0]
    assert pictures.drawn(2, stripe_jpeg(False))[1] == 0

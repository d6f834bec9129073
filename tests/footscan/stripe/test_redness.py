"""Redness and signal of pixels, against the same sums written with numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from footscan.frames.image import pixel_buffer
from footscan.stripe.redness import (
    SATURATED,
    as_words,
    halve,
    mark_saturated,
    red_of,
    redness_of,
    take_away,
)

IMAGES = st.tuples(st.integers(1, 7), st.integers(1, 7)).flatmap(
    lambda shape: arrays(np.uint8, (*shape, 3), elements=st.sampled_from([0, 1, 60, 127, 128, 244, 245, 250, 255]))
)


def halved(image, saturation=245):
    size = -(-image.shape[0] // 2), -(-image.shape[1] // 2)
    excess, signal = np.full(size, 7, np.uint16), np.full(size, 7, np.uint16)
    halve(as_words(image), saturation, excess, signal)
    return excess, signal


def test_levels_of_one_pixel():
    words = as_words(np.array([[[200, 60, 90], [60, 200, 10], [0, 0, 0], [255, 255, 255]]], np.uint8))[0]
    assert [red_of(word) for word in words] == [200, 60, 0, 255]
    assert [redness_of(word) for word in words] == [110, 0, 0, 0]


def test_what_lies_behind_blue_counts_for_nothing():
    image = pixel_buffer(1, 1)
    image[0, 0] = [200, 60, 90]
    for fourth in (0, 255):
        image.base[0, 0, 3] = fourth
        word = as_words(image)[0, 0]
        assert [red_of(word), redness_of(word)] == [200, 110]
        assert [part.item() for part in halved(image)] == [4 * 110, 4 * (2 * 200 + 60 + 90)]


def test_words_share_the_memory_of_a_pixel_buffer_and_copy_any_other():
    ramp = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    buffer = pixel_buffer(4, 5)
    buffer[...] = ramp
    assert np.shares_memory(as_words(buffer), buffer)
    for other in (ramp, ramp[::-1, ::-1], buffer[1:], buffer[:, :4], buffer[..., ::-1]):
        words = as_words(other)
        assert not np.shares_memory(words, other)
        expected = other[..., 0] + 256 * other[..., 1].astype(int) + 65536 * other[..., 2].astype(int)
        np.testing.assert_array_equal(words & 0xFFFFFF, expected)
    np.testing.assert_array_equal(as_words(buffer) & 0xFFFFFF, as_words(ramp) & 0xFFFFFF)


def test_half_size_by_hand():
    image = np.zeros((2, 4, 3), np.uint8)
    image[:, :2] = [[[200, 100, 0], [100, 0, 40]], [[100, 20, 100], [0, 0, 20]]]  # in sum 400, 120, 160
    image[:, 2:] = [255, 250, 240]
    excess, signal = halved(image)
    assert excess.tolist() == [[400 - 160, 4 * 5 + SATURATED]]
    assert signal.tolist() == [[2 * 400 + 120 + 160, 4 * (2 * 255 + 250 + 240)]]


@given(IMAGES)
def test_half_size_is_the_sum_of_four(image):
    rows, columns, _ = image.shape
    padded = np.pad(image, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge").astype(int)
    total = sum(padded[v::2, u::2] for v in (0, 1) for u in (0, 1))
    red, green, blue = np.moveaxis(total, -1, 0)
    excess, signal = halved(image)
    expected = np.maximum(red - np.maximum(green, blue), 0) + np.where(red >= 4 * 245, SATURATED, 0)
    np.testing.assert_array_equal(excess, expected)
    np.testing.assert_array_equal(signal, 2 * red + green + blue)


def test_the_flag_is_beyond_any_redness():
    red = np.full((2, 2, 3), [254, 0, 0], np.uint8)
    assert halved(red, saturation=255)[0].item() == 4 * 254 < SATURATED
    assert halved(red, saturation=254)[0].item() == 4 * 254 + SATURATED


@given(arrays(np.uint8, 12), arrays(np.uint8, 12))
def test_light_is_what_the_background_has_not(image, background):
    light = np.empty(12, np.uint8)
    take_away(image, background, light)
    np.testing.assert_array_equal(light, np.clip(image.astype(int) - background, 0, 255))


@pytest.mark.parametrize("shape", [(4, 6), (3, 5), (1, 1)])
def test_saturation_of_all_light_is_marked_once(shape):
    image = np.full((*shape, 3), 250, np.uint8)
    image[:, :2] = 100
    words = as_words(image)
    excess, _ = halved(image // 2)
    assert not excess.any()
    for _ in range(2):
        mark_saturated(words, 245, excess)
        expected = np.zeros_like(excess)
        expected[:, 1:] = SATURATED
        np.testing.assert_array_equal(excess, expected)

import base64
import re

import numpy as np
import pytest
import simplejpeg

from footscan.report.sample_frames import FrameSample, crop, cut_out, sample_frames

SHAPE = 480, 640, 3


def sample_of(camera, frame, image, i, j):
    cut = crop(image.shape, i, j)
    return FrameSample(camera, frame, cut, cut_out(image, cut), i, j)


@pytest.mark.parametrize(
    ("i", "j", "expected"),
    [
        ([], [], (0, 480, 0, 640)),
        # 201 columns from 200 to 400 and a margin of 20: 240 wide and 180 high about column 300 and row 240.
        ([200.0, 400.0], [240.0, 240.0], (150, 180, 180, 240)),
        # 161 rows and margins are 200 high, so 267 wide.
        ([300.0, 300.0], [160.0, 320.0], (140, 200, 167, 267)),
        # A small stripe is shown at least 160 wide; in the corner the cut is shifted into the image.
        ([2.0, 6.0], [475.0, 479.0], (360, 120, 0, 160)),
        # A stripe across the whole image.
        ([0.0, 639.0], [0.0, 479.0], (0, 480, 0, 640)),
    ],
)
def test_the_cut_is_about_the_stripe_and_within_the_image(i, j, expected):
    assert crop(SHAPE, np.array(i), np.array(j)) == expected


def test_points_are_drawn_where_they_are_in_the_image():
    image = np.zeros((480, 640, 3), np.uint8)
    image[240, 200:401] = 255
    page = sample_frames([sample_of(3, 71, image, np.array([200.25, 399.75]), np.array([240.0, 240.0]))])
    assert "Camera 3" in page
    assert "frame 71" in page
    assert "2 points" in page
    assert 'viewBox="179.5 149.5 240 180"' in page
    assert 'd="M200.2 240.0h0M399.8 240.0h0"' in page
    encoded = re.search(r'href="data:image/jpeg;base64,([^"]+)"', page)
    assert encoded
    shown = simplejpeg.decode_jpeg(base64.b64decode(encoded[1]))
    assert shown.shape == (180, 240, 3)
    assert shown[240 - 150, 300 - 180].min() > 200
    assert shown[240 - 150 + 10, 300 - 180].max() < 50


def test_a_frame_without_stripe_is_shown_whole_and_said_so():
    page = sample_frames([sample_of(1, 0, np.zeros((48, 64, 3), np.uint8), np.empty(0), np.empty(0))])
    assert "no stripe" in page
    assert 'viewBox="-0.5 -0.5 64 48"' in page


def test_frames_stand_in_groups():
    image = np.zeros(SHAPE, np.uint8)
    i, j = np.array([200.0, 400.0]), np.array([240.0, 240.0])
    page = sample_frames([sample_of(2, 5, image, i, j), sample_of(1, 5, image, i, j), sample_of(2, 9, image, i, j)])
    five, nine = page.split('data-frame="9"')
    assert 'data-frame="5"' in five
    assert [text.count("<figure>") for text in (five, nine)] == [2, 1]
    assert 'max="1" value="1"' in page


def test_a_wide_cut_is_scaled_down_and_its_points_are_not():
    i = np.linspace(0, 639, 640)
    page = sample_frames([sample_of(1, 0, np.full((480, 640, 3), 90, np.uint8), i, np.full(640, 200.0))])
    jpeg = base64.b64decode(re.findall(r'base64,([^"]+)"', page)[0])
    assert simplejpeg.decode_jpeg(jpeg).shape == (240, 320, 3)
    assert 'viewBox="-0.5 -0.5 640 480"' in page
    assert "640 points" in page
    assert page.count(" 200.0h0") == 128

"""Ridges of signals whose centre and normal are known."""

import numpy as np
import pytest

from footscan.stripe.ridge import find_ridges, gaussian


def ridges_of(signal, mask=None, smallest_curvature=0.5):
    rows, columns = signal.shape
    mask = np.ones((rows, columns), np.uint8) if mask is None else mask
    active = np.ones((-(-rows // 32), -(-columns // 32)), np.uint8)
    ridges = np.empty((rows * columns + 1, 5))
    count = find_ridges(np.rint(signal).astype(np.uint16), mask, active, gaussian(2.0), smallest_curvature, ridges)
    return ridges[:count]


def stripe(degrees, offset=0.0, shape=(70, 90)):
    j, i = np.mgrid[0 : shape[0], 0 : shape[1]].astype(float)
    normal = -np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))
    distance = (i - 45) * normal[0] + (j - 35 - offset) * normal[1]
    return 1000 * np.exp(-0.5 * (distance / 2.5) ** 2), normal


def test_kernel():
    kernel = gaussian(2.0)
    assert len(kernel) == 13
    assert kernel.sum() == pytest.approx(1)
    assert kernel[6] / kernel[4] == pytest.approx(np.exp(0.5))


@pytest.mark.parametrize("degrees", [0, 20, 45, 70, 90, 110, 135, 160])
def test_position_and_normal(degrees):
    signal, normal = stripe(degrees)
    ridges = ridges_of(signal)
    inner = ridges[(np.abs(ridges[:, 0] - 45) < 30) & (np.abs(ridges[:, 1] - 35) < 22)]
    assert len(inner) > 30
    assert np.abs((inner[:, 0] - 45) * normal[0] + (inner[:, 1] - 35) * normal[1]).max() < 0.05
    np.testing.assert_allclose(np.abs(inner[:, 2] * normal[0] + inner[:, 3] * normal[1]), 1, atol=1e-3)


def test_a_row_is_crossed_once_a_column_between_pixels_too():
    for offset in (0.0, 0.3, 0.5, 0.7):
        ridges = ridges_of(stripe(0, offset)[0])
        columns = np.unique(np.rint(ridges[:, 0]))
        assert len(columns) == 90
        np.testing.assert_allclose(ridges[:, 1], 35 + offset, atol=0.05)


def test_only_in_the_mask():
    signal, _ = stripe(0)
    mask = np.zeros(signal.shape, np.uint8)
    mask[:, 10:20] = 1
    assert np.unique(np.rint(ridges_of(signal, mask)[:, 0])).tolist() == list(range(10, 20))


def test_a_spot_is_no_ridge():
    j, i = np.mgrid[0:60, 0:60].astype(float)
    spot = 1000 * np.exp(-0.5 * ((i - 30) ** 2 + (j - 30) ** 2) / 2.5**2)
    ridges = ridges_of(spot)
    assert not np.any(np.hypot(ridges[:, 0] - 30, ridges[:, 1] - 30) < 1.5)

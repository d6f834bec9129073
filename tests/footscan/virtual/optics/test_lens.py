"""Projection of a lens against values worked out by hand."""

import numpy as np

from footscan.virtual.optics.lens import Lens

PINHOLE = Lens(1000.0, (320.0, 240.0), 0.0, 0.0, 0.0, 0.0)
REAL = Lens(1000.0, (320.0, 240.0), k1=-0.1, k2=0.04, p1=0.001, p2=-0.002)


def test_pinhole() -> None:
    pixels = PINHOLE.pixels(np.array([[0.0, 0.0, 1.0], [20.0, -10.0, 200.0]]))
    np.testing.assert_allclose(pixels, [[320.0, 240.0], [420.0, 190.0]])


def test_nothing_behind_the_camera() -> None:
    assert np.isnan(PINHOLE.pixels(np.array([[0.0, 0.0, -1.0]]))).all()


def test_distortion() -> None:
    # x = 0.2, y = 0.1, r^2 = 0.05: radial 1 - 0.005 + 0.0001 = 0.9951.
    # x' = 0.19902 + 2 * 0.001 * 0.02 - 0.002 * (0.05 + 0.08) = 0.1988
    # y' = 0.09951 + 0.001 * (0.05 + 0.02) - 2 * 0.002 * 0.02 = 0.0995
    np.testing.assert_allclose(REAL.pixels(np.array([[0.2, 0.1, 1.0]])), [[518.8, 339.5]])


def test_directions_undo_pixels() -> None:
    columns, rows = np.meshgrid(np.linspace(0.0, 639.0, 9), np.linspace(0.0, 479.0, 7))
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    np.testing.assert_allclose(REAL.pixels(REAL.directions(pixels)), pixels, atol=1e-9)

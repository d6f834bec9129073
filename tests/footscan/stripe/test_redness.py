"""Red against bright, on frames small enough to write down."""

import numpy as np

from footscan.stripe.redness import find_red


def red_mask(image, red_threshold=20, saturation=250, largest_core=6):
    rows, columns = image.shape[:2]
    excess, signal = np.empty((rows, columns), np.uint8), np.empty((rows, columns), np.uint16)
    mask, active = np.empty((rows, columns), np.uint8), np.empty((-(-rows // 32), -(-columns // 32)), np.uint8)
    count = find_red(image, red_threshold, saturation, largest_core, excess, signal, mask, active)
    assert count == mask.sum()
    return excess, signal, mask, active


def row_of(pixels, rows=1):
    """A frame whose rows are all the same: grey, with `pixels` from column 10."""
    image = np.full((rows, 40, 3), 100, np.uint8)
    image[:, 10 : 10 + len(pixels)] = pixels
    return image


def test_excess_and_signal():
    excess, signal, mask, _ = red_mask(row_of([[200, 60, 90], [60, 200, 10]]))
    assert excess[0, 9:12].tolist() == [0, 110, 0]
    assert signal[0, 9:12].tolist() == [400, 550, 330]
    assert np.flatnonzero(mask[0]).tolist() == [10]


def test_a_white_core_between_red_flanks_is_filled():
    red, white = [255, 100, 100], [255, 250, 250]
    for turned in (False, True):
        image = row_of([red, white, white, white, red])
        mask = red_mask(image.transpose(1, 0, 2) if turned else image)[2].ravel()
        assert np.flatnonzero(mask).tolist() == [10, 11, 12, 13, 14]


def test_white_is_not_filled_beside_one_flank_or_where_it_is_too_wide_or_dull():
    red, white, dull = [255, 100, 100], [255, 250, 250], [240, 240, 240]
    assert red_mask(row_of([red, white, white, white]))[2].sum() == 1
    assert red_mask(row_of([red, *[white] * 7, red]))[2].sum() == 2
    assert red_mask(row_of([red, white, dull, white, red]))[2].sum() == 2


def test_red_all_over_is_background():
    image = np.full((64, 96, 3), [160, 60, 60], np.uint8)
    image[:, 40:45] = [230, 60, 60]
    _, _, mask, active = red_mask(image)
    assert np.flatnonzero(mask[0]).tolist() == [40, 41, 42, 43, 44]
    assert active.tolist() == [[0, 1, 0], [0, 1, 0]]

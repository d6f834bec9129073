"""The stripe as the skeleton of the largest red part of the picture: the method of the thesis (5.2), for comparison.

Pixels are the stripe's if they are redder than a fixed threshold. Of their connected parts the largest is kept and
thinned to lines one pixel wide; the centre is the median of these lines in each column. Centres are whole or half
pixels, and whatever is redder than the threshold and larger than the stripe takes its place.
"""

import numpy as np
from numpy.typing import NDArray

from schemas.parameters.extraction import ExtractionParameters

SIGMA_PX = 0.5
"""Standard deviation of a centre: it is rounded to half a pixel, and the two edges of a stripe are rough by one.
Chosen by hand."""
CONNECTED = 2
"""Pixels touch at their sides or corners: the connectivity of eight neighbours, as scikit-image counts it."""


def skeleton_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> NDArray[np.float64]:
    """Find one centre in each column of the largest red part, or in each row if the part is higher than broad.

    Parameters
    ----------
    image, background : (rows, columns, 3) uint8 RGB, as for `extract_stripe`
    parameters : `laser`, `red_threshold` and `saturation` are used; a laser that is `auto` is taken for red

    Returns
    -------
    (N, 7) by column, or by row; empty if no pixel is red: i and j (px), the number of pixels of the part across, the
    grey level of the laser, the score 1, the saturated share, and the standard deviation of the centre (px).

    Examples
    --------
    >>> image = np.zeros((64, 64, 3), np.uint8)
    >>> image[29:32, 10:50, 0] = 200
    >>> image[5:8, 5:8, 0] = 250  # a glint
    >>> points = skeleton_stripe(image, ExtractionParameters())
    >>> print(len(points) >= 36, np.median(points[:, 1]), points[:, 0].min() >= 10)
    True 30.0 True
    """
    from skimage.measure import label, regionprops
    from skimage.morphology import skeletonize

    picture = image.astype(np.int16)
    if background is not None:
        picture = np.maximum(picture - background, 0)
    excess, level = _redness(picture, parameters.searched_laser)
    parts = label(excess >= parameters.red_threshold, connectivity=CONNECTED)
    if not parts.any():
        return np.empty((0, 7))
    number = 1 + int(np.bincount(parts.ravel())[1:].argmax())
    top, left, bottom, right = regionprops((parts == number).astype(np.uint8))[0].bbox
    part, level = parts[top:bottom, left:right] == number, level[top:bottom, left:right]
    is_high = part.shape[0] > part.shape[1]
    if is_high:
        part, level = part.T, level.T
    thin = skeletonize(part)
    columns = np.flatnonzero(thin.any(axis=0))
    along = columns + (top if is_high else left)
    rows = np.array([np.median(np.flatnonzero(thin[:, column])) for column in columns])
    across = rows + (left if is_high else top)
    width = part[:, columns].sum(axis=0)
    saturated = (part & (level >= parameters.saturation))[:, columns].sum(axis=0) / width
    peak = np.where(part, level, 0).max(axis=0)[columns]
    i, j = (across, along) if is_high else (along, across)
    return np.column_stack([i, j, width, peak, np.ones(len(columns)), saturated, np.full(len(columns), SIGMA_PX)])


def _redness(picture: NDArray[np.int16], laser: str) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
    """By how many grey levels the laser's colour exceeds the others, and the colour itself; both (rows, columns)."""
    if laser == "mono":
        return picture[:, :, 1], picture[:, :, 1]
    own = ("red", "green", "blue").index(laser)
    others = np.delete(picture, own, axis=2).max(axis=2)
    return picture[:, :, own] - others, picture[:, :, own]

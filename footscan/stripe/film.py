"""The stripe in all frames of a film."""

import csv
import io
from collections.abc import Iterable
from itertools import repeat

import numpy as np

from footscan.frames.image import Rgb
from footscan.stripe.blur import is_laser_light
from footscan.stripe.clutter import is_moving_stripe, number_pieces
from footscan.stripe.crossings import CROSSING_COLUMNS, MEASURED, PIECE, find_stripe
from footscan.stripe.extract import as_points, points_of_rows
from footscan.stripe.plain.skeleton import skeleton_stripe
from footscan.stripe.points import StripePoints
from schemas.parameters.extraction import ExtractionParameters

CSV_COLUMNS = ["frame", "i", "j", "width", "peak", "score"]
"""Fields of `STRIPE_DTYPE` in the CSV text."""


def extract_film(
    frames: Iterable[Rgb | None],
    parameters: ExtractionParameters,
    backgrounds: Iterable[Rgb | None] | None = None,
) -> StripePoints:
    """Extract the stripe points from all frames of one camera.

    Parameters
    ----------
    frames : (rows, columns, 3) uint8 RGB each, valid until the next one is read; a lost frame (None) has no points.
    parameters : `laser` is taken for red if it is `auto`, see `footscan.stripe.laser.adapted`.
    backgrounds : for each frame the same view with the laser off; None for a frame without background.

    Returns
    -------
    (N,) of `STRIPE_DTYPE`, frame by frame. Pieces are dropped that are blurred and hardly red compared with the film's
    stripe (`blur`), that stand still while the heads travel, or that appear in one frame only (`clutter`).

    Examples
    --------
    A stripe that moves down by four rows a frame; the second frame was lost:

    >>> frames = []
    >>> for row in (20, 24, 28, 32):
    ...     frame = np.zeros((64, 64, 3), np.uint8)
    ...     frame[row - 1 : row + 2, :, 0] = [[100], [200], [100]]
    ...     frames.append(frame)
    >>> frames[1] = None
    >>> points = extract_film(frames, ExtractionParameters())
    >>> print(np.unique(points["frame"]))
    [0 2 3]
    """
    if parameters.stripe == "skeleton":
        return _skeletons(zip(frames, backgrounds or repeat(None), strict=False), parameters)
    crossings_by_frame = [np.empty((0, MEASURED))]
    read: list[int] = []
    for number, (frame, background) in enumerate(zip(frames, backgrounds or repeat(None), strict=False)):
        if frame is not None:
            crossings_by_frame.append(find_stripe(frame, parameters, background))
            read.append(number)
    crossings = np.concatenate(crossings_by_frame)
    order = np.repeat(np.arange(-1, len(read), dtype=np.int32), [len(part) for part in crossings_by_frame])
    piece = number_pieces(order, crossings[:, PIECE])
    lit = is_laser_light(crossings, piece, len(read), parameters)
    crossings, order, piece = crossings[lit], order[lit], piece[lit]
    kept = is_moving_stripe(crossings[:, :2], order, piece, len(read), parameters)
    points = as_points(crossings[kept], order[kept])
    if read != list(range(len(read))):
        points["frame"] = np.array(read, np.int32)[points["frame"]]
    return points


def _skeletons(pairs: Iterable[tuple[Rgb | None, Rgb | None]], parameters: ExtractionParameters) -> StripePoints:
    found = [
        np.empty((0, len(CROSSING_COLUMNS))) if frame is None else skeleton_stripe(frame, parameters, background)
        for frame, background in pairs
    ]
    counts = [len(rows) for rows in found]
    frames = np.repeat(np.arange(len(found), dtype=np.int32), counts)
    return points_of_rows(np.concatenate([np.empty((0, len(CROSSING_COLUMNS))), *found]), frames)


def points_csv(points: StripePoints) -> str:
    """Write stripe points as CSV text: the header frame,i,j,width,peak,score, then a row a point with three decimals.

    >>> from footscan.stripe.points import STRIPE_DTYPE
    >>> points = np.zeros(1, STRIPE_DTYPE)
    >>> points["i"], points["j"], points["peak"] = 3.0, 30.25, 200.0
    >>> print(points_csv(points), end="")
    frame,i,j,width,peak,score
    0,3.000,30.250,0.000,200.000,0.000
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for point in points[CSV_COLUMNS].tolist():
        writer.writerow([point[0], *(f"{value:.3f}" for value in point[1:])])
    return text.getvalue()

"""The stripe in all frames of a film."""

import csv
import io
from collections.abc import Iterable
from itertools import repeat

import numpy as np

from footscan.frames.image import Rgb
from footscan.stripe.blur import is_laser_light
from footscan.stripe.clutter import is_moving_stripe, number_pieces
from footscan.stripe.extract import MEASURED, PIECE, as_points, find_stripe
from footscan.stripe.points import StripePoints
from schemas.parameters.extraction import ExtractionParameters

CSV_COLUMNS = ["frame", "i", "j", "width", "peak", "score"]


def extract_film(
    frames: Iterable[Rgb | None],
    parameters: ExtractionParameters,
    backgrounds: Iterable[Rgb | None] | None = None,
) -> StripePoints:
    """The stripe points of all frames of one camera.

    Parameters
    ----------
    frames : (rows, columns, 3) uint8 RGB each, valid until the next; a lost frame (None) has no points.
    backgrounds : for each frame the same view with the laser off; None where there is none.

    Returns
    -------
    (N,) of `STRIPE_DTYPE`, frame by frame, without what is blurred and hardly red beside the film's stripe (`blur`),
    what stands still while the heads travel, and what appears in one frame alone (`clutter`).
    """
    found = [np.empty((0, MEASURED))]
    read: list[int] = []
    for number, (frame, background) in enumerate(zip(frames, backgrounds or repeat(None), strict=False)):
        if frame is not None:
            found.append(find_stripe(frame, parameters, background))
            read.append(number)
    crossings = np.concatenate(found)
    order = np.repeat(np.arange(-1, len(read), dtype=np.int32), [len(part) for part in found])
    piece = number_pieces(order, crossings[:, PIECE])
    lit = is_laser_light(crossings, piece, len(read), parameters)
    crossings, order, piece = crossings[lit], order[lit], piece[lit]
    kept = is_moving_stripe(crossings[:, :2], order, piece, len(read), parameters)
    points = as_points(crossings[kept], order[kept])
    if read != list(range(len(read))):
        points["frame"] = np.array(read, np.int32)[points["frame"]]
    return points


def points_csv(points: StripePoints) -> str:
    """Stripe points as CSV text: frame,i,j,width,peak,score, three decimals."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for point in points[CSV_COLUMNS].tolist():
        writer.writerow([point[0], *(f"{value:.3f}" for value in point[1:])])
    return text.getvalue()

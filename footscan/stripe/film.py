"""The stripe in all frames of a film."""

import csv
import io
from collections.abc import Iterable, Iterator

from footscan.frames.image import Rgb
from footscan.stripe.clutter import on_glint
from footscan.stripe.extract import extract_stripe
from footscan.stripe.points import STRIPE_DTYPE, StripePoints, film_points
from schemas.parameters.extraction import ExtractionParameters


def extract_film(frames: Iterable[Rgb | None], parameters: ExtractionParameters) -> StripePoints:
    """The stripe points of all frames of one camera; a lost frame (None) has none."""
    count = 0

    def found() -> Iterator[tuple[int, StripePoints]]:
        nonlocal count
        for frame in frames:
            if frame is not None:
                yield count, extract_stripe(frame, parameters)
            count += 1

    points = film_points(found())
    return points[~on_glint(points, count, parameters)]


def points_csv(points: StripePoints) -> str:
    """Stripe points as CSV text: frame,i,j,width,peak,score, three decimals."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = STRIPE_DTYPE.names or ()
    writer.writerow(names)
    for point in points.tolist():
        writer.writerow([point[0], *(f"{value:.3f}" for value in point[1:])])
    return text.getvalue()

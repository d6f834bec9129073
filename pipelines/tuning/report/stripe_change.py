"""Differences of two sets of stripe points, by frame and drawn over the frame."""

from collections.abc import Sequence

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.report.markup import data_uri, number, text
from footscan.report.sample_frames import crop
from footscan.stripe.points import StripePoints
from pipelines.tuning.report.result import FrameChange

FAR_PX = 10.0
"""Largest difference of a point: that of a point without another one nearer than this; chosen by hand."""
COLOURS = {"present": "#ff9f1c", "winner": "#2ee6ff"}


def change_by_frame(a: StripePoints, b: StripePoints, count: int) -> NDArray[np.float64]:
    """Sum of the distances from each point to the nearest of the other set in its frame, px, by frame: (count,).

    Parameters
    ----------
    a, b : (N,) and (M,) of `STRIPE_DTYPE`, px, image frame.
    count : number of frames of the film.
    """
    total = np.zeros(count)
    for ours, theirs in ((a, b), (b, a)):
        if not len(ours):
            continue
        if len(theirs):
            far, _ = cKDTree(_apart(theirs)).query(_apart(ours), distance_upper_bound=FAR_PX)
        else:
            far = np.full(len(ours), np.inf)
        total += np.bincount(ours["frame"], np.minimum(far, FAR_PX), count)
    return total


def change_figures(changes: Sequence[FrameChange]) -> str:
    """Draw each frame, cropped around its stripe, with the points of both sets, as SVG."""
    return '<div class="frames">\n' + "\n".join(_figure(change) for change in changes) + "\n</div>"


def _apart(points: StripePoints) -> NDArray[np.float64]:
    """Positions (N, 3) in which points of different frames are never near each other."""
    return np.column_stack([points["frame"] * (2 * FAR_PX), points["i"], points["j"]])


def _figure(change: FrameChange) -> str:
    both = np.concatenate([change.present, change.winner])
    first_row, rows, first_column, columns = crop(change.image.shape[:2], both[:, 0], both[:, 1])
    cut = change.image[first_row : first_row + rows, first_column : first_column + columns]
    jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(cut), quality=85, colorsubsampling="444")
    dots = "".join(
        f'<path fill="none" stroke="{COLOURS[name]}" stroke-width="{width}" stroke-linecap="round" '
        f'vector-effect="non-scaling-stroke" '
        f'd="{"".join(f"M{i:.1f} {j:.1f}h0" for i, j in points)}"/>'
        for name, points, width in (("present", change.present, 4.0), ("winner", change.winner, 1.8))
    )
    name = f"{change.scan}, camera {change.camera}, frame {change.frame}"
    counts = f"{number(len(change.present))} points at present, {number(len(change.winner))} of the winner"
    return (
        f"<figure><figcaption><b>{text(name)}</b> {counts}</figcaption>"
        f'<svg viewBox="{first_column - 0.5} {first_row - 0.5} {columns} {rows}" role="img" aria-label="{text(name)}">'
        f'<image x="{first_column - 0.5}" y="{first_row - 0.5}" width="{columns}" height="{rows}" '
        f'href="{data_uri("image/jpeg", jpeg)}"/>{dots}</svg></figure>'
    )

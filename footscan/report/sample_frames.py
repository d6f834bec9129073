"""One frame of each camera, with the stripe points found in it."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from footscan.report.markup import data_uri, number

_MARGIN_PX = 20
_ASPECT = 4 / 3
_LEAST_WIDTH_PX = 160


@dataclass(frozen=True)
class FrameSample:
    """A frame and the stripe points found in it."""

    camera: int
    frame: int
    image: NDArray[np.uint8]
    """(rows, columns, 3), RGB."""
    i: NDArray[np.floating]
    """(N,) columns of the stripe points; the centre of the top-left pixel is (0, 0)."""
    j: NDArray[np.floating]
    """(N,) rows."""


def sample_frames(samples: Iterable[FrameSample]) -> str:
    """Each sample cropped around its stripe, as SVG with the points drawn over the pixels."""
    return '<div class="frames">\n' + "\n".join(_figure(sample) for sample in samples) + "\n</div>"


def _figure(sample: FrameSample) -> str:
    first_row, rows, first_column, columns = crop(sample.image.shape[:2], sample.i, sample.j)
    cut = sample.image[first_row : first_row + rows, first_column : first_column + columns]
    # A camera's own JPEG is no sharper than this one; as PNG, eight noisy frames would be several MB.
    jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(cut), quality=90, colorsubsampling="444")
    # A dot of no length with round ends; pixel (0, 0) covers -0.5 to 0.5.
    dots = "".join(f"M{i:.2f} {j:.2f}h0" for i, j in zip(sample.i, sample.j, strict=True))
    name = f"Camera {sample.camera:d}, frame {sample.frame:d}"
    count = f"{number(len(sample.i))} points" if len(sample.i) else "no stripe"
    return (
        f"<figure><figcaption><b>Camera {sample.camera:d}</b> frame {sample.frame:d}, {count}</figcaption>"
        f'<svg viewBox="{first_column - 0.5} {first_row - 0.5} {columns} {rows}" role="img" aria-label="{name}">'
        f'<image x="{first_column - 0.5}" y="{first_row - 0.5}" width="{columns}" height="{rows}" '
        f'href="{data_uri("image/jpeg", jpeg)}"/><path class="dots" d="{dots}"/></svg></figure>'
    )


def crop(shape: tuple[int, ...], i: NDArray[np.floating], j: NDArray[np.floating]) -> tuple[int, int, int, int]:
    """First row, rows, first column and columns of the part of an image that shows the points (i, j) best.

    It is 4:3 where the image allows, and the whole image where there are no points.
    """
    rows, columns = shape[:2]
    if not len(i):
        return 0, rows, 0, columns
    width = max(float(np.ptp(i)) + 2 * _MARGIN_PX, (float(np.ptp(j)) + 2 * _MARGIN_PX) * _ASPECT, _LEAST_WIDTH_PX)
    first_column, width_px = _span(float(i.min() + i.max()) / 2, width, columns)
    first_row, height_px = _span(float(j.min() + j.max()) / 2, width / _ASPECT, rows)
    return first_row, height_px, first_column, width_px


def _span(centre: float, length: float, available: int) -> tuple[int, int]:
    """First pixel and number of pixels of a span about `centre`, shifted to lie within `available` pixels."""
    pixels = min(round(length), available)
    first = round(centre - (pixels - 1) / 2)
    return min(max(first, 0), available - pixels), pixels

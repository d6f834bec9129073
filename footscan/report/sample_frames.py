"""Frames of each camera along the travel with their stripe points, browsed by a slider."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image

from footscan.report.markup import data_uri, number

_MARGIN_PX = 20
_ASPECT = 4 / 3
_LEAST_WIDTH_PX = 160
"""Margin around the stripe points, aspect and least width of a cut; chosen by hand."""
_SHOWN_PX = 320
"""Width to which a wider cut is scaled down: some 6 kB each, and the page of a scan shows a hundred."""
_MOST_DOTS = 150
"""Most points of a frame that are drawn, for the size of the page."""
_DOTS_ACROSS = 160
"""Width of a cut in dots; the dots scale with the cut. Chosen by hand."""


Cut = tuple[int, int, int, int]
"""First row, number of rows, first column and number of columns of a part of an image."""


@dataclass(frozen=True)
class FrameSample:
    """A cut of a frame and its stripe points. The frame itself is not kept: a hundred of them take 90 MB."""

    camera: int
    frame: int
    cut: Cut
    """The same in all samples of a camera, so that the picture does not move from frame to frame."""
    jpeg: bytes
    """The pixels of the cut, at most `_SHOWN_PX` wide."""
    i: NDArray[np.floating]
    """(N,) columns of the stripe points; the centre of the frame's top-left pixel is (0, 0)."""
    j: NDArray[np.floating]
    """(N,) rows."""


def cut_out(image: NDArray[np.uint8], cut: Cut) -> bytes:
    """The JPEG of a cut of `image`, (rows, columns, 3) RGB, as `FrameSample` has it."""
    first_row, rows, first_column, columns = cut
    pixels = np.ascontiguousarray(image[first_row : first_row + rows, first_column : first_column + columns])
    if columns > _SHOWN_PX:
        size = _SHOWN_PX, max(1, round(rows * _SHOWN_PX / columns))
        pixels = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX, reducing_gap=1.0))
    # A camera's own JPEG is no sharper than this one; chroma is kept, for a red stripe is little else.
    return bytes(simplejpeg.encode_jpeg(pixels, quality=75, colorsubsampling="444"))


def sample_frames(samples: Sequence[FrameSample]) -> str:
    """Groups of figures, one group per frame; `FRAMES_SCRIPT` shows one group at a time.

    Each figure is a cut around all stripes of its camera, as SVG with the points drawn over the pixels.
    """
    numbers = sorted({sample.frame for sample in samples})
    groups = "".join(
        f'<div class="frames" data-frame="{frame}">\n'
        + "\n".join(_figure(sample) for sample in samples if sample.frame == frame)
        + "\n</div>"
        for frame in numbers
    )
    middle = len(numbers) // 2
    return (
        f'<div class="controls" id="travel" hidden><label for="moment">Frame <output id="frame"></output></label>'
        f'<input id="moment" type="range" min="0" max="{len(numbers) - 1}" value="{middle}"></div>\n{groups}'
    )


FRAMES_SCRIPT = """\
(() => {
  "use strict";
  const moment = document.getElementById("moment"), groups = document.querySelectorAll("[data-frame]");
  const choose = () => {
    groups.forEach((group, number) => { group.hidden = number !== Number(moment.value); });
    document.getElementById("frame").textContent = groups[moment.value].dataset.frame;
  };
  moment.addEventListener("input", choose);
  document.getElementById("travel").hidden = groups.length < 2;
  choose();
})();
"""


def _figure(sample: FrameSample) -> str:
    first_row, rows, first_column, columns = sample.cut
    # A dot of no length with round ends; pixel (0, 0) covers -0.5 to 0.5.
    step = -(-len(sample.i) // _MOST_DOTS) or 1
    drawn = zip(sample.i[::step].tolist(), sample.j[::step].tolist(), strict=True)
    dots = "".join(f"M{i:.1f} {j:.1f}h0" for i, j in drawn)
    name = f"Camera {sample.camera:d}, frame {sample.frame:d}"
    count = f"{number(len(sample.i))} points" if len(sample.i) else "no stripe"
    return (
        f"<figure><figcaption><b>Camera {sample.camera:d}</b> frame {sample.frame:d}, {count}</figcaption>"
        f'<svg viewBox="{first_column - 0.5} {first_row - 0.5} {columns} {rows}" role="img" aria-label="{name}">'
        f'<image x="{first_column - 0.5}" y="{first_row - 0.5}" width="{columns}" height="{rows}" '
        f'href="{data_uri("image/jpeg", sample.jpeg)}"/>'
        f'<path class="dots" style="stroke-width:{columns / _DOTS_ACROSS:.1f}" d="{dots}"/></svg></figure>'
    )


def crop(shape: tuple[int, ...], i: NDArray[np.floating], j: NDArray[np.floating]) -> Cut:
    """The cut around the points (i, j), px, of an image of (rows, columns, ...).

    Its aspect is 4:3 as far as the image allows. Without points it is the whole image.

    >>> crop((480, 640), np.array([300.0, 340.0]), np.array([200.0, 260.0]))
    (170, 120, 240, 160)
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

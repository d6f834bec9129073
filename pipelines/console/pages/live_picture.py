"""What a camera sees now, with the stripe that is found in it."""

import threading

import numpy as np
import simplejpeg

from footscan.frames.image import decode_image
from footscan.stripe.extract import extract_stripe
from schemas.parameters.extraction import ExtractionParameters

DOT = (0, 240, 138)
SMALLER = 2
"""Of two columns and rows one is shown: enough for a tile of the page."""


class LivePictures:
    """Makes each picture once, however many look at it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: dict[int, tuple[bytes, bytes, int]] = {}

    def drawn(self, camera: int, jpeg: bytes) -> tuple[bytes, int]:
        """A smaller JPEG with the stripe points drawn, and how many there are.

        Raises
        ------
        ValueError
            `jpeg` is torn.
        """
        with self._lock:  # one at a time: filming comes first
            before = self._made.get(camera)
            if before is None or before[0] is not jpeg:
                before = self._made[camera] = (jpeg, *draw_stripe(jpeg))
            return before[1:]


def draw_stripe(jpeg: bytes) -> tuple[bytes, int]:
    """As `LivePictures.drawn`."""
    image = decode_image(jpeg)
    points = extract_stripe(image, ExtractionParameters())
    shown = np.ascontiguousarray(image[::SMALLER, ::SMALLER])
    rows = np.clip(np.rint(points["j"] / SMALLER).astype(int), 0, shown.shape[0] - 1)
    columns = np.clip(np.rint(points["i"] / SMALLER).astype(int), 0, shown.shape[1] - 1)
    for lower in (0, 1):  # two rows: one would be lost in a tile
        shown[np.minimum(rows + lower, shown.shape[0] - 1), columns] = DOT
    return bytes(simplejpeg.encode_jpeg(shown, 75, "RGB", "444")), len(points)

"""Live pictures of the cameras, with the extracted stripe."""

import threading

import numpy as np
import simplejpeg

from footscan.frames.image import decode_image
from footscan.stripe.extract import extract_stripe
from footscan.stripe.points import STRIPE_DTYPE
from schemas.parameters.extraction import ExtractionParameters

DOT = (0, 240, 138)
"""RGB of a stripe point."""
NO_POINTS = np.empty(0, STRIPE_DTYPE)
SMALLER = 2
"""Every second column and row is shown: enough for a tile of the page."""


class LivePictures:
    """A cache that draws each picture once for all pages."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: dict[int, tuple[bytes, bytes, int]] = {}

    def drawn(self, camera: int, jpeg: bytes, *, with_stripe: bool = True) -> tuple[bytes, int]:
        """Return a smaller JPEG, with the stripe points drawn if wanted, and the number of points.

        Raises
        ------
        ValueError
            `jpeg` is incomplete.
        """
        with self._lock:  # one at a time: filming has priority
            latest = self._made.get(camera)
            if latest is None or latest[0] is not jpeg:
                latest = self._made[camera] = (jpeg, *_smaller(jpeg, with_stripe))
            return latest[1:]


def _smaller(jpeg: bytes, with_stripe: bool) -> tuple[bytes, int]:
    image = decode_image(jpeg)
    points = extract_stripe(image, ExtractionParameters()) if with_stripe else NO_POINTS
    shown = np.ascontiguousarray(image[::SMALLER, ::SMALLER])
    rows = np.clip(np.rint(points["j"] / SMALLER).astype(int), 0, shown.shape[0] - 1)
    columns = np.clip(np.rint(points["i"] / SMALLER).astype(int), 0, shown.shape[1] - 1)
    for lower in (0, 1):  # two rows, since one is hardly visible in a tile
        shown[np.minimum(rows + lower, shown.shape[0] - 1), columns] = DOT
    return bytes(simplejpeg.encode_jpeg(shown, 75, "RGB", "444")), len(points)

"""Pictures of a scan that show neither its surface nor its measures, so that they are drawn while it is measured."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.report.sample_frames import FrameSample, sample_frames
from footscan.report.scan.removed import removed_pictures
from footscan.side_by_side import together


class ScanPictures(NamedTuple):
    """Markup of the pictures."""

    frames: str
    """Frames of each camera with the points of the stripe; empty without frames."""
    removed: str
    """The points of each camera, coloured by why they were removed; empty without points."""


def scan_pictures(points: NDArray[np.void], codes: NDArray[np.uint8], samples: Sequence[FrameSample]) -> ScanPictures:
    """Draw the pictures of a scan.

    Parameters
    ----------
    points, codes : as of `removed_pictures`
    samples : frames of each camera, in the order shown
    """
    frames, removed = together(
        [lambda: sample_frames(samples) if samples else "", lambda: removed_pictures(points, codes)]
    )
    return ScanPictures(frames, removed)

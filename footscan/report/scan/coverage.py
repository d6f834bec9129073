"""Coverage of the foot by the stripe along the travel: points per frame, camera by camera."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.report.markup import number
from schemas.quality import CameraQuality

_MOST_TICKS = 8
"""Numbers below the plot; chosen by hand."""


def coverage_plot(cloud: NDArray[np.void], cameras: Sequence[CameraQuality]) -> str:
    """Draw a strip for each camera, as SVG: cloud points per frame, all cameras to one scale.

    `cloud` : (N,) of `footscan.cloud.points.POINT_DTYPE`
    """
    frames = max((camera.frames for camera in cameras), default=0)
    if not frames:
        return "<p>No frames.</p>"
    counts = [points_per_frame(cloud, camera.camera, frames) for camera in cameras]
    most = max(1, *(int(count.max()) for count in counts))
    strips = "\n".join(_strip(camera, count, most) for camera, count in zip(cameras, counts, strict=True))
    last = max(1, frames - 1)
    labels = "".join(f'<span style="left:{100 * tick / last:.2f}%">{tick}</span>' for tick in ticks(frames))
    return (
        f'<div class="coverage">\n{strips}\n<span></span><div class="ticks">{labels}</div><span></span>'
        '<span></span><div class="axis">frame</div><span></span></div>'
    )


def points_per_frame(cloud: NDArray[np.void], camera: int, frames: int) -> NDArray[np.int64]:
    """Count the points of `cloud` from each frame of `camera`, (frames,); points of later frames are left out."""
    frame = cloud["frame"][cloud["camera"] == camera]
    return np.bincount(frame[(frame >= 0) & (frame < frames)], minlength=frames)


def ticks(frames: int) -> range:
    """Frames with a label: multiples of 1, 2 or 5 times a power of ten, at most `_MOST_TICKS` of them.

    >>> list(ticks(30))
    [0, 5, 10, 15, 20, 25]
    """
    steps = (factor * 10**power for power in itertools.count() for factor in (1, 2, 5))
    return range(0, frames, next(step for step in steps if -(-frames // step) <= _MOST_TICKS))


def _strip(camera: CameraQuality, count: NDArray[np.int64], most: int) -> str:
    last = max(1, len(count) - 1)
    line = "L".join(f"{frame} {most - value}" for frame, value in enumerate(count))
    label = f"Camera {camera.camera}"
    return (
        f'<span>{label}</span><svg viewBox="0 0 {last} {most}" preserveAspectRatio="none" role="img" '
        f'aria-label="{label}: points per frame"><path class="area" d="M0 {most}L{line}L{last} {most}Z"/>'
        f'<path class="line" d="M{line}"/></svg><span class="n">{number(int(count.max()))}</span>'
    )

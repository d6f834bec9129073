"""Computes X of each frame, with its uncertainty: the place of the head when the camera exposed it.

Later steps want each frame at a place of its own. Nothing minds places in falling order or uneven steps; but a head
that stands films one stripe again and again. What stands still in a tenth of a film is taken for a glint of the
hardware and dropped, and stripes of one camera less than a quarter of a millimetre apart count as one, so that nothing
is gained by several. Of frames that were taken within `STANDING_MM` the first is kept; of a head that the controller
held, with its lasers off, none.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.capture.head_motion import HeadMotion
from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STANDING_MM = 0.1
"""Frames closer than this are of one place. Chosen by hand."""
LARGEST_SD_MM = 0.5
"""A frame whose place is less certain is dropped: its stripe could lie at the place of another frame. Chosen by
hand."""


@dataclass(frozen=True)
class Timed:
    """A time and its standard deviation, seconds."""

    seconds: float
    sd_s: float


@dataclass(frozen=True)
class FramePositions:
    """The frames of a camera's film, k = 0 to K - 1, in the order in which they were taken."""

    number: Ints
    """(K,) on the camera's own clock: numbers that were left out are in `dropped`."""
    x_mm: Floats
    """(K,) scanner frame."""
    sd_mm: Floats
    """(K,) standard deviation of each; of this, `shared_sd_mm` is the same error for all frames."""
    is_lost: NDArray[np.bool_]
    """(K,) frames that have a place but no picture."""
    dropped: dict[int, str]
    """Why a frame is not in the film, by its number."""
    shared_sd_mm: float
    """Standard deviation of the shift of all frames by the uncertainty of the latency."""
    mm_per_s: float
    """Median speed, positive towards +X."""


def frame_positions(number: Ints, seconds: Floats, sd_s: Floats, motion: HeadMotion, latency: Timed) -> FramePositions:
    """Compute the places of a camera's frames.

    Parameters
    ----------
    number : (N,) int64, ascending
        Of the frames that the camera gave; between the first and the last, numbers that are missing are lost frames.
    seconds, sd_s : (N,) float64
        When each frame was taken by the camera's clock, `time.monotonic()`, and the standard deviation of that.
    motion
        Of the camera's head.
    latency
        How much later than the controller's reports the camera's times are.

    Raises
    ------
    RefusedInput
        No frames, or numbers that do not ascend.
    """
    if not len(number) or np.any(np.diff(number) <= 0):
        raise RefusedInput("frames", f"{len(number)} frames, expected some, their numbers ascending")
    every = np.arange(number[0], number[-1] + 1)
    given = np.isin(every, number)
    taken = np.interp(every, number, seconds) - latency.seconds  # a lost frame between its neighbours
    taken_sd = np.interp(every, number, sd_s)
    dropped: dict[int, str] = {}
    inside = (taken >= motion.seconds[0]) & (taken <= motion.seconds[-1])
    for frame in np.flatnonzero(~inside):
        place = "before the first" if taken[frame] < motion.seconds[0] else "after the last"
        dropped[int(every[frame])] = f"taken {place} report of the head's place"
    x, speed, of_motion = motion.at(np.where(inside, taken, motion.seconds[0]))
    own = np.hypot(of_motion, speed * taken_sd)
    is_dark = inside & motion.may_stand(np.where(inside, taken, motion.seconds[0]), np.maximum(STANDING_MM, 2.0 * own))
    kept: list[int] = []
    for frame in np.flatnonzero(inside):
        if own[frame] > LARGEST_SD_MM:
            dropped[int(every[frame])] = (
                f"its place is known to {own[frame]:.1f} mm only: reports are missing around it"
            )
        elif is_dark[frame]:
            dropped[int(every[frame])] = "the controller held the head, and lasers are off then"
        elif kept and abs(x[frame] - x[kept[-1]]) < STANDING_MM:
            # A picture at this place that was lost is replaced by the next one that was not.
            if given[frame] and not given[kept[-1]]:
                dropped[int(every[kept[-1]])] = f"lost, at the place of frame {every[frame]}"
                kept[-1] = int(frame)
            else:
                dropped[int(every[frame])] = f"the head stood where it was at frame {every[kept[-1]]}"
        else:
            kept.append(int(frame))
    while kept and not given[kept[-1]]:
        dropped[int(every[kept.pop()])] = "lost at the end of the film"
    moving = np.abs(speed[kept])
    typical = float(np.median(speed[kept])) if kept else 0.0
    shared = float(np.median(moving) * latency.sd_s) if kept else 0.0
    return FramePositions(
        number=every[kept],
        x_mm=x[kept],
        sd_mm=np.hypot(own[kept], moving * latency.sd_s),
        is_lost=~given[kept],
        dropped=dict(sorted(dropped.items())),
        shared_sd_mm=shared,
        mm_per_s=typical,
    )


def write_positions(path: Path, x_mm: Iterable[float]) -> None:
    """Write the file of positions that scan.yaml names: columns frame,x_mm; under its name when it is complete."""
    partial = path.with_name(path.name + ".part")
    rows = "".join(f"{frame},{x:.4f}\n" for frame, x in enumerate(x_mm))
    partial.write_text("frame,x_mm\n" + rows, encoding="utf-8")
    partial.replace(path)

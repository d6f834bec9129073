"""Estimates a camera's latency against the controller from passes over one object in both directions.

A camera that is late by t sees the object displaced by v t along the travel, v being the speed of the pass: to one side
on the way forth, to the other on the way back. So no measure of the object and no calibration is needed, only that it
stays where it is. Its known length would tell nothing: both of its ends are displaced alike. What is compared is all of
the stripe, in figures that change smoothly with the place: sums of cosines over the picture.

The play of a drive displaces the object too, but alike at all speeds: passes at two speeds tell one from the other.
And a camera's times may waver because it exposes unevenly, or because its pictures are delivered so: the share of a
frame's delay that belongs to its exposure is the third unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.capture.head_motion import HeadMotion
from footscan.capture.pass_agreement import Agreement, PassFrames, Prior, agree
from footscan.stripe.points import StripePoints
from schemas.base.errors import Finding
from schemas.base.image_size import FRAME_SIZE

Floats = NDArray[np.float64]

LATENCIES = np.arange(-0.1, 0.5, 0.02)
"""Seconds, tried first. Chosen by hand."""
PLAY_MM = 0.1
"""Prior standard deviation of the play of a drive. Chosen by hand."""
LARGEST_PLAY_MM = 1.0
SHARE = (0.5, 0.5)
"""Prior mean and standard deviation of the share of delays. Chosen by hand."""
LEAST_DELAY_S = 5e-4
"""Delays that scatter less carry no information. Chosen by hand."""
LEAST_SPEED_CHANGE_MM_PER_S = 10.0
LARGEST_SD_S = 0.005
"""At 36 mm/s this is 0.2 mm."""
LARGEST_FRAME_SD_S = 0.006
"""Of what one frame says of the latency: at 36 mm/s this is 0.22 mm. A scan refuses frames whose places are known to
0.3 mm only, and the latency itself and the motion of the head take their share of that."""
LEAST_FRAMES = 20
LEAST_POINTS = 30
"""Least stripe points of a frame that shows the object. Chosen by hand."""
AROUND = 2
"""Frames before and after those that count too: there the object ends. Chosen by hand."""
WAVES = 4
"""Cosines of 0 to 3 half waves over the picture's columns and rows."""
COMPONENTS = 6
"""Number of principal components of the sums; most of the variance is that of the stripe's length. Chosen by hand."""
ROUNDS = 15
LARGEST_STEP = np.array([0.02, 0.2, 0.5])


@dataclass(frozen=True)
class Pass:
    """One camera's film of the object in one pass of the heads. Passes may go either way at any speed."""

    stripe: StripePoints
    """Of all frames; their `frame` is an index of the arrays below."""
    seconds: Floats
    """(F,) the camera's times, `time.monotonic()`, as even as its clock."""
    delay_s: Floats
    """(F,) how much later each frame came."""
    motion: HeadMotion
    """Of the camera's head."""


@dataclass(frozen=True)
class Latency:
    """A camera's latency and its related unknowns, estimated from passes over an object."""

    seconds: float
    """The camera's times less the controller's."""
    sd_s: float
    play_mm: float
    """How much farther apart than reported heads stand at one place on the way towards +X and on the way back."""
    play_sd_mm: float
    exposure_share: float
    """Of a frame's delay, 0 to 1: `seconds` + share * `delay_s` is the best time of it."""
    frame_sd_s: float
    """Standard deviation of such a time."""


def estimate_latency(camera: int, passes: Sequence[Pass]) -> Latency:
    """Estimate the latency of one camera.

    Two passes forth and back at full speed and two at a third of it leave about a millisecond.

    Raises
    ------
    Finding
        Too little is seen of the object, all passes go one way at one speed, passes contradict each other, or the
        latency cannot be told well enough.
    """
    frames = _observe(camera, passes)
    wavers = float(np.std(frames.delay_s)) > LEAST_DELAY_S
    start = np.array([0.0, 0.0, SHARE[0] if wavers else 0.0])
    # Where delays say nothing the share stays where it is.
    prior = Prior(start, np.array([0.0, PLAY_MM**-2, SHARE[1] ** -2 if wavers else 1e12]))
    scale = np.ones(frames.figures.shape[1])
    tried = [agree(frames, start + np.array([latency, 0.0, 0.0]), scale) for latency in LATENCIES]
    fit = min(tried, key=lambda each: each.cost)
    for _ in range(ROUNDS):
        fit = agree(frames, fit.unknown, scale, fit.local_weights())
        scale = scale * fit.scale()
        fit = agree(frames, fit.unknown, scale, fit.weights)
        step = np.clip(fit.step(prior), -LARGEST_STEP, LARGEST_STEP)
        fit = agree(frames, fit.unknown + step, scale, fit.weights)
        if abs(step[0]) < 1e-6:
            break
    covariance = fit.covariance(prior)
    _check(camera, fit, float(np.sqrt(covariance[0, 0])))
    return Latency(
        seconds=float(fit.unknown[0]),
        sd_s=float(np.sqrt(covariance[0, 0])),
        play_mm=float(fit.unknown[1]),
        play_sd_mm=float(np.sqrt(covariance[1, 1])),
        exposure_share=float(np.clip(fit.unknown[2], 0.0, 1.0)),
        frame_sd_s=fit.frame_sd_s(),
    )


def _observe(camera: int, passes: Sequence[Pass]) -> PassFrames:
    """Select the frames that show the object, and those around them."""
    sums, kept, speeds = [], [], []
    for each in passes:
        count = len(each.seconds)
        lit = np.flatnonzero(np.bincount(each.stripe["frame"], minlength=count) >= LEAST_POINTS)
        if len(lit) < LEAST_FRAMES:
            raise Finding(
                f"camera {camera} sees the object in {len(lit)} frames of a pass, expected {LEAST_FRAMES}: "
                "look at its picture, and at where the object stands"
            )
        kept.append(np.arange(max(lit[0] - AROUND, 0), min(lit[-1] + AROUND + 1, count)))
        sums.append(_cosine_sums(each.stripe, count)[kept[-1]])
        _, speed, _ = each.motion.at(np.clip(each.seconds[lit], each.motion.seconds[0], each.motion.seconds[-1]))
        speeds.append(float(np.median(speed)))
    if np.ptp(speeds) < LEAST_SPEED_CHANGE_MM_PER_S:
        raise Finding(
            f"camera {camera}: all passes go at {np.median(speeds):.0f} mm/s, expected passes in both directions: "
            "a latency shows in their difference alone"
        )
    return PassFrames(
        figures=_principal(np.concatenate(sums)),
        seconds=np.concatenate([each.seconds[frames] for each, frames in zip(passes, kept, strict=True)]),
        delay_s=np.concatenate([each.delay_s[frames] for each, frames in zip(passes, kept, strict=True)]),
        of_pass=np.repeat(np.arange(len(passes)), [len(frames) for frames in kept]),
        motions=[each.motion for each in passes],
    )


def _cosine_sums(stripe: StripePoints, frames: int) -> Floats:
    """(F, WAVES^2) sums over the points of each frame of products of cosines over the picture."""
    across, down = (
        np.cos(np.pi * np.arange(WAVES) * (stripe[axis][:, None] + 0.5) / size)
        for axis, size in zip(("i", "j"), FRAME_SIZE.px, strict=True)
    )
    products = (across[:, :, None] * down[:, None, :]).reshape(-1, WAVES**2)
    return np.stack([np.bincount(stripe["frame"], column, minlength=frames) for column in products.T], axis=1)


def _principal(sums: Floats) -> Floats:
    """Return the largest principal components (N, COMPONENTS), each with a standard deviation of 1."""
    centred = sums - sums.mean(axis=0)
    components, _, _ = np.linalg.svd(centred, full_matrices=False)
    return np.asarray(components[:, :COMPONENTS] * np.sqrt(len(sums)))


def _check(camera: int, fit: Agreement, sd_s: float) -> None:
    play = fit.unknown[1]
    if abs(play) > LARGEST_PLAY_MM:
        raise Finding(
            f"camera {camera}: forth and back the object stands {abs(play):.1f} mm apart besides the latency, "
            f"expected {LARGEST_PLAY_MM:g} mm at most: was it moved, or did the head lose steps?"
        )
    if not sd_s <= LARGEST_SD_S:
        raise Finding(
            f"camera {camera}: its latency is known to {1e3 * sd_s:.1f} ms only, expected {1e3 * LARGEST_SD_S:g} ms: "
            "make more passes, slow ones too, and let the object stand askew to the travel"
        )
    if not fit.frame_sd_s() <= LARGEST_FRAME_SD_S:
        raise Finding(
            f"camera {camera}: single frames are {1e3 * fit.frame_sd_s():.0f} ms off what all passes together say, "
            f"expected {1e3 * LARGEST_FRAME_SD_S:g} ms at most: was the object moved, did the head lose steps, was "
            "this computer held up, or does the camera adjust its exposure?"
        )

"""The Cramér-Rao bound of a laser stripe's centre: what no unbiased extraction can beat on a webcam's frames.

    .venv/bin/python -m benchmarks.cramer_rao

The stripe is straight, runs along a row of pixels and has a Gaussian profile; the light at x px across it is

    light(x) = peak (1 - halo) exp(-(x - c)^2 / 2 sigma^2) + glow(x - c) + base

in red and in units of the sensor's white. Green and blue see the laser through their filters' leaks, and the base in
the room's colour on skin. Speckle multiplies the line. The sensor measures one colour a pixel, with shot and read
noise, and cuts at its white. Compression and the rounding to 8 bits count as further noise. c, sigma, peak and base are
unknown, and all of them are estimated.

For Gaussian observations of mean m and covariance S, the Fisher information of parameters a and b is
m_a' S^-1 m_b + tr(S^-1 S_a S^-1 S_b) / 2, indices being derivatives (S. M. Kay, "Fundamentals of Statistical Signal
Processing: Estimation Theory", 1993, equation 3.31). Both terms count here: speckle and shot noise make the noise
itself move with the stripe. The bound is that of the sensor's own pixels, so it holds for what is computed from them.

A column of the picture shows more than a column of the sensor: the mosaic is interpolated from one pixel to either side
and colour after compression from two. What reads 1 px of a picture is to be held against a stretch of 5.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.ndimage import gaussian_filter
from scipy.stats import norm

from footscan.frames.image import decode_image
from footscan.virtual.filming.render import LASER_COLOUR
from footscan.virtual.optics.scene import SKIN
from footscan.virtual.optics.sensor import FULL_WELL_ELECTRONS, READ_NOISE, compress, photograph
from footscan.virtual.room.room import LEVELS
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

ROOM_COLOUR = np.array(SKIN.albedo) / SKIN.albedo[0]
FACING = 0.6
"""Share of the room's light that a typical place of a foot receives: its sole faces away from the lamps."""
ROOMS = {name: level * SKIN.albedo[0] * FACING for name, level in LEVELS.items()}
"""By condition, the base in red."""
PHASES = np.arange(0.0, 2.0, 0.5)
"""Places of the centre in the mosaic, px, over which the information is averaged."""
LEAST_SHARE = 1e-6
"""Pixels that keep less of their information than this are left out."""
GLOW = ((0.6, 5.2), (0.4, 14.0))
"""Share and standard deviation in px of each Gaussian of the light that skin scatters."""
GLOW_REACH_PX = 35.0


@dataclass(frozen=True)
class Stripe:
    """A stripe as `centre_bound` takes it."""

    sigma_px: float
    peak: float
    base: float
    speckle: float
    halo: float = 0.0

    @property
    def unknown(self) -> Floats:
        """Centre, sigma, peak and base: what an extraction has to estimate."""
        return np.array([0.0, self.sigma_px, self.peak, self.base])


@dataclass(frozen=True)
class Webcam:
    """What becomes of the light; the defaults are those of the virtual scanner."""

    electrons: float = FULL_WELL_ELECTRONS
    """At the sensor's white: shot noise has a variance of light / electrons."""
    read_noise: float = READ_NOISE
    """In units of the sensor's white."""
    grain_px: float = 0.55
    """Standard deviation of the Gaussian that white noise passes through to become speckle; 0: it stays white."""
    mosaic: bool = True
    """One colour a pixel, RG over GB; otherwise every pixel is red."""
    jpeg_quality: int | None = 85
    """None: neither compressed nor rounded to 8 bits."""


WEBCAM = Webcam()


def main() -> None:
    print("Cramér-Rao bound of the centre, px, for a stretch of 1 px and of 9 px")
    for name, halo in (("matt", 0.0), ("skin", SKIN.halo)):
        for peak in (0.6, 24.0):
            print(f"\n{name}, peak {peak} times the sensor's white")
            cells = list(product((1.5, 2.5, 4.0), (0.10, 0.15)))
            print("  sigma, speckle  " + "".join(f"{f'{sigma} px, {speckle:.2f}':>18}" for sigma, speckle in cells))
            for room, base in ROOMS.items():
                bounds = [
                    " ".join(f"{centre_bound(sigma, peak, base, speckle, along, halo=halo):.4f}" for along in (1, 9))
                    for sigma, speckle in cells
                ]
                print(f"  {room:<16}" + "".join(f"{text:>18}" for text in bounds))


def centre_bound(
    sigma_px: float,
    peak: float,
    base: float,
    speckle: float,
    along_px: int = 1,
    *,
    halo: float = 0.0,
    webcam: Webcam = WEBCAM,
) -> float:
    """Least standard deviation, px, of an unbiased centre across the stripe.

    Parameters
    ----------
    sigma_px : float
        Standard deviation of the profile on the sensor, px.
    peak, base : float
        Laser light in the middle of the stripe, and room light, in red, in units of the sensor's white.
    speckle : float
        Contrast in one pixel: standard deviation over mean.
    along_px : int
        Length in px of the straight stretch that shares one centre, and one sigma, peak and base.
    halo : float
        Share of the laser's light that skin scatters to the sides of the line, where it does not speckle.
    """
    stripe = Stripe(sigma_px, peak, base, speckle, halo)
    compression = np.zeros(3) if webcam.jpeg_quality is None else compression_noise(stripe, webcam.jpeg_quality)
    columns = (0, 1) if webcam.mosaic and along_px % 2 else (0,)
    information = np.mean(
        [_information(_Patch(stripe, webcam, along_px, start), compression) for start in product(PHASES, columns)],
        axis=0,
    )
    scale = np.sqrt(np.diag(information))  # of parameters of different units
    return float(np.sqrt(np.linalg.inv(information / np.outer(scale, scale))[0, 0]) / scale[0])


@lru_cache(maxsize=256)
def compression_noise(stripe: Stripe, quality: int) -> Floats:
    """(3,) variance that JPEG and 8 bits add to red, green and blue, grey levels squared, measured on a picture.

    Quality 100 is the reference: it samples colour as coarsely, which is a blur and no noise, and rounds hardly at all.
    Red and blue are measured once in 2 x 2 pixels and green twice, so the mean error of so many pixels is what counts.
    The stripe is slightly inclined, for all its places in the blocks of 8 x 8. The error counts as white noise.
    """
    rows, columns = np.mgrid[0:64, 0:960]
    across = rows - 24.0 - columns / 60.0
    random = np.random.default_rng(1)
    grain = gaussian_filter(random.standard_normal(across.shape), WEBCAM.grain_px)
    line, glow = _laser(across, stripe.unknown, stripe.halo)
    laser = line * (1.0 + stripe.speckle * grain / grain.std()) + glow
    light = laser[..., None] * np.array(LASER_COLOUR) + stripe.base * ROOM_COLOUR
    settings = SimulationSettings(jpeg_quality=quality)
    picture = photograph(light.astype(np.float32), random, settings)
    best = compress(picture, settings.model_copy(update={"jpeg_quality": 100}))
    error = decode_image(compress(picture, settings)).astype(np.float64) - decode_image(best)
    near = np.abs(across) <= _reach(stripe)
    pairs, near_pairs = (error[:, ::2] + error[:, 1::2]) / 2.0, near[:, ::2]
    squares, near_squares = (pairs[::2] + pairs[1::2]) / 2.0, near_pairs[::2]
    red, blue = squares[near_squares].var(axis=0)[[0, 2]]
    return np.array([red, pairs[near_pairs].var(axis=0)[1], blue]) + 1.0 / 12.0


class _Patch:
    """The pixels across a stretch of the stripe, and the mean and covariance of what they measure."""

    def __init__(self, stripe: Stripe, webcam: Webcam, along_px: int, start: tuple[float, int]) -> None:
        """`start`: row of the stripe's middle, from 0 to 2, and the patch's first column."""
        self.stripe, self.webcam = stripe, webcam
        middle, first = start
        reach = _reach(stripe)
        rows = np.arange(np.floor(middle - reach), np.ceil(middle + reach) + 1)
        row, column = (grid.ravel() for grid in np.meshgrid(rows, first + np.arange(along_px), indexing="ij"))
        colour = (row % 2 + column % 2).astype(np.intp) if webcam.mosaic else np.zeros(len(row), np.intp)
        self.across = np.asarray(row - middle, np.float64)
        self.colour = colour
        self.laser_colour, self.room_colour = np.array(LASER_COLOUR)[colour], ROOM_COLOUR[colour]
        grain = grain_correlation(webcam.grain_px, max(len(rows), along_px))
        self.grain = np.kron(toeplitz(grain[: len(rows)]), toeplitz(grain[:along_px]))

    def moments(self, unknown: Floats) -> tuple[Floats, Floats]:
        """(N,) mean and (N, N) covariance before the sensor cuts at white, given centre, sigma, peak and base."""
        line, glow = _laser(self.across, unknown, self.stripe.halo)
        line, glow = self.laser_colour * line, self.laser_colour * glow
        mean = line + glow + unknown[3] * self.room_colour
        speckle = self.stripe.speckle**2 * self.grain * np.outer(line, line)
        own = mean / self.webcam.electrons + self.webcam.read_noise**2
        return mean, np.asarray(speckle + np.diag(own), np.float64)


def _information(patch: _Patch, compression: Floats) -> Floats:
    """(4, 4) Fisher information of centre, sigma, peak and base."""
    unknown = patch.stripe.unknown
    mean, covariance = patch.moments(unknown)
    added = compression[patch.colour] / _tone_slope(mean) ** 2
    variance = np.diag(covariance) + added
    kept = _share_below_white((1.0 - mean) / np.sqrt(variance))
    seen = kept > LEAST_SHARE
    noise = covariance + np.diag(added + variance * (1.0 / np.maximum(kept, LEAST_SHARE) - 1.0))
    factor = cho_factor(noise[np.ix_(seen, seen)])
    slopes, weighted = [], []
    for step in np.diag(1e-4 * np.array([unknown[1], unknown[1], unknown[2], max(unknown[3], 0.01 * unknown[2])])):
        (high, high_covariance), (low, low_covariance) = patch.moments(unknown + step), patch.moments(unknown - step)
        slopes.append((high - low)[seen] / (2.0 * step.sum()))
        slope = (high_covariance - low_covariance)[np.ix_(seen, seen)] / (2.0 * step.sum())
        weighted.append(cho_solve(factor, slope))
    of_mean = np.array(slopes) @ cho_solve(factor, np.array(slopes).T)
    return np.asarray(of_mean + 0.5 * np.einsum("aij,bji->ab", weighted, weighted))


def _share_below_white(distance: Floats) -> Floats:
    """Share of the information on its mean that a Gaussian keeps when it is cut `distance` standard deviations above.

    -E[d^2 log L / d mean^2] of an observation censored on the right, of unit variance. Noise of the variance
    (1 / share - 1) times its own costs an independent pixel as much; for pixels with speckle in common it stands in.
    """
    density, cut = norm.pdf(distance), np.maximum(norm.sf(distance), 1e-300)
    return np.asarray(norm.cdf(distance) - distance * density + density**2 / cut)


def _laser(across: Floats, unknown: Floats, halo: float) -> tuple[Floats, Floats]:
    """Laser light in red at places across the stripe: the line, and what skin has scattered."""
    centre, sigma, peak, _ = unknown
    x = across - centre
    line: Floats = np.exp(-0.5 * (x / sigma) ** 2)
    glow: Floats = np.zeros(x.shape)
    for share, spread_px in GLOW:
        wide = np.hypot(sigma, spread_px)
        glow += share * sigma / wide * np.exp(-0.5 * (x / wide) ** 2)
    return peak * (1.0 - halo) * line, peak * halo * glow


def _reach(stripe: Stripe) -> float:
    """Half the breadth in px over which the stripe stands out: the line down to a thousandth of white, and its glow."""
    line = stripe.sigma_px * max(3.0, float(np.sqrt(2.0 * np.log(max(stripe.peak, 1e-3) / 1e-3))))
    return max(line, GLOW_REACH_PX) if stripe.halo > 0.0 else line


def grain_correlation(grain_px: float, length: int) -> Floats:
    """(length,) correlation of speckle 0, 1, 2 ... px apart along rows or columns; along both, it is the product."""
    kernel = np.exp(-0.5 * (np.arange(-4, 5) / max(grain_px, 0.01)) ** 2)
    apart = np.convolve(kernel, kernel)[len(kernel) - 1 :]
    return np.pad(apart / apart[0], (0, length))[:length]


def _tone_slope(light: Floats) -> Floats:
    """Grey levels for each unit of light: the slope of the webcam's curve, sRGB blended with a smooth step."""
    light = np.clip(light, 0.0031308, 1.0)
    code, slope = 1.055 * light ** (1 / 2.4) - 0.055, 1.055 / 2.4 * light ** (1 / 2.4 - 1.0)
    return np.asarray(255.0 * slope * (0.75 + 0.25 * 6.0 * code * (1.0 - code)))


if __name__ == "__main__":
    main()

"""Loops of a section in their plane, with the noise of the mesh smoothed away."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, fftfreq, ifft, next_fast_len

from footscan.compiled import compiled
from footscan.mesh.sections import Loop

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEP_MM = 0.5
"""Distance between the samples of a loop at which it is smoothed; chosen by hand."""
ORDER = 3
"""Order of the low-pass filter, as of Butterworth: one minus the response grows with the 2 * ORDER-th power of the
frequency, so forms much longer than the wavelength stay as they are. Chosen by hand."""
SLOPE_VARIANCE = 0.0006
"""Variance of the slopes that noise may leave in an outline; around a ball of 40 mm radius it makes a tape 0.08 mm
longer. Chosen by hand."""


class Plane(NamedTuple):
    """A plane and two directions in it."""

    point: Floats
    """(3,) mm"""
    normal: Floats
    """(3,) unit vector"""
    first: Floats
    """(3,) unit vector; horizontal unless the plane is"""
    second: Floats
    """(3,) unit vector across `first`; upwards unless the plane is horizontal"""

    @classmethod
    def across(cls, point: Floats, direction: Floats) -> Self:
        """The plane through (3,) `point` across (3,) `direction`."""
        normal = direction / np.linalg.norm(direction)
        level = np.hypot(normal[0], normal[1]) < 1e-9
        first = np.array([1.0, 0.0, 0.0]) if level else np.array([-normal[1], normal[0], 0.0])
        first /= np.linalg.norm(first)
        (x, y, z), (u, v, w) = normal.tolist(), first.tolist()
        return cls(point, normal, first, np.array([y * w - z * v, z * u - x * w, x * v - y * u]))

    def flat(self, points: Floats) -> Floats:
        """Returns (N, 2) coordinates in the plane of (N, 3) `points`, mm.

        Examples
        --------
        >>> plane = Plane.across(np.array([0.0, 0, 5]), np.array([1.0, 0, 0]))
        >>> plane.flat(np.array([[0.0, 2, 8]])).tolist()
        [[2.0, 3.0]]
        """
        flat: Floats = (points - self.point) @ np.array([self.first, self.second]).T
        return flat

    def solid(self, points: Floats) -> Floats:
        """Returns (N, 3) points, mm, from their (N, 2) coordinates in the plane."""
        solid: Floats = self.point + points[:, :1] * self.first + points[:, 1:] * self.second
        return solid


class Outline(NamedTuple):
    """A smoothed loop."""

    points: Floats
    """(N, 2) mm, in the plane; one for each point of the loop"""
    plane: Plane
    loop: Loop
    places: Floats
    """(N,) places of the points along the loop, in steps of its even sampling"""
    response: Floats | None
    """(M,) response of the filter at the frequencies of that sampling; None if the loop is not filtered"""
    noise: float
    """Standard deviation of the points of the loop before smoothing, mm"""

    def smoothed(self, displacement: Floats) -> Floats:
        """Returns (N, 2) a displacement of the loop's points, (N, 2), smoothed as the points were."""
        if self.response is None:
            return displacement
        sampled = _sampled(displacement, self.places, len(self.response))
        return _interpolated(_filtered(sampled, self.response), self.places)

    def raw_gradient(self, gradient: Floats) -> Floats:
        """Returns (N, 2) derivatives by the points of the loop, from (N, 2) derivatives by the smoothed points."""
        if self.response is None:
            return gradient
        spread = _spread_back(gradient, self.places, len(self.response))
        return _sampled_back(_filtered(spread, self.response), self.places)


def smooth_outline(loop: Loop, plane: Plane, noise: Floats) -> Outline:
    """Smooth the noise of the mesh out of a loop. A loop without noise stays as it is, with its corners.

    Parameters
    ----------
    noise : (N, 2) standard deviations, mm, in the plane, of the two vertices of each edge that the loop crosses
    """
    points = plane.flat(loop.points)
    median_noise, along = _median_noise(loop.shares, noise), _lengths_along(points)
    count = next_fast_len(max(int(np.ceil(along[-1] / STEP_MM)), 8))
    places = along[:-1] * (count / along[-1])
    frequencies = fftfreq(count, along[-1] / count)
    wavelength = _wavelength(median_noise, along[-1] / len(points))
    response = 1.0 / (1.0 + (wavelength * frequencies) ** (2 * ORDER)) if wavelength > 2 * STEP_MM else None
    outline = Outline(points, plane, loop, places, response, median_noise)
    return outline._replace(points=outline.smoothed(points))


@compiled
def _median_noise(shares: Floats, noise: Floats) -> float:
    """Median noise, mm, of points at (N,) shares of edges whose ends have (N, 2) noise."""
    return float(np.median(np.hypot((1 - shares) * noise[:, 0], shares * noise[:, 1])))


@compiled
def _lengths_along(polygon: Floats) -> Floats:
    """Returns (N + 1,) lengths along a closed (N, 2) polygon to each of its points, mm; the last is its perimeter."""
    along = np.zeros(len(polygon) + 1)
    for k in range(len(polygon)):
        start, end = polygon[k], polygon[(k + 1) % len(polygon)]
        along[k + 1] = along[k] + np.hypot(end[0] - start[0], end[1] - start[1])
    return along


def _wavelength(noise: float, spacing: float) -> float:
    """Cut-off wavelength in mm for points `spacing` apart, so that a tape is not lifted by crests of the noise.

    A tape around a circle of radius R that is wavy with slopes of variance s² is longer by pi R s². White noise of
    variance n² at a spacing d keeps s² = n² d (2 pi / W)³ / (3 pi) when all waves shorter than W are removed.
    """
    return float(2 * np.pi * np.cbrt(noise**2 * spacing / (3 * np.pi * SLOPE_VARIANCE)))


@compiled
def _sampled(points: Floats, places: Floats, count: int) -> Complex:
    """Returns (M,) even samples along a closed polygon, X + iY."""
    sampled = np.empty(count, np.complex128)
    before, share = _spans(places, count)
    for k in range(count):
        start, end = points[before[k]], points[(before[k] + 1) % len(points)]
        x, y = start[0] + share[k] * (end[0] - start[0]), start[1] + share[k] * (end[1] - start[1])
        sampled[k] = complex(x, y)
    return sampled


@compiled
def _interpolated(sampled: Complex, places: Floats) -> Floats:
    """Returns (N, 2) points at `places` between even samples."""
    points = np.empty((len(places), 2))
    for n in range(len(places)):
        before = min(int(places[n]), len(sampled) - 1)
        start, end = sampled[before], sampled[(before + 1) % len(sampled)]
        point = start + (places[n] - before) * (end - start)
        points[n, 0], points[n, 1] = point.real, point.imag
    return points


@compiled
def _spans(places: Floats, count: int) -> tuple[NDArray[np.int64], Floats]:
    """Returns (M,) the point of the polygon before each even sample, and (M,) the share of the way to the next."""
    before, share = np.empty(count, np.int64), np.empty(count)
    point = 0
    for k in range(count):
        while point + 1 < len(places) and places[point + 1] <= k:
            point += 1
        end = places[point + 1] if point + 1 < len(places) else float(count)
        before[k], share[k] = point, (k - places[point]) / max(end - places[point], 1e-12)
    return before, share


def _filtered(sampled: Complex, response: Floats) -> Complex:
    signal: Complex = ifft(fft(sampled) * response)
    return signal


@compiled
def _spread_back(gradient: Floats, places: Floats, count: int) -> Complex:
    """The transpose of `_interpolated`."""
    back = np.zeros(count, np.complex128)
    for n in range(len(places)):
        before = min(int(places[n]), count - 1)
        moved = complex(gradient[n, 0], gradient[n, 1])
        back[before] += (1 - (places[n] - before)) * moved
        back[(before + 1) % count] += (places[n] - before) * moved
    return back


@compiled
def _sampled_back(gradient: Complex, places: Floats) -> Floats:
    """The transpose of `_sampled`."""
    back = np.zeros((len(places), 2))
    before, share = _spans(places, len(gradient))
    for k in range(len(gradient)):
        for point, part in ((before[k], 1 - share[k]), ((before[k] + 1) % len(places), share[k])):
            back[point, 0] += part * gradient[k].real
            back[point, 1] += part * gradient[k].imag
    return back


def polygon_area(polygon: Floats) -> float:
    """Area of (N, 2) corners in mm², positive if they run counter-clockwise."""
    ahead = np.roll(polygon, -1, axis=0)
    return float(0.5 * np.sum(polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0]))

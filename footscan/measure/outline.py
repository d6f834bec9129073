"""A loop in its plane, with the noise of the mesh smoothed away."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, fftfreq, ifft, next_fast_len

from footscan.compiled import compiled
from footscan.mesh.sections import Loop

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEP_MM = 0.5
"""Between the places along a loop at which it is smoothed."""
ORDER = 3
"""Of the low-pass filter: one minus its answer grows with the 2 * ORDER-th power of the frequency, so forms much longer
than its wavelength stay as they are."""
SLOPE_VARIANCE = 0.0006
"""So much noise is left in an outline; around a ball of 40 mm radius it makes a tape 0.08 mm longer."""


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
        """(N, 2) coordinates in the plane of (N, 3) `points`, mm."""
        flat: Floats = (points - self.point) @ np.array([self.first, self.second]).T
        return flat

    def solid(self, points: Floats) -> Floats:
        """(N, 3) points of the plane from their (N, 2) coordinates."""
        there: Floats = self.point + points[:, :1] * self.first + points[:, 1:] * self.second
        return there


class Outline(NamedTuple):
    """A smoothed loop."""

    points: Floats
    """(N, 2) mm, in the plane; one for each of the loop's."""
    plane: Plane
    loop: Loop
    places: Floats
    """(N,) where they are along the loop, in steps of its even sampling."""
    answer: Floats | None
    """(M,) the filter's, at the frequencies of that sampling; None where nothing is filtered."""
    noise: float
    """Standard deviation of the loop's own points, mm."""

    def smoothed(self, displacement: Floats) -> Floats:
        """(N, 2) what a displacement, (N, 2), of the loop's own points comes to when it is smoothed as they were."""
        if self.answer is None:
            return displacement
        return _interpolated(_filtered(_sampled(displacement, self.places, len(self.answer)), self.answer), self.places)

    def raw_gradient(self, gradient: Floats) -> Floats:
        """(N, 2) derivatives by the loop's own points, from those, (N, 2), by the smoothed ones."""
        if self.answer is None:
            return gradient
        return _sampled_back(_filtered(_spread_back(gradient, self.places, len(self.answer)), self.answer), self.places)


def smooth_outline(loop: Loop, plane: Plane, noise: Floats) -> Outline:
    """The loop without the noise of the mesh. A loop without noise stays as it is, with its corners.

    Parameters
    ----------
    noise : (N, 2) standard deviation, in the plane, of the vertices of the loop's edges, mm
    """
    points = plane.flat(loop.points)
    usual, along = _usual_noise(loop.shares, noise), _lengths_along(points)
    count = next_fast_len(max(int(np.ceil(along[-1] / STEP_MM)), 8))
    places = along[:-1] * (count / along[-1])
    frequencies = fftfreq(count, along[-1] / count)
    wavelength = _wavelength(usual, along[-1] / len(points))
    answer = 1.0 / (1.0 + (wavelength * frequencies) ** (2 * ORDER)) if wavelength > 2 * STEP_MM else None
    outline = Outline(points, plane, loop, places, answer, usual)
    return outline._replace(points=outline.smoothed(points))


@compiled
def _usual_noise(shares: Floats, noise: Floats) -> float:
    """The median of that of points which lie at (N,) shares of edges with (N, 2) noise at their ends, mm."""
    return float(np.median(np.hypot((1 - shares) * noise[:, 0], shares * noise[:, 1])))


@compiled
def _lengths_along(polygon: Floats) -> Floats:
    """(N + 1,) how far along a closed (N, 2) polygon each of its points is, mm; the first one once more at the end."""
    along = np.zeros(len(polygon) + 1)
    for k in range(len(polygon)):
        start, end = polygon[k], polygon[(k + 1) % len(polygon)]
        along[k + 1] = along[k] + np.hypot(end[0] - start[0], end[1] - start[1])
    return along


def _wavelength(noise: float, spacing: float) -> float:
    """The wavelength, mm, below which noise has to go, of points `spacing` apart, lest a tape lies on its crests.

    A tape around a circle of radius R that is wavy with slopes of variance s² is longer by pi R s². White noise of
    variance n² at a spacing d has s² = n² d (2 pi / W)³ / (3 pi) left when all shorter than W is gone.
    """
    return float(2 * np.pi * np.cbrt(noise**2 * spacing / (3 * np.pi * SLOPE_VARIANCE)))


@compiled
def _sampled(points: Floats, places: Floats, count: int) -> Complex:
    """(M,) the closed polygon at even places along it, X + iY."""
    sampled = np.empty(count, np.complex128)
    before, share = _spans(places, count)
    for k in range(count):
        start, end = points[before[k]], points[(before[k] + 1) % len(points)]
        x, y = start[0] + share[k] * (end[0] - start[0]), start[1] + share[k] * (end[1] - start[1])
        sampled[k] = complex(x, y)
    return sampled


@compiled
def _interpolated(sampled: Complex, places: Floats) -> Floats:
    """(N, 2) even samples at `places` between them."""
    points = np.empty((len(places), 2))
    for n in range(len(places)):
        before = min(int(places[n]), len(sampled) - 1)
        start, end = sampled[before], sampled[(before + 1) % len(sampled)]
        point = start + (places[n] - before) * (end - start)
        points[n, 0], points[n, 1] = point.real, point.imag
    return points


@compiled
def _spans(places: Floats, count: int) -> tuple[NDArray[np.int64], Floats]:
    """(M,) the point of the polygon before each even place along it, and (M,) the share of the way to the next one."""
    before, share = np.empty(count, np.int64), np.empty(count)
    point = 0
    for k in range(count):
        while point + 1 < len(places) and places[point + 1] <= k:
            point += 1
        end = places[point + 1] if point + 1 < len(places) else float(count)
        before[k], share[k] = point, (k - places[point]) / max(end - places[point], 1e-12)
    return before, share


def _filtered(sampled: Complex, answer: Floats) -> Complex:
    signal: Complex = ifft(fft(sampled) * answer)
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

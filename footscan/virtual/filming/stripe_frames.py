"""Films of a stripe whose centre is a known curve in the image: no object is traced, no camera model is involved.

Light across the stripe is a Gaussian of the distance to the curve; from there on it goes the way of the virtual
scanner's light: halo, speckle, room, glints, sensor, JPEG.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt, gaussian_filter

from footscan.compiled import compiled
from footscan.virtual.filming.render import laser_colour, light_on_sensor
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, standard_scanner
from footscan.virtual.optics.scene import SKIN
from footscan.virtual.optics.sensor import compress, photograph
from footscan.virtual.room.room import COARSE, LEVELS, Backdrop, backdrop
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

CENTRE = np.array([(WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0])
"""Middle of the picture, (i, j): curves are made around it and turn about it."""
GHOST_STRENGTH = 0.1
"""Strength of the stripe's parallel image in glass, as a share of the stripe. Chosen by hand."""
VISIBLE = 0.05
"""The stripe is visible where it raises some colour by this share of the sensor's white. Chosen by hand."""
SHADE = (0.95, 0.35)
"""Room light at the top and at the bottom of the picture, as a share of that on a surface that faces the lamps. Chosen
by hand."""
_OBJECT_PX = 60.0
"""The object reaches this far beside an open stripe. Chosen by hand."""
_CHORD_PX = 2.0
"""Length of the chords of a curve. Chosen by hand."""


@dataclass(frozen=True)
class Curve:
    """A polyline in the image. The polyline itself is the exact centre, not the curve that it approximates."""

    points: Floats
    """(N, 2) i, j, px."""
    closed: bool = False
    """True if the last point is joined to the first."""

    def segments(self) -> tuple[Floats, Floats]:
        """Starts and ends, (S, 2) each."""
        ends = np.roll(self.points, -1, axis=0)
        return (self.points, ends) if self.closed else (self.points[:-1], ends[:-1])


@dataclass(frozen=True)
class Clutter:
    """Red light apart from the stripe. The settings add glints and bright hardware, as in the virtual scanner."""

    ghost_px: float = 25.0
    """Distance of the ghost from the stripe, to its positive side; see `signed_distance` for the side."""
    second: Curve | None = None
    """Another stripe; it moves as the stripe does."""
    second_strength: float = 0.04
    red_thing: tuple[float, float, float] | None = None
    """i, j and radius, px, of a broad red object, which stands still."""


@dataclass(frozen=True)
class StripeFilm:
    """A stripe that moves through the picture.

    The `settings` of the object's and the scanner's geometry and `blur_px` are ignored: only `sigma_px` widens the
    stripe.
    """

    curves: tuple[Curve, ...]
    """Where the stripe is in frame 0."""
    sigma_px: float
    """Standard deviation of the Gaussian across the stripe."""
    settings: SimulationSettings
    """`laser_exposure` is the laser's light at the centre, with the halo's share in it, 1 being the sensor's white."""
    step_px: tuple[float, float] = (1.3, 2.1)
    """Movement from frame to frame."""
    turn_degrees: float = 0.0
    """Turn about the middle of the picture from frame to frame."""
    clutter: Clutter | None = None


class StripeFilmer:
    """Films a `StripeFilm`; equal films give equal bytes, in whatever order frames are requested."""

    def __init__(self, film: StripeFilm) -> None:
        self._film = film
        self._settings = film.settings.model_copy(update={"blur_px": 0.0})
        level = LEVELS[film.settings.ambient]
        self._backdrop = _with_red_thing(film, level)
        self._brightness = level * _shade(film.settings)

    def jpeg(self, frame: int) -> bytes:
        """Returns the JPEG of frame number `frame`."""
        return compress(self.picture(frame), self._settings)

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Returns the picture before compression, (rows, columns, 3) uint8 RGB."""
        random = np.random.default_rng([self._settings.seed, frame, 6])
        return photograph(self.light(frame, random), random, self._settings)

    def light(self, frame: int, random: np.random.Generator) -> Singles:
        """Light on the sensor, (rows, columns, 3) float32, 1 being its white."""
        stripe = self._laser_light(frame)
        coverage = _object(self.curves(frame))
        lit = self._brightness * coverage
        return light_on_sensor(stripe, lit, coverage, SKIN, self._backdrop, self._settings, random)

    def curves(self, frame: int) -> tuple[Curve, ...]:
        """The exact centres of the stripe in frame number `frame`."""
        return tuple(self._moved(curve, frame) for curve in self._film.curves)

    def visible_centres(self, frame: int) -> Floats:
        """(M, 2) points of `curves`, one every half a pixel, in the picture and where the stripe is `VISIBLE`."""
        points = np.concatenate([_resampled(curve, 0.5) for curve in self.curves(frame)])
        inside = (points >= 0.0).all(axis=1) & (points <= [WIDTH - 1, HEIGHT - 1]).all(axis=1)
        points = points[inside]
        i, j = np.rint(points).astype(int).T
        room = self._brightness[j // COARSE, i // COARSE, None] * np.array(SKIN.albedo)
        lit = room + self._settings.laser_exposure * laser_colour(self._settings)
        gain = np.minimum(lit, 1.0) - np.minimum(room, 1.0)
        return np.asarray(points[gain.max(axis=1) >= VISIBLE])

    def _laser_light(self, frame: int) -> Floats:
        film, clutter = self._film, self._film.clutter
        shown = [(curve, 1.0) for curve in self.curves(frame)]
        if clutter is not None:
            ghost = GHOST_STRENGTH * film.settings.ghost
            shown += [(parallel(curve, clutter.ghost_px), ghost) for curve in self.curves(frame) if ghost > 0.0]
            if clutter.second is not None:
                shown.append((self._moved(clutter.second, frame), clutter.second_strength))
        picture = np.zeros((HEIGHT, WIDTH))
        for curve, strength in shown:
            _paint(*curve.segments(), curve.closed, film.sigma_px, film.settings.laser_exposure * strength, picture)
        return picture

    def _moved(self, curve: Curve, frame: int) -> Curve:
        angle = np.radians(self._film.turn_degrees * frame)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return Curve((curve.points - CENTRE) @ turn.T + CENTRE + frame * np.array(self._film.step_px), curve.closed)


def straight_line(degrees: float, offset_px: float = 0.0, length_px: float = 2000.0) -> Curve:
    """A line that runs in the direction (cos, sin) of `degrees`, `offset_px` along (-sin, cos) from the middle."""
    along, across = _directions(degrees)
    return Curve(CENTRE + offset_px * across + np.outer([-length_px / 2.0, length_px / 2.0], along))


def sinusoid(degrees: float, amplitude_px: float, period_px: float, length_px: float = 1200.0) -> Curve:
    """A sine around a line through the middle of the picture."""
    along, across = _directions(degrees)
    s = np.arange(-length_px / 2.0, length_px / 2.0 + _CHORD_PX, _CHORD_PX)
    t = amplitude_px * np.sin(2.0 * np.pi * s / period_px)
    return Curve(CENTRE + np.outer(s, along) + np.outer(t, across))


def foot_section(radius_px: float, degrees: float = 0.0) -> Curve:
    """A closed curve like a section of a foot: wider than high, a dome over a flatter sole."""
    angle = np.arange(0.0, 2.0 * np.pi, _CHORD_PX / (1.3 * radius_px))
    radius = radius_px * (1.0 + 0.2 * np.cos(2.0 * angle) + 0.06 * np.sin(3.0 * angle))
    along, across = _directions(degrees)
    points = np.outer(radius * np.cos(angle), along) + np.outer(radius * np.sin(angle), across)
    return Curve(CENTRE + points, closed=True)


def cross_profile(profile_mm: Sequence[Sequence[float]], px_per_mm: float, degrees: float = 0.0) -> Curve:
    """A reference object's closed profile, (Y, Z) with Z up, seen head-on: a polyline with sharp corners."""
    profile = np.asarray(profile_mm, dtype=np.float64)
    centred = px_per_mm * (profile - (profile.min(axis=0) + profile.max(axis=0)) / 2.0)
    along, across = _directions(degrees)
    return Curve(CENTRE + np.outer(centred[:, 0], along) - np.outer(centred[:, 1], across), closed=True)


def parallel(curve: Curve, distance_px: float) -> Curve:
    """`curve` moved by `distance_px` to its positive side."""
    starts, ends = curve.segments()
    way = ends - starts
    normals = np.column_stack([-way[:, 1], way[:, 0]]) / np.linalg.norm(way, axis=1, keepdims=True)
    before, after = (np.roll(normals, 1, axis=0), normals)
    if not curve.closed:
        before, after = np.concatenate([normals[:1], normals]), np.concatenate([normals, normals[-1:]])
    # Between two segments: along the bisector, so far that it is `distance_px` off both.
    moved = (before + after) / (1.0 + np.einsum("ij,ij->i", before, after))[:, None]
    return Curve(curve.points + distance_px * moved, curve.closed)


def signed_distance(points: Floats, curves: Sequence[Curve]) -> Floats:
    """Distance (N,) px of `points` (N, 2) from the nearest of `curves`.

    It is positive on the side of (-t_j, t_i) for a curve that runs in the direction (t_i, t_j): below a line that runs
    to the right, inside a section whose angle grows from i to j.
    """
    distance = np.full(len(points), np.inf)
    for curve in curves:
        _approach(np.ascontiguousarray(points, dtype=np.float64), *curve.segments(), distance)
    return distance


def _directions(degrees: float) -> tuple[Floats, Floats]:
    angle = np.radians(degrees)
    return np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])


def _resampled(curve: Curve, step_px: float) -> Floats:
    starts, ends = curve.segments()
    corners = np.concatenate([starts, ends[-1:]])
    length = np.r_[0.0, np.cumsum(np.linalg.norm(ends - starts, axis=1))]
    at = np.arange(0.0, length[-1], step_px)
    return np.column_stack([np.interp(at, length, corners[:, 0]), np.interp(at, length, corners[:, 1])])


def _with_red_thing(film: StripeFilm, level: float) -> Backdrop:
    """The virtual scanner's hardware and glints, with the red thing in the light of the room and of the laser."""
    settings = film.settings
    behind = _hardware(settings.scanner_seed, settings.ambient, settings.glints, settings.laser_exposure)
    if film.clutter is None or film.clutter.red_thing is None:
        return behind
    i, j, radius = film.clutter.red_thing
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    disc = np.clip((radius - np.hypot(columns - i, rows - j)) / 4.0 + 0.5, 0.0, 1.0).astype(np.float32)
    red = np.array([0.6, 0.08, 0.06], dtype=np.float32) * np.float32(level)
    room = behind.room * (1.0 - disc[:, :, None]) + red * disc[:, :, None]
    scattered = 0.15 * min(settings.laser_exposure, 1.0) * disc
    return Backdrop(room.astype(np.float32), behind.white_glints, (behind.red_glints + scattered).astype(np.float32))


@lru_cache(maxsize=16)
def _hardware(scanner: int, ambient: Literal["dark", "ambient", "bright"], glints: float, exposure: float) -> Backdrop:
    settings = SimulationSettings(ambient=ambient, glints=glints, laser_exposure=exposure)
    return backdrop(standard_scanner(scanner).camera(1), scanner, settings)


def _shade(settings: SimulationSettings) -> Singles:
    """(rows // 2, columns // 2) room light on the object, without its level: darker downwards, uneven as skin is."""
    random = np.random.default_rng([settings.seed, 5])
    shape = (HEIGHT // COARSE, WIDTH // COARSE)
    unevenness = np.zeros(shape)
    for sigma in (2.0, 12.0):
        octave = gaussian_filter(random.standard_normal(shape), sigma, mode="wrap")
        unevenness += octave / octave.std() / np.sqrt(2.0)
    down = np.linspace(*SHADE, shape[0])[:, None]
    return (down * np.maximum(1.0 + SKIN.unevenness * settings.texture * unevenness, 0.2)).astype(np.float32)


def _object(curves: Sequence[Curve]) -> Singles:
    """(rows // 2, columns // 2) where the object is: within the sections, and around the stripe."""
    silhouette = Image.new("L", (WIDTH // COARSE, HEIGHT // COARSE), 1)
    draw = ImageDraw.Draw(silhouette)
    for curve in curves:
        corners = (curve.points / COARSE).ravel().tolist()
        if curve.closed:
            draw.polygon(corners, fill=0)
        else:
            draw.line(corners, fill=0)
    outside = np.asarray(silhouette)
    distance = COARSE * distance_transform_edt(outside)
    return np.clip((_OBJECT_PX - distance) / 4.0 + 0.5, 0.0, 1.0).astype(np.float32)


@compiled
def _paint(starts: Floats, ends: Floats, closed: bool, sigma: float, peak: float, picture: Floats) -> None:
    """Adds peak exp(-d^2 / (2 sigma^2)), d the distance to the nearest segment.

    Each pixel is the mean over its area, by two points of Gauss and Legendre in each direction.
    """
    height, width = picture.shape
    count = len(starts)
    reach = sigma * np.sqrt(2.0 * np.log(max(peak, 1.0) / 1e-5)) + 1.0
    nearest = np.full((height, width), -1)
    distance = np.full((height, width), reach**2)
    for s in range(count):
        (i0, j0), (i1, j1) = starts[s], ends[s]
        for j in range(max(int(min(j0, j1) - reach), 0), min(int(max(j0, j1) + reach) + 1, height - 1) + 1):
            for i in range(max(int(min(i0, i1) - reach), 0), min(int(max(i0, i1) + reach) + 1, width - 1) + 1):
                d = _squared(i, j, i0, j0, i1, j1)
                if d < distance[j, i]:
                    distance[j, i], nearest[j, i] = d, s
    half = 0.5 / np.sqrt(3.0)
    for j in range(height):
        for i in range(width):
            s = nearest[j, i]
            if s < 0:
                continue
            light = 0.0
            for v in (j - half, j + half):
                for u in (i - half, i + half):
                    d = np.inf
                    for step in (-1, 0, 1):  # a sample may be nearer to the next segment than its pixel's middle is
                        k = (s + step) % count if closed else min(max(s + step, 0), count - 1)
                        d = min(d, _squared(u, v, starts[k, 0], starts[k, 1], ends[k, 0], ends[k, 1]))
                    light += np.exp(-0.5 * d / sigma**2)
            picture[j, i] += peak * light / 4.0


@compiled
def _approach(points: Floats, starts: Floats, ends: Floats, distance: Floats) -> None:
    for n in range(len(points)):
        i, j = points[n]
        for s in range(len(starts)):
            (i0, j0), (i1, j1) = starts[s], ends[s]
            d = np.sqrt(_squared(i, j, i0, j0, i1, j1))
            if d < abs(distance[n]):
                positive = (i1 - i0) * (j - j0) - (j1 - j0) * (i - i0) >= 0.0
                distance[n] = d if positive else -d


@compiled
def _squared(i: float, j: float, i0: float, j0: float, i1: float, j1: float) -> float:
    """Squared distance of (i, j) from a segment."""
    u, v = i1 - i0, j1 - j0
    t = min(max(((i - i0) * u + (j - j0) * v) / (u * u + v * v), 0.0), 1.0)
    return (i - i0 - t * u) ** 2 + (j - j0 - t * v) ** 2

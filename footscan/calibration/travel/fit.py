"""Fit of the laser planes to a film of a known body: where the body stood, and where the planes lie.

A calibration from a straight bar along X gives Y and Z of a pixel wherever the laser plane meets that line of sight,
even if the plane is turned. What is left is X: `schemas.calibration.LaserPlane`. With it the points of all cameras must
lie on one body, whose form is known and whose place is not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.laser_plane import terms_of_plane
from footscan.calibration.travel.body import Body
from footscan.calibration.travel.nearest_face import NearestFace
from footscan.calibration.travel.place import Place, find_place
from footscan.robust import MAD_TO_SD, TUKEY
from schemas.base.errors import Finding

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

OF_HEAD = ("offset_mm", "yaw", "pitch", "bend_mm", "scale")
OF_CAMERA = ("delay_frames", "shutter_frames")
OF_MAP = ("y_mm", "z_mm")
"""Errors of each camera's map: not what is looked for, but what the others must not be bent to explain."""
PRIOR_SD = {"offset_mm": 5.0, "yaw": 0.05, "pitch": 0.05, "bend_mm": 0.5, "scale": 0.01, "delay_frames": 1.0,
            "shutter_frames": 0.5, "y_mm": 0.02, "z_mm": 0.02}  # fmt: skip
"""Standard deviations of each unknown before anything was filmed: what a scanner that is assembled at home may have.
Chosen by hand."""
FARTHEST_SDS = 4.0
"""An unknown farther from 0 than so many of these is no laser plane of a scanner. Chosen by hand."""
DETERMINED = 0.9
"""An unknown whose standard deviation is more than this share of the one before stays 0: the film says nothing of it.
Chosen by hand."""
SHUTTERS_ALIKE = 0.05
"""Standard deviation of the cameras' shutters about their mean, frames: they are of one make."""
UPRIGHT, STANDS_MM = 0.003, 0.2
"""Standard deviations with which the body stands upright on the glass, mm per mm, and at its height."""
GAUGE_MM = 1e-4
"""Offsets are relative to the mean of the heads, delays to the mean of a head's cameras: both sum up to 0, to within
this."""
STAGES: tuple[tuple[tuple[str, ...], float], ...] = (
    (("offset_mm",), 2.0),
    (("yaw", "pitch", "scale"), 1.0),
    (("bend_mm",), 0.3),
    (("shutter_frames", "delay_frames", "y_mm", "z_mm"), 0.2),
)
"""What is fitted, one after the other, and the spread of the distances that is expected then, mm. Chosen by hand."""
USED = 8_000
"""Points that are used, about: a bound of time."""
ROUNDS, SETTLED = 30, 1e-8
FALLS = 0.8
"""Factor by which the spread that is expected falls from round to round."""
FARTHEST_MM = 4.0
"""Points farther from the body are not of it."""
OTHER, FAR_SPREADS = 2.0, 2.0
"""A pixel saw another head's stripe if that brings its point this many times nearer to the body, and if it is farther
than so many spreads from the body."""
FACE_MM = 0.01
"""Standard deviation by which a stripe on a slanting face is displaced, for all cameras of a head alike: the body's
tolerance, and light that enters it. Chosen by hand."""
LEAST_SHARE, LARGEST_RMS_MM = 0.5, 0.3
"""Share of the points that must lie on the body, and to within how much. Chosen by hand."""


class TravelPoints(NamedTuple):
    """N stripe points of a film, mapped to Y and Z."""

    camera: Ints
    """(N,) index of the camera"""
    x: Floats
    """(N,) X of the head by its travel, mm"""
    step: Floats
    """(N,) mm that the head travels until the next frame"""
    row: Floats
    """(N,) place in the picture, -0.5 at its upper border and 0.5 at the lower one"""
    yz: Floats
    """(N, 2) mm"""
    sight: Floats
    """(N, 3) from the point to its camera, mm; NaN where the camera's place is not known"""
    sigma: Floats
    """(N,) standard deviation, mm"""

    def every(self, step: int) -> "TravelPoints":
        """One point of `step`."""
        return TravelPoints(
            self.camera[::step],
            self.x[::step],
            self.step[::step],
            self.row[::step],
            self.yz[::step],
            self.sight[::step],
            self.sigma[::step],
        )


@dataclass(frozen=True)
class TravelFit:
    """The laser planes, and the body."""

    planes: Floats
    """(C, 7) of each camera, as in `schemas.calibration.LaserPlane`"""
    deviations: Floats
    """(C, 7) their standard deviations; 0 for those that the film does not determine"""
    x_mm: float
    """Where the offsets hold"""
    place: Place
    rms_mm: float
    """Robust root mean square of the distances of the points from the body"""
    before_mm: float
    """The same with all planes at right angles to the travel, the body where it fits best then"""
    points: int
    """Number of the points on the body, of those that were used"""


class Solved(NamedTuple):
    """A fit."""

    place: Place
    values: Floats
    covariance: Floats
    """Of the body's place and the values"""
    rms_mm: float
    used: NDArray[np.bool_]


class Linear(NamedTuple):
    """The distances of the points from the body about a place and values."""

    rows: Floats
    """(N, 6 + unknowns) derivatives of the points' way along the normals"""
    distance: Floats
    """(N,) the way that is left to the body, mm"""
    weight: Floats
    face: Ints
    """(N,) number of the direction that the nearest face looks to"""
    spread: float
    """Standard deviation of the distances, mm"""


def fit_travel(points: TravelPoints, head_of_camera: Sequence[int], body: Body) -> TravelFit:
    """Fit the laser planes of all heads, and the place of the body.

    Parameters
    ----------
    head_of_camera : (C,) index of each camera's head, from 0

    Raises
    ------
    Finding
        The points do not lie on the body.
    """
    surface, heads = NearestFace(body), np.asarray(head_of_camera, np.int64)
    every = max(1, len(points.x) // USED)
    problem = Problem(points.every(every), heads, surface)
    start = find_place(np.column_stack([points.x, points.yz])[::every], surface)
    free = np.zeros(len(problem.names), np.bool_)
    before = problem.solve(start, np.zeros(len(free)), free, 1.0)
    fit = before._replace(place=start)
    for names, spread in STAGES:
        free |= np.isin(problem.names, names)
        fit = problem.solve(fit.place, fit.values, free, spread)
    known = np.sqrt(np.diag(fit.covariance)[6:]) < DETERMINED * problem.prior_sd
    known |= np.isin(problem.names, OF_MAP)
    if not known.all():
        fit = problem.solve(fit.place, np.where(known, fit.values, 0.0), known, 0.0)
    _refuse_another_body(fit, problem)
    deviations = np.sqrt(np.diag(fit.covariance)[6:])
    planes, sd = (problem.by_camera(values) for values in (fit.values, deviations))
    return TravelFit(planes, sd, problem.x_mm, fit.place, fit.rms_mm, before.rms_mm, int(fit.used.sum()))


def _refuse_another_body(fit: Solved, problem: "Problem") -> None:
    share = fit.used.mean()
    if share < LEAST_SHARE or fit.rms_mm > LARGEST_RMS_MM:
        raise Finding(
            f"{100 * share:.0f} % of the points lie on the body, to within {fit.rms_mm:.2f} mm, expected "
            f"{100 * LEAST_SHARE:.0f} % at least and {LARGEST_RMS_MM:g} mm at most: is it the film of this body?"
        )
    worst = int(np.argmax(np.abs(fit.values) / problem.prior_sd))
    largest = FARTHEST_SDS * problem.prior_sd[worst]
    if abs(fit.values[worst]) > largest:
        raise Finding(
            f"the film shows a {problem.names[worst]} of {fit.values[worst]:.3g}, expected {largest:.3g} at most: is "
            "it the film of this body, and is its travel right?"
        )


class Problem:
    """The least squares of all unknowns: six of the body's place, then those of the heads, then of the cameras."""

    def __init__(self, points: TravelPoints, head_of_camera: Ints, surface: NearestFace) -> None:
        self.points, self.surface, self.head_of_camera = points, surface, head_of_camera
        heads, cameras = int(head_of_camera.max()) + 1, len(head_of_camera)
        self.heads = heads
        self.head = head_of_camera[points.camera]
        self.names = np.array([*OF_HEAD * heads, *OF_CAMERA * cameras, *OF_MAP * cameras])
        self.prior_sd = np.array([PRIOR_SD[name] for name in self.names])
        self.x_mm = float(points.x.mean())
        self.terms = terms_of_plane(points.x, points.yz, points.step, points.row, self.x_mm)
        """(N, 7)"""
        self.of_x, self.of_y, self.of_z = np.zeros((3, len(points.x), len(self.names)))
        """(N, unknowns) derivatives of X, Y and Z"""
        rows = np.arange(len(points.x))
        of_map = len(OF_HEAD) * heads + len(OF_CAMERA) * cameras + len(OF_MAP) * points.camera
        self.of_y[rows, of_map] = self.of_z[rows, of_map + 1] = 1.0
        for k in range(len(OF_HEAD)):
            self.of_x[rows, len(OF_HEAD) * self.head + k] = self.terms[:, k]
        for k in range(len(OF_CAMERA)):
            self.of_x[rows, self._of_camera(points.camera) + k] = self.terms[:, len(OF_HEAD) + k]
        self.priors = np.vstack([np.diag(1.0 / self.prior_sd), self._gauges(), self._alike_shutters()])

    def by_camera(self, values: Floats) -> Floats:
        """(C, 7) the unknowns of each camera and its head."""
        own = self._of_camera(np.arange(len(self.head_of_camera)))[:, None] + np.arange(len(OF_CAMERA))
        of_head = values[: len(OF_HEAD) * self.heads].reshape(self.heads, -1)[self.head_of_camera]
        return np.hstack([of_head, values[own]])

    def solve(self, place: Place, values: Floats, free: NDArray[np.bool_], spread: float) -> Solved:
        """Fit the body's place and the `free` unknowns by robust least squares, from a place and values.

        spread : standard deviation of the first round's distances, mm; it falls from round to round
        """
        all_free = np.concatenate([np.ones(6, np.bool_), free])
        chosen = np.ix_(all_free, all_free)
        for _ in range(ROUNDS):
            linear = self._linear(place, values, spread)
            normal, right = self._normal_equations(linear, place, values)
            step = np.zeros(len(all_free))
            step[all_free] = np.linalg.lstsq(normal[chosen], right[all_free], rcond=None)[0]
            place, values = place.stepped(step[:6]), values + step[6:]
            spread = max(FALLS * spread, linear.spread)
            if np.abs(step).max() < SETTLED:
                break
        linear = self._linear(place, values, spread)
        covariance = np.zeros(normal.shape)
        covariance[chosen] = self._covariance(linear, normal, all_free)
        return Solved(place, values, covariance, linear.spread, linear.weight > 0)

    def _of_camera(self, camera: Ints) -> Ints:
        """Where the unknowns of cameras begin."""
        return np.asarray(len(OF_HEAD) * self.heads + len(OF_CAMERA) * camera)

    def _gauges(self) -> Floats:
        """Rows for what the film cannot tell: common offsets of all heads, common delays of a head's cameras."""
        rows = [self.names == "offset_mm"]
        for head in range(self.heads):
            of_head = self._of_camera(np.flatnonzero(self.head_of_camera == head))
            rows.append(np.isin(np.arange(len(self.names)), of_head))
        return np.array(rows, np.float64) / GAUGE_MM

    def _alike_shutters(self) -> Floats:
        shutters = self.names == "shutter_frames"
        apart = np.diag(shutters.astype(np.float64)) - np.outer(shutters, shutters) / shutters.sum()
        return np.asarray(apart[shutters] / SHUTTERS_ALIKE)

    def _normal_equations(self, linear: Linear, place: Place, values: Floats) -> tuple[Floats, Floats]:
        weighted = linear.rows * linear.weight[:, None]
        normal, right = weighted.T @ linear.rows, weighted.T @ linear.distance
        normal[6:, 6:] += self.priors.T @ self.priors
        right[6:] -= self.priors.T @ (self.priors @ values)
        leaning = np.array([place.turn[2, 1], -place.turn[2, 0], place.shift[2]])
        stands = np.array([UPRIGHT, UPRIGHT, STANDS_MM]) ** -2.0
        normal[[0, 1, 5], [0, 1, 5]] += stands
        right[[0, 1, 5]] -= stands * leaning
        return normal, right

    def _linear(self, place: Place, values: Floats, spread: float) -> Linear:
        points = self.points
        xyz = np.column_stack([points.x, points.yz])
        xyz += np.column_stack([of_axis @ values for of_axis in (self.of_x, self.of_y, self.of_z)])
        distance, normal, usable = self.surface.distances(place.into(xyz))
        seen = self.head.copy()
        heads = values[: len(OF_HEAD) * self.heads].reshape(self.heads, -1)
        at = xyz.copy()
        for head in range(self.heads):
            # The same pixel, if it saw the stripe of another head: on the line of sight, in that head's plane.
            apart = np.einsum("nk,nk->n", self.terms[:, : len(OF_HEAD)], heads[head] - heads[self.head])
            moved = xyz + (apart / points.sight[:, 0])[:, None] * points.sight
            known = np.flatnonzero(
                (self.head != head) & (np.abs(distance) > FAR_SPREADS * spread) & np.isfinite(moved[:, 1])
            )
            if not len(known):
                continue
            other, other_normal, other_usable = self.surface.distances(place.into(moved[known]))
            nearer = other_usable & (OTHER * np.abs(other) < np.abs(distance[known]))
            better = known[nearer]
            distance[better], normal[better], usable[better] = other[nearer], other_normal[nearer], True
            at[better], seen[better] = moved[better], head
        face = self.surface.group(normal)
        outward = normal @ place.turn.T
        of_values = outward[:, :1] * self.of_x + outward[:, 1:2] * self.of_y + outward[:, 2:] * self.of_z
        rows = np.hstack([-np.cross(at - place.shift, outward), -outward, of_values])
        strange = np.flatnonzero(seen != self.head)
        along = np.einsum("ij,ij->i", outward[strange], points.sight[strange]) / points.sight[strange, 0]
        for k in range(len(OF_HEAD)):
            change = along * self.terms[strange, k]
            rows[strange, 6 + len(OF_HEAD) * seen[strange] + k] += change
            rows[strange, 6 + len(OF_HEAD) * self.head[strange] + k] -= change
        usable &= np.abs(distance) < FARTHEST_MM
        found = MAD_TO_SD * float(np.median(np.abs(distance[usable]))) if usable.any() else FARTHEST_MM
        noise = np.hypot(points.sigma, max(spread, found))
        weight = np.maximum(1.0 - (distance / (TUKEY * noise)) ** 2, 0.0) ** 2 / noise**2 * usable
        return Linear(rows, distance, weight, face, found)

    def _covariance(self, linear: Linear, normal: Floats, free: NDArray[np.bool_]) -> Floats:
        """Covariance of the free unknowns.

        Neighbours err alike: the sums of each camera's errors on each face say how much (K.-Y. Liang and S. L. Zeger,
        Biometrika 73(1), 1986, doi:10.1093/biomet/73.1.13). All cameras of a head err alike on a face, which does not
        show in these sums: `FACE_MM`.
        """
        weighted = linear.rows * linear.weight[:, None]
        errors = _sums(self.points.camera, linear.face, weighted * linear.distance[:, None])
        displaced = FACE_MM * _sums(self.head, linear.face, weighted)
        scatter = (errors.T @ errors) * len(errors) / max(len(errors) - free.sum(), 1) + displaced.T @ displaced
        scatter[6:, 6:] += self.priors.T @ self.priors  # what was known before errs as its standard deviation says
        inverse = np.linalg.pinv(normal[np.ix_(free, free)], hermitian=True)
        return np.asarray(inverse @ scatter[np.ix_(free, free)] @ inverse)


def _sums(first: Ints, second: Ints, values: Floats) -> Floats:
    """Sums (groups, K) of values (N, K) over the rows whose two numbers are the same."""
    _, number = np.unique(first * (second.max() + 1) + second, return_inverse=True)
    sums = np.zeros((int(number.max()) + 1, values.shape[1]))
    np.add.at(sums, number, values)
    return sums

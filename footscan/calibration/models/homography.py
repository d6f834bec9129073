"""Homography of a plane as a model of a camera, with lens distortion and a smooth correction.

The map from the laser plane to the image of a pinhole camera is a homography (R. Hartley and A. Zisserman, "Multiple
View Geometry in Computer Vision", 2nd edition, 2004, section 8.1). Lens distortion follows D. C. Brown, "Close-range
camera calibration", Photogrammetric Engineering 37, 1971, 855-866; its terms lead from the seen to the ideal place. A
glass plate in the line of sight adds a smooth error that is small enough for a polynomial.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.polynomial import derivatives, design_matrix, sum_terms, terms
from footscan.compiled import compiled
from schemas.calibration import Correction, Distortion, HomographyMap
from schemas.parameters.calibration import ModelName

Floats = NDArray[np.float64]

MATRIX = 8
"""Number of parameters of the matrix; its ninth number is 1."""
LINEAR = 3
"""Number of terms of degree 0 and 1, which a correction does not have: the homography expresses them."""
PRIOR_DISTORTION = (0.03, 0.02, 0.003, 0.003)
"""Prior standard deviations of k1, k2, p1 and p2 among webcam lenses, for coordinates in units of half an image's
diagonal: the parameters stay small where the data do not determine them. Chosen by hand."""
PRIOR_CORRECTION_MM = 5.0
"""Prior standard deviation of a correction's coefficients, which the homography can express in part. Chosen by hand."""
NOISE_MM = 0.015
"""Standard deviation of the data by which they are weighed against the priors. Chosen by hand."""
ROUNDING = 1e-12
"""Least last number of a matrix, relative to its largest, by which it is divided. It is 0 if the origin lies on the
horizon."""
HORIZON = 1e-9
"""Depth below which a point lies on the horizon: it is mapped far away, not to infinity."""


@dataclass(frozen=True)
class HomographyModel:
    """A homography of u = (i - centre_i) / scale and v = (j - centre_j) / scale, with its extensions."""

    centre_px: tuple[float, float]
    scale_px: float
    distorted: bool = False
    correction: int | None = None
    """Order of the correction; None for no correction."""

    @property
    def kind(self) -> ModelName:
        """Name of this kind of model in the parameters."""
        if self.correction is not None:
            return "homography-correction"
        return "homography-distortion" if self.distorted else "homography"

    @property
    def name(self) -> str:
        """Name of the model in tables."""
        distortion = ", distortion" if self.distorted else ""
        correction = f", correction {self.correction}" if self.correction is not None else ""
        return f"homography{distortion}{correction}"

    @property
    def unknowns(self) -> int:
        """Number of parameters P: 8 of the matrix, 4 of the distortion, and those of the correction in Y and Z."""
        return self._corrected + 2 * self._correction_terms

    def start(self, pixels: Floats, normals: Floats, offsets: Floats) -> Floats:
        """Parameters (P,) from which a fit starts: the homography of least algebraic error, without extensions.

        `pixels` (N, 2), px; `normals` (N, 2) and `offsets` (N,), mm: each pixel's world point lies on the line
        normal . (Y, Z) = offset.
        """
        parameters = np.zeros(self.unknowns)
        parameters[:MATRIX] = algebraic_homography(self._normalised(pixels), normals, offsets).ravel()[:MATRIX]
        return parameters

    def prior_precision(self) -> Floats:
        """Weight (P,) of the square of each parameter, in units of the square of an error of 1 mm."""
        precision = np.zeros(self.unknowns)
        if self.distorted:
            precision[MATRIX : MATRIX + 4] = (NOISE_MM / np.array(PRIOR_DISTORTION)) ** 2
        precision[self._corrected :] = (NOISE_MM / PRIOR_CORRECTION_MM) ** 2
        return precision

    def world(self, parameters: Floats, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2), px."""
        uv = self._normalised(pixels)
        plane, _ = project(_matrix(parameters), self._ideal(parameters, uv))
        if self.correction is not None:
            plane = plane + sum_terms(self._correction_matrix(uv), self._correction(parameters))
        return plane

    def by_parameters(self, parameters: Floats, pixels: Floats) -> Floats:
        """Derivatives (N, 2, P) of `world` by the parameters."""
        basis = self.basis(pixels)
        along_y_and_z = (np.tile(axis, (len(pixels), 1)) for axis in np.eye(2))
        return np.stack([self.linearised(parameters, basis, axis)[1] for axis in along_y_and_z], axis=1)

    def basis(self, pixels: Floats) -> Floats:
        """The coordinates u and v of `pixels` (N, 2), px, and the terms of the correction, (N, 2 + T)."""
        uv = self._normalised(pixels)
        return uv if self.correction is None else np.column_stack([uv, self._correction_matrix(uv)])

    def linearised(self, parameters: Floats, basis: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """The components of `world` along `normals` (N, 2), (N,) mm, and their derivatives (N, P) by the parameters."""
        linearised: tuple[Floats, Floats] = _linearised(parameters, basis, normals, self.distorted)
        return linearised

    def by_pixels(self, parameters: Floats, pixels: Floats) -> Floats:
        """Derivatives (N, 2, 2) of `world` by i and j, mm/px."""
        uv = self._normalised(pixels)
        plane, depth = project(_matrix(parameters), self._ideal(parameters, uv))
        by_uv = slopes(_matrix(parameters), plane, depth) @ self._ideal_by_uv(parameters, uv)
        if self.correction is not None:
            by_u, by_v = derivatives(uv[:, 0], uv[:, 1], self.correction)
            alpha = self._correction(parameters).T
            by_uv = by_uv + np.stack([by_u[:, LINEAR:] @ alpha, by_v[:, LINEAR:] @ alpha], axis=-1)
        return np.asarray(by_uv / self.scale_px)

    def as_map(self, parameters: Floats) -> HomographyMap:
        """The map for the calibration file."""
        distortion = correction = None
        if self.distorted:
            k1, k2, p1, p2 = parameters[MATRIX : MATRIX + 4].tolist()
            distortion = Distortion(k1=k1, k2=k2, p1=p1, p2=p2)
        if self.correction is not None:
            alpha_y, alpha_z = self._correction(parameters).tolist()
            correction = Correction(order=self.correction, alpha_y=alpha_y, alpha_z=alpha_z)
        return HomographyMap(
            centre_px=self.centre_px,
            scale_px=self.scale_px,
            matrix=parameters[:MATRIX].tolist(),
            distortion=distortion,
            correction=correction,
        )

    @property
    def _corrected(self) -> int:
        """Index of the first parameter of the correction."""
        return MATRIX + 4 * self.distorted

    @property
    def _correction_terms(self) -> int:
        """Number of the correction's coefficients in Y, and in Z."""
        return 0 if self.correction is None else terms(self.correction) - LINEAR

    def _correction(self, parameters: Floats) -> Floats:
        """The coefficients (2, T) of the correction in Y and in Z."""
        return parameters[self._corrected :].reshape(2, -1)

    def _correction_matrix(self, uv: Floats) -> Floats:
        """The terms (N, T) of the correction at `uv` (N, 2)."""
        assert self.correction is not None
        return design_matrix(uv[:, 0], uv[:, 1], self.correction)[:, LINEAR:]

    def _normalised(self, pixels: Floats) -> Floats:
        return np.asarray((pixels - np.array(self.centre_px)) / self.scale_px)

    def _ideal(self, parameters: Floats, uv: Floats) -> Floats:
        """Ideal places (N, 2), without distortion, of seen places `uv` (N, 2)."""
        if not self.distorted:
            return uv
        return _through_lens(uv, _distortion_terms(uv), parameters[MATRIX : MATRIX + 4])

    def _ideal_by_uv(self, parameters: Floats, uv: Floats) -> Floats:
        """Derivatives (N, 2, 2) of `_ideal` by u and v."""
        identity = np.broadcast_to(np.eye(2), (len(uv), 2, 2))
        if not self.distorted:
            return identity
        k1, k2, p1, p2 = parameters[MATRIX : MATRIX + 4]
        u, v = uv.T
        r2 = u * u + v * v
        radial, slope = k1 * r2 + k2 * r2 * r2, 2.0 * (k1 + 2.0 * k2 * r2)
        across = slope * u * v + 2.0 * (p1 * u + p2 * v)
        by_u = np.stack([radial + slope * u * u + 2.0 * p1 * v + 6.0 * p2 * u, across], axis=-1)
        by_v = np.stack([across, radial + slope * v * v + 6.0 * p1 * v + 2.0 * p2 * u], axis=-1)
        return np.asarray(identity + np.stack([by_u, by_v], axis=-1))


def algebraic_homography(uv: Floats, normals: Floats, offsets: Floats) -> Floats:
    """Compute the homography of least algebraic error that maps points (u, v) onto lines.

    Each observation is the equation n_y (h1 x) + n_z (h2 x) - d (h3 x) = 0 with x = (u, v, 1), linear in the nine
    entries of the matrix (direct linear transformation, Hartley and Zisserman 2004, section 4.1, with lines instead of
    points in the world). Points and lines are scaled to about unit size first; otherwise the solution is unstable.

    Parameters
    ----------
    uv : (N, 2) float64, N >= 8.
    normals, offsets : (N, 2) of unit length and (N,), in any unit of length: the lines normal . (Y, Z) = offset.

    Returns
    -------
    (3, 3) float64; its last number is 1.

    Examples
    --------
    Four points, each on a line for its Y and a line for its Z, with Y = 2 u + 1 and Z = 3 v:

    >>> uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    >>> offsets = np.concatenate([2.0 * uv[:, 0] + 1.0, 3.0 * uv[:, 1]])
    >>> matrix = algebraic_homography(np.tile(uv, (2, 1)), np.repeat(np.eye(2), 4, axis=0), offsets)
    >>> print(matrix.round(6) + 0.0)
    [[2. 0. 1.]
     [0. 3. 0.]
     [0. 0. 1.]]
    """
    middle = uv.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((uv - middle) ** 2, axis=1)))) or 1.0
    origin = (
        np.linalg.pinv(_inner(normals, normals)) @ _inner(normals, offsets[:, np.newaxis])[:, 0]
    )  # nearest to all lines
    distances = offsets - np.sum(normals * origin, axis=1)
    reach = float(np.sqrt(np.mean(distances**2))) or 1.0
    x = np.column_stack([(uv - middle) / size, np.ones(len(uv))])
    rows = np.concatenate([normals[:, :1] * x, normals[:, 1:] * x, -(distances / reach)[:, np.newaxis] * x], axis=1)
    matrix = np.linalg.eigh(_inner(rows, rows))[1][:, 0].reshape(3, 3)
    to_unit = np.array([[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size], [0.0, 0.0, 1.0]])
    from_unit = np.array([[reach, 0.0, origin[0]], [0.0, reach, origin[1]], [0.0, 0.0, 1.0]])
    matrix = from_unit @ matrix @ to_unit
    least = ROUNDING * float(np.abs(matrix).max())
    return np.asarray(matrix / (matrix[2, 2] if abs(matrix[2, 2]) > least else least))


@compiled
def project(matrix: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Map `points` (N, 2) by a homography (3, 3).

    Returns
    -------
    plane : (N, 2) float64, the mapped points.
    depth : (N,) float64, the third homogeneous coordinate by which they were divided.

    Examples
    --------
    >>> plane, depth = project(np.array([[1.0, 0, 0], [0, 1, 0], [0.5, 0, 1]]), np.array([[2.0, 4.0]]))
    >>> print(plane, depth)
    [[1. 2.]] [2.]
    """
    plane, depth = np.empty((len(points), 2)), np.empty(len(points))
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        by = x * matrix[2, 0] + y * matrix[2, 1] + matrix[2, 2]
        depth[n] = HORIZON if abs(by) < HORIZON else by
        for k in range(2):
            plane[n, k] = (x * matrix[k, 0] + y * matrix[k, 1] + matrix[k, 2]) / depth[n]
    return plane, depth


@compiled
def slopes(matrix: Floats, plane: Floats, depth: Floats) -> Floats:
    """Derivatives (N, 2, 2) of the result of `project` by its points."""
    by_points = np.empty((len(plane), 2, 2))
    for n in range(len(plane)):
        for k in range(2):
            for m in range(2):
                by_points[n, k, m] = (matrix[k, m] - plane[n, k] * matrix[2, m]) / depth[n]
    return by_points


def image_frame(image_px: tuple[int, int]) -> tuple[tuple[float, float], float]:
    """Centre and scale, px, by which homographies of an image of (columns, rows) are normalised.

    >>> image_frame((641, 481))
    ((320.0, 240.0), 400.0)
    """
    middle = ((image_px[0] - 1) / 2, (image_px[1] - 1) / 2)
    return middle, float(np.hypot(*middle))


def _inner(a: Floats, b: Floats) -> Floats:
    """The transpose of (N, P) times (N, Q), without BLAS, whose sums depend on the number of its threads."""
    return np.asarray(np.einsum("np,nq->pq", a, b))


def _matrix(parameters: Floats) -> Floats:
    """The homography (3, 3) of `parameters` (P,)."""
    return np.append(parameters[:MATRIX], 1.0).reshape(3, 3)


@compiled
def _distortion_terms(uv: Floats) -> Floats:
    """(N, 2, 4): the factors of k1, k2, p1 and p2 in the distortion of u and of v."""
    factors = np.empty((len(uv), 2, 4))
    for n in range(len(uv)):
        u, v = uv[n, 0], uv[n, 1]
        r2 = u * u + v * v
        factors[n, 0, 0], factors[n, 0, 1], factors[n, 0, 2], factors[n, 0, 3] = (
            u * r2,
            u * r2 * r2,
            2 * u * v,
            r2 + 2 * u * u,
        )
        factors[n, 1, 0], factors[n, 1, 1], factors[n, 1, 2], factors[n, 1, 3] = (
            v * r2,
            v * r2 * r2,
            r2 + 2 * v * v,
            2 * u * v,
        )
    return factors


@compiled
def _through_lens(uv: Floats, distortion: Floats, lens: Floats) -> Floats:
    """(N, 2) ideal places of seen places `uv` (N, 2), by the factors (N, 2, 4) of `_distortion_terms`."""
    ideal = uv.copy()
    for n in range(len(uv)):
        for k in range(2):
            for t in range(4):
                ideal[n, k] += distortion[n, k, t] * lens[t]
    return ideal


@compiled
def _linearised(parameters: Floats, basis: Floats, normals: Floats, distorted: bool) -> tuple[Floats, Floats]:
    """The result of `HomographyModel.linearised`."""
    h, corrected, count = parameters, MATRIX + 4 * distorted, basis.shape[1] - 2
    across, jacobian = np.empty(len(basis)), np.empty((len(basis), len(parameters)))
    for n in range(len(basis)):
        u, v, n_y, n_z = basis[n, 0], basis[n, 1], normals[n, 0], normals[n, 1]
        x, y, r2 = u, v, u * u + v * v
        if distorted:
            radial = h[8] * r2 + h[9] * r2 * r2
            x += u * radial + h[10] * 2.0 * u * v + h[11] * (r2 + 2.0 * u * u)
            y += v * radial + h[10] * (r2 + 2.0 * v * v) + h[11] * 2.0 * u * v
        depth = h[6] * x + h[7] * y + 1.0
        if abs(depth) < HORIZON:
            depth = HORIZON
        unit = 1.0 / depth
        along_x, along_y, along = n_y * h[0] + n_z * h[3], n_y * h[1] + n_z * h[4], n_y * h[2] + n_z * h[5]
        across[n] = (along_x * x + along_y * y + along) * unit
        x, y = x * unit, y * unit
        row = jacobian[n]
        row[0], row[1], row[2], row[3], row[4], row[5] = n_y * x, n_y * y, n_y * unit, n_z * x, n_z * y, n_z * unit
        row[6], row[7] = -across[n] * x, -across[n] * y
        if distorted:
            by_x, by_y = (along_x - across[n] * h[6]) * unit, (along_y - across[n] * h[7]) * unit
            row[8] = (by_x * u + by_y * v) * r2
            row[9] = row[8] * r2
            row[10] = by_x * 2.0 * u * v + by_y * (r2 + 2.0 * v * v)
            row[11] = by_x * (r2 + 2.0 * u * u) + by_y * 2.0 * u * v
        for t in range(count):
            row[corrected + t] = n_y * basis[n, 2 + t]
            row[corrected + count + t] = n_z * basis[n, 2 + t]
            across[n] += row[corrected + t] * h[corrected + t] + row[corrected + count + t] * h[corrected + count + t]
    return across, jacobian

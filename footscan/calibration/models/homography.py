"""A plane seen by a pinhole camera, with the distortion of its lens and a smooth correction for what is left.

The map from a laser's plane to the image of a pinhole is a homography (Hartley & Zisserman 2004, section 8.1). A lens
bends it: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971) 855-866, whose terms run
from the seen to the ideal place. What a glass plate in the way adds is smooth, and small enough for a polynomial.
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
LINEAR = 3
"""Terms of degree 0 and 1, which a correction leaves to the homography."""
PRIOR_DISTORTION = (0.03, 0.02, 0.003, 0.003)
"""Standard deviation of k1, k2, p1 and p2 among webcams' lenses, in units of half an image's diagonal: where the data
say nothing of them, they are small."""
PRIOR_CORRECTION_MM = 5.0
"""The same for a correction's coefficients, of which the homography can express some too."""
NOISE_MM = 0.015
"""What the data are thought to be good for when they are weighed against what is known beforehand."""


@dataclass(frozen=True)
class HomographyModel:
    """A homography of u = (i - centre_i) / scale and v = (j - centre_j) / scale, and what is added to it."""

    centre_px: tuple[float, float]
    scale_px: float
    distorted: bool = False
    correction: int | None = None
    """Order of the correction; None is none."""

    @property
    def kind(self) -> ModelName:
        """What it is asked for by."""
        if self.correction is not None:
            return "homography-correction"
        return "homography-distortion" if self.distorted else "homography"

    @property
    def name(self) -> str:
        """As it stands in tables."""
        distortion = ", distortion" if self.distorted else ""
        correction = f", correction {self.correction}" if self.correction is not None else ""
        return f"homography{distortion}{correction}"

    @property
    def unknowns(self) -> int:
        """Eight of the matrix, four of the distortion, those of the correction to Y and to Z."""
        return self._corrected + 2 * self._correction_terms

    def start(self, pixels: Floats, normals: Floats, offsets: Floats) -> Floats:
        """Parameters (P,) from which a fit begins: the homography that an algebraic error gives, and nothing else.

        `pixels` (N, 2), px; `normals` (N, 2) and `offsets` (N,), mm: each pixel's world point lies on the line
        normal . (Y, Z) = offset.
        """
        parameters = np.zeros(self.unknowns)
        parameters[:MATRIX] = algebraic_homography(self._normalised(pixels), normals, offsets).ravel()[:MATRIX]
        return parameters

    def prior_precision(self) -> Floats:
        """How strongly each parameter is held to zero, (P,), where an error of 1 mm counts as 1."""
        precision = np.zeros(self.unknowns)
        if self.distorted:
            precision[MATRIX : MATRIX + 4] = (NOISE_MM / np.array(PRIOR_DISTORTION)) ** 2
        precision[self._corrected :] = (NOISE_MM / PRIOR_CORRECTION_MM) ** 2
        return precision

    def world(self, parameters: Floats, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2)."""
        uv = self._normalised(pixels)
        plane, _ = project(_matrix(parameters), self._ideal(parameters, uv))
        if self.correction is not None:
            plane = plane + sum_terms(self._correction_matrix(uv), self._correction(parameters))
        return plane

    def by_parameters(self, parameters: Floats, pixels: Floats) -> Floats:
        """Derivatives (N, 2, P) of `world` by the parameters."""
        uv = self._normalised(pixels)
        ideal = self._ideal(parameters, uv)
        plane, depth = project(_matrix(parameters), ideal)
        jacobian = np.zeros((len(uv), 2, self.unknowns))
        _fill_by_matrix(jacobian, ideal, plane, depth)
        if self.distorted:
            _fill_by_lens(jacobian, slopes(_matrix(parameters), plane, depth), _distortion_terms(uv))
        if self.correction is not None:
            matrix = self._correction_matrix(uv)
            jacobian[:, 0, self._corrected : self._corrected + matrix.shape[1]] = matrix
            jacobian[:, 1, self._corrected + matrix.shape[1] :] = matrix
        return jacobian

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
        """For the calibration file."""
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
        """Where the parameters of the correction begin."""
        return MATRIX + 4 * self.distorted

    @property
    def _correction_terms(self) -> int:
        return 0 if self.correction is None else terms(self.correction) - LINEAR

    def _correction(self, parameters: Floats) -> Floats:
        return parameters[self._corrected :].reshape(2, -1)

    def _correction_matrix(self, uv: Floats) -> Floats:
        assert self.correction is not None
        return design_matrix(uv[:, 0], uv[:, 1], self.correction)[:, LINEAR:]

    def _normalised(self, pixels: Floats) -> Floats:
        return np.asarray((pixels - np.array(self.centre_px)) / self.scale_px)

    def _ideal(self, parameters: Floats, uv: Floats) -> Floats:
        if not self.distorted:
            return uv
        return _through_lens(uv, _distortion_terms(uv), parameters[MATRIX : MATRIX + 4])

    def _ideal_by_uv(self, parameters: Floats, uv: Floats) -> Floats:
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
    """The (3, 3) matrix that takes points (u, v) onto lines, by the least algebraic error; its last number is 1.

    Each row is n_y (h1 x) + n_z (h2 x) - d (h3 x) = 0 with x = (u, v, 1): linear in the nine entries (direct linear
    transformation, Hartley & Zisserman 2004, section 4.1, with lines for points on the world's side). Points and lines
    are brought to about unit size first, without which it is not to be trusted.

    Parameters
    ----------
    uv : (N, 2), N >= 8.
    normals, offsets : (N, 2) unit and (N,), any unit of length: the lines normal . (Y, Z) = offset.
    """
    middle = uv.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((uv - middle) ** 2, axis=1)))) or 1.0
    origin = np.linalg.pinv(_inner(normals, normals)) @ _inner(normals, offsets[:, np.newaxis])[:, 0]  # their middle
    distances = offsets - np.sum(normals * origin, axis=1)
    reach = float(np.sqrt(np.mean(distances**2))) or 1.0
    x = np.column_stack([(uv - middle) / size, np.ones(len(uv))])
    rows = np.concatenate([normals[:, :1] * x, normals[:, 1:] * x, -(distances / reach)[:, np.newaxis] * x], axis=1)
    matrix = np.linalg.eigh(_inner(rows, rows))[1][:, 0].reshape(3, 3)
    to_unit = np.array([[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size], [0.0, 0.0, 1.0]])
    from_unit = np.array([[reach, 0.0, origin[0]], [0.0, reach, origin[1]], [0.0, 0.0, 1.0]])
    matrix = from_unit @ matrix @ to_unit
    least = 1e-12 * float(np.abs(matrix).max())  # of the last number, which is 0 where the origin lies on the horizon
    return np.asarray(matrix / (matrix[2, 2] if abs(matrix[2, 2]) > least else least))


@compiled
def project(matrix: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Where a homography (3, 3) takes `points` (N, 2), (N, 2), and the depths (N,) by which they were divided."""
    plane, depth = np.empty((len(points), 2)), np.empty(len(points))
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        by = x * matrix[2, 0] + y * matrix[2, 1] + matrix[2, 2]
        depth[n] = 1e-9 if abs(by) < 1e-9 else by  # on the horizon: far away, not infinite
        for k in range(2):
            plane[n, k] = (x * matrix[k, 0] + y * matrix[k, 1] + matrix[k, 2]) / depth[n]
    return plane, depth


@compiled
def slopes(matrix: Floats, plane: Floats, depth: Floats) -> Floats:
    """Derivatives (N, 2, 2) of what `project` gave by its points."""
    by_points = np.empty((len(plane), 2, 2))
    for n in range(len(plane)):
        for k in range(2):
            for m in range(2):
                by_points[n, k, m] = (matrix[k, m] - plane[n, k] * matrix[2, m]) / depth[n]
    return by_points


def image_frame(image_px: tuple[int, int]) -> tuple[tuple[float, float], float]:
    """Centre and scale, px, to which homographies of an image of so many columns and rows are normalised."""
    middle = ((image_px[0] - 1) / 2, (image_px[1] - 1) / 2)
    return middle, float(np.hypot(*middle))


def _inner(a: Floats, b: Floats) -> Floats:
    """The transpose of (N, P) times (N, Q). Not by BLAS, whose sums depend on the number of its threads."""
    return np.asarray(np.einsum("np,nq->pq", a, b))


def _matrix(parameters: Floats) -> Floats:
    return np.append(parameters[:MATRIX], 1.0).reshape(3, 3)


@compiled
def _distortion_terms(uv: Floats) -> Floats:
    """(N, 2, 4): what k1, k2, p1 and p2 are multiplied with."""
    found = np.empty((len(uv), 2, 4))
    for n in range(len(uv)):
        u, v = uv[n, 0], uv[n, 1]
        r2 = u * u + v * v
        found[n, 0, 0], found[n, 0, 1], found[n, 0, 2], found[n, 0, 3] = u * r2, u * r2 * r2, 2 * u * v, r2 + 2 * u * u
        found[n, 1, 0], found[n, 1, 1], found[n, 1, 2], found[n, 1, 3] = v * r2, v * r2 * r2, r2 + 2 * v * v, 2 * u * v
    return found


@compiled
def _through_lens(uv: Floats, distortion: Floats, lens: Floats) -> Floats:
    """(N, 2) ideal places of what is seen at `uv` (N, 2), by what k1, k2, p1 and p2 are multiplied with (N, 2, 4)."""
    ideal = uv.copy()
    for n in range(len(uv)):
        for k in range(2):
            for t in range(4):
                ideal[n, k] += distortion[n, k, t] * lens[t]
    return ideal


@compiled
def _fill_by_matrix(jacobian: Floats, ideal: Floats, plane: Floats, depth: Floats) -> None:
    """Derivatives of the (N, 2) places on the plane by the matrix, into (N, 2, P)."""
    for n in range(len(ideal)):
        x, y, one = ideal[n, 0] / depth[n], ideal[n, 1] / depth[n], 1.0 / depth[n]
        for k in range(2):
            jacobian[n, k, 3 * k], jacobian[n, k, 3 * k + 1], jacobian[n, k, 3 * k + 2] = x, y, one
            jacobian[n, k, 6], jacobian[n, k, 7] = -plane[n, k] * x, -plane[n, k] * y


@compiled
def _fill_by_lens(jacobian: Floats, by_ideal: Floats, distortion: Floats) -> None:
    """Those by k1, k2, p1 and p2, into (N, 2, P)."""
    for n in range(len(jacobian)):
        for k in range(2):
            for t in range(4):
                jacobian[n, k, MATRIX + t] = (
                    by_ideal[n, k, 0] * distortion[n, 0, t] + by_ideal[n, k, 1] * distortion[n, 1, t]
                )

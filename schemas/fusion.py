"""The report of the fusion: the disagreement of the cameras about the same skin, and their corrections."""

import math
from collections.abc import Iterable
from itertools import accumulate
from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.heads import FILM_BODY

Camera = Annotated[int, Field(ge=1)]
Count = Annotated[int, Field(ge=0)]
Length = Annotated[float, Field(ge=0)]
Kind = Literal["none", "rigid", "affine", "quadratic"]

MANY_DISTRUSTED = 2
"""Cameras that deviate from which on the others are in doubt, too: those of one head, for instance. Chosen by hand."""
HEADS_APART_MM = 0.5
"""Systematic disagreement of two heads from which all measures are in doubt. Chosen by hand: of scanners whose planes a
film has shown it is 0.02 mm without pictures, and up to 0.4 mm with maps from films of a chart (`draw_assembled`, seed
512)."""
FEWEST_COMPARED = 10
"""Comparisons from which two cameras of different heads count. Chosen by hand."""
USUAL_TAILS = 1.5
"""Root mean square of distances without gross errors relative to their deviation by the median: 1.3 to 1.6 in six
scanners without pictures (`draw_assembled`, seeds 2060, 2106, 2129, 2143, 2355 and 2821)."""


class Disagreement(Document):
    """Distances in mm between what two cameras see of the same skin, along its normal in the laser's plane."""

    median_mm: float
    """Positive where the first camera sees the skin farther out."""
    deviation_mm: Length
    """Standard deviation by the median of absolute deviations from the median."""
    rms_mm: Length
    systematic_mm: Length | None = None
    """Median size of the mean distances over patches of skin: noise averages out, errors of the cameras stay, and a few
    patches at the borders of their maps do not count. None where no patch was compared often enough, and in reports of
    earlier versions."""


class PairDisagreement(Document):
    """Disagreement of two cameras, before and after the corrections."""

    cameras: tuple[Camera, Camera]
    points: Count
    """Number of places at which they were compared."""
    before: Disagreement
    after: Disagreement


class CameraCorrection(Document):
    """The correction that moves the points of a camera in the laser plane.

    With u = (Y - centre) / scale and v = (Z - centre) / scale, the terms are, in this order: (1, 0), (0, 1), (-v, u);
    for `affine` also (u, v), (u, -v), (v, u); for `quadratic` also (u^2, 0), (uv, 0), (v^2, 0), (0, u^2), (0, uv),
    (0, v^2). Those that are not rigid keep to the range of (Y, Z) over which the camera was compared.
    """

    camera: Camera
    kind: Kind
    coefficients_mm: list[float] = Field(default_factory=list)
    centre_mm: tuple[float, float] = (0.0, 0.0)
    scale_mm: Length = 1.0
    range_mm: tuple[float, float, float, float] | None = None
    """Least Y and Z, greatest Y and Z of the places where the camera was compared with others; None if it was not."""
    shift_mm: tuple[float, float] = (0.0, 0.0)
    """Shift of Y and Z at the centre."""
    rotation_deg: float = 0.0
    """From Y towards Z."""
    largest_mm: Length = 0.0
    """Largest displacement of a point within the range."""
    points: Count
    """Places at which the camera was compared with others."""
    held_out_before_mm: Length | None = None
    """Root mean square of its distances from others over stretches of the travel that took no part in the fit; None
    where it was not compared, or too little."""
    held_out_after_mm: Length | None = None


class FusionReport(Document):
    """The agreement of the cameras."""

    pairs: list[PairDisagreement] = Field(default_factory=list)
    corrections: list[CameraCorrection] = Field(default_factory=list)
    """One a camera."""
    distrusted: list[Camera] = Field(default_factory=list)
    """Cameras that deviate too far from the others to be moved; they count only where no other camera saw the skin."""
    contradicted: dict[Camera, Count] = Field(default_factory=dict)
    """Number of points by camera that were dropped in favour of other cameras."""
    warnings: list[str] = Field(default_factory=list)
    heads: dict[Camera, int] = Field(default_factory=dict)
    """Head of each camera, where it is known."""

    @property
    def doubt(self) -> str | None:
        """Reason for which measures are uncertain: heads or cameras deviate, and it is not known which are right.

        >>> FusionReport(distrusted=[3, 4]).doubt
        "cameras 3 and 4 deviate from the others: check them with 'footscan calibrate check', then scan again"
        >>> FusionReport(distrusted=[3]).doubt is None
        True
        """
        if len(self.distrusted) >= MANY_DISTRUSTED:
            *first, last = map(str, self.distrusted)
            which = f"cameras {', '.join(first)} and {last}"
            return f"{which} deviate from the others: check them with 'footscan calibrate check', then scan again"
        apart = self.heads_apart
        if not apart or max(apart.values()) <= HEADS_APART_MM:
            return None
        one, other = max(apart, key=lambda pair: apart[pair])
        return (
            f"heads {one} and {other} place the same skin {apart[one, other]:.2f} mm apart, and it is not known which "
            f"is right: film the body that shows the laser planes ({FILM_BODY}), then scan again"
        )

    @property
    def heads_apart(self) -> dict[tuple[int, int], float]:
        """Pairs of heads -> systematic disagreement of their cameras as calibrated, mm.

        It is the median over their pairs of cameras, so that one knocked camera of several does not count. Corrections
        do not count either: they make heads agree, on what may be wrong.
        """
        return {pair: _weighted_median(found) for pair, found in self._between_heads.items()}

    @property
    def _between_heads(self) -> dict[tuple[int, int], list[tuple[float, int]]]:
        """Pairs of heads -> disagreement, mm, and number of places, for each pair of their cameras."""
        found: dict[tuple[int, int], list[tuple[float, int]]] = {}
        for pair in self.pairs:
            one, other = self._heads_of(pair)
            if 0 < one < other and pair.points >= FEWEST_COMPARED:
                found.setdefault((one, other), []).append((_systematic(pair.before), pair.points))
        return found

    @property
    def systematic_mm(self) -> float:
        """Systematic disagreement of trusted cameras of one head after the corrections, and of the heads before them.

        Root of the sum of their mean squares over all places, mm; 0 without comparisons.

        >>> apart = Disagreement(median_mm=0.0, deviation_mm=0.1, rms_mm=0.5, systematic_mm=0.4)
        >>> corrected = apart.model_copy(update={"systematic_mm": 0.03})
        >>> cameras = [(1, 2), (1, 3), (2, 3)]
        >>> pairs = [PairDisagreement(cameras=both, points=99, before=apart, after=corrected) for both in cameras]
        >>> print(f"{FusionReport(pairs=pairs, heads={1: 1, 2: 1, 3: 2}).systematic_mm:.3f}")
        0.401
        """
        within = [
            pair
            for pair in self.pairs
            if not set(pair.cameras) & set(self.distrusted)
            and len({self.heads.get(camera) for camera in pair.cameras}) == 1
        ]
        places = {heads: sum(points for _, points in found) for heads, found in self._between_heads.items()}
        return math.hypot(
            _root_mean_square((_systematic(pair.after), pair.points) for pair in within),
            _root_mean_square((mm, places[heads]) for heads, mm in self.heads_apart.items()),
        )

    @property
    def gross_mm(self) -> float:
        """Gross errors: by how much cameras that see the same skin differ beyond `USUAL_TAILS` of their deviation, mm,
        after the corrections. Root mean square over all places; 0 without comparisons.

        >>> apart = Disagreement(median_mm=0.0, deviation_mm=0.02, rms_mm=0.05)
        >>> pair = PairDisagreement(cameras=(1, 2), points=99, before=apart, after=apart)
        >>> print(f"{FusionReport(pairs=[pair]).gross_mm:.2f} mm")
        0.04 mm
        """
        rms = _root_mean_square((pair.after.rms_mm, pair.points) for pair in self.pairs)
        deviation = _root_mean_square((pair.after.deviation_mm, pair.points) for pair in self.pairs)
        return math.sqrt(max(rms**2 - (USUAL_TAILS * deviation) ** 2, 0.0))

    def systematic_of(self, camera: Camera) -> float:
        """Systematic disagreement of a camera with those of other heads, mm; of all cameras, if that is more.

        It is taken after the corrections, root mean square over the places. The heads may agree in most places, and
        hardly in those that this camera alone sees.

        >>> alike, apart = (
        ...     Disagreement(median_mm=0.0, deviation_mm=0.1, rms_mm=0.1, systematic_mm=mm) for mm in (0.02, 0.4)
        ... )
        >>> pairs = [PairDisagreement(cameras=(3, 4), points=2000, before=alike, after=alike)]
        >>> pairs += [PairDisagreement(cameras=(2, 4), points=100, before=alike, after=apart)]
        >>> report = FusionReport(pairs=pairs, heads={2: 1, 3: 2, 4: 2})
        >>> print([round(report.systematic_of(camera), 3) for camera in (3, 4)])
        [0.028, 0.4]
        """
        of_camera = [
            (_systematic(pair.after), pair.points)
            for pair in self.pairs
            if camera in pair.cameras and 0 < min(heads := self._heads_of(pair)) < max(heads)
        ]
        enough = sum(points for _, points in of_camera) >= FEWEST_COMPARED
        return max(self.systematic_mm, _root_mean_square(of_camera) if enough else 0.0)

    def _heads_of(self, pair: PairDisagreement) -> tuple[int, int]:
        """The heads of both cameras in ascending order; 0 where it is not known."""
        one, other = sorted(self.heads.get(camera, 0) for camera in pair.cameras)
        return one, other


def _systematic(disagreement: Disagreement) -> float:
    return abs(disagreement.median_mm) if disagreement.systematic_mm is None else disagreement.systematic_mm


def _root_mean_square(found: Iterable[tuple[float, int]]) -> float:
    """Of values and their weights; 0 without values."""
    squares = weights = 0.0
    for value, weight in found:
        squares, weights = squares + weight * value**2, weights + weight
    return math.sqrt(squares / weights) if weights else 0.0


def _weighted_median(found: list[tuple[float, int]]) -> float:
    """Of values and their weights."""
    ordered = sorted(found)
    below = list(accumulate(weight for _, weight in ordered))
    return next(value for (value, _), weight in zip(ordered, below, strict=True) if weight >= below[-1] / 2)

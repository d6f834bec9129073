"""The report of the fusion: the disagreement of the cameras about the same skin, and their corrections."""

import math
from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Camera = Annotated[int, Field(ge=1)]
Count = Annotated[int, Field(ge=0)]
Length = Annotated[float, Field(ge=0)]
Kind = Literal["none", "rigid", "affine", "quadratic"]

MANY_DISTRUSTED = 2
"""Cameras that deviate from which on the others are in doubt, too: those of one head, for instance. Chosen by hand."""


class Disagreement(Document):
    """Distances in mm between what two cameras see of the same skin, along its normal in the laser's plane."""

    median_mm: float
    """Positive where the first camera sees the skin farther out."""
    deviation_mm: Length
    """Standard deviation by the median of absolute deviations from the median."""
    rms_mm: Length


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

    @property
    def doubt(self) -> str | None:
        """Reason for which measures are uncertain: if several cameras deviate, it is not known which are right.

        >>> FusionReport(distrusted=[3, 4]).doubt
        "cameras 3 and 4 deviate from the others: check them with 'footscan calibrate check', then scan again"
        >>> FusionReport(distrusted=[3]).doubt is None
        True
        """
        if len(self.distrusted) < MANY_DISTRUSTED:
            return None
        *first, last = map(str, self.distrusted)
        which = f"cameras {', '.join(first)} and {last}"
        return f"{which} deviate from the others: check them with 'footscan calibrate check', then scan again"

    @property
    def rms_mm(self) -> float:
        """Root mean square of the distances of all pairs of trusted cameras, after the corrections; 0 without pairs.

        >>> one = Disagreement(median_mm=0.0, deviation_mm=0.1, rms_mm=0.3)
        >>> other = one.model_copy(update={"rms_mm": 0.1})
        >>> pairs = [PairDisagreement(cameras=(1, 2), points=1, before=one, after=one)]
        >>> pairs.append(PairDisagreement(cameras=(1, 3), points=7, before=other, after=other))
        >>> print(f"{FusionReport(pairs=pairs).rms_mm:.3f}")
        0.141
        """
        trusted = [pair for pair in self.pairs if not set(pair.cameras) & set(self.distrusted)]
        points = sum(pair.points for pair in trusted)
        squares = sum(pair.points * pair.after.rms_mm**2 for pair in trusted)
        return math.sqrt(squares / points) if points else 0.0

"""thesis.json: the method of the thesis beside footscan's, on the same films."""

from typing import Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.quality import Comparison

Method = Literal["thesis", "thesis-all-corners", "footscan"]
"""That of the thesis, the same with its quadratic through all clicked corners instead of five, and footscan's."""
Stage = Literal["calibration", "all-corners", "extraction", "outliers", "fusion", "surface"]
"""A stage whose method can be exchanged: the calibration by the quadratic through five clicked corners, or through all;
`fusion` includes the heads' places."""


class BlockDimension(Document):
    """A dimension of the block, mm."""

    nominal_mm: float
    printed_mm: float
    """Table 6-1 of the thesis."""
    found_mm: dict[Method, float | None]
    """By each method on the same films of the virtual scanner; None if no cuboid was found."""


class FootMeasure(Document):
    """A measure of a filmed foot beside the truth."""

    value: float | None
    truth: float
    uncertainty: float | None
    status: str


class ReconstructedFoot(Document):
    """A foot, filmed by the virtual scanner and reconstructed by one method."""

    method: Method
    comparison: Comparison | None = None
    """Of the surface with the true one, and back; None without a surface."""
    within_share: float | None = None
    """Share of the surface that lies at most 1 mm from the truth."""
    resolution_mm: float | None = None
    """Median distance from a point of the cloud to the nearest other one."""
    holes_mm: list[float] = Field(default_factory=list)
    """Perimeters of the holes that are left, the longest first."""
    measures: dict[str, FootMeasure] = Field(default_factory=dict)
    problem: str | None = None
    """Reason why nothing was measured."""


class ClickedCorners(Document):
    """The quadratic through some of the corners that were clicked, at all of them."""

    points: int | None
    """Corners of each camera that were used, far from each other; None: all."""
    median_mm: float
    worst_mm: float


class StageOutcome(Document):
    """A filmed world, reconstructed with the method of the thesis in some stages."""

    seed: int
    exchanged: tuple[Stage, ...]
    """Stages of the thesis; all others are footscan's."""
    mean_mm: float | None = None
    """Distance of the surface to the truth; None if there is no surface."""
    p99_mm: float | None = None
    length_error_mm: float | None = None
    """Of the foot length; None if it was not measured."""
    length_status: str | None = None
    problem: str | None = None


class ThesisResult(Document):
    """What `footscan thesis` finds."""

    format: Literal["footscan.thesis/1"] = "footscan.thesis/1"
    coefficients: int
    """Number of printed rows of Table 4-3."""
    agreeing: int
    """Of them, those that the fit to Table 4-2 rounds to."""
    block: list[BlockDimension]
    feet: list[ReconstructedFoot]
    corners: list[ClickedCorners]
    stages: list[StageOutcome]

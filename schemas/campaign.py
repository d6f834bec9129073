"""The outcomes of a campaign: what a reconstruction said of each world, beside the truth."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.measures import ErrorCause, Status
from schemas.parameters.simulation import Seed

Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]

WorldKind = Literal["points", "films"]
"""`points`: exact stripe points with errors, no pictures; `films`: pictures."""

LEAST_ERROR_MM = 0.3
"""A measure is wrong from this error on, if it also exceeds three of its standard deviations."""
SIGMAS = 3.0
FAR_MM = 2.0
"""A place of the surface is wrong from this distance on."""
FAR_SHARE = 0.001
"""Share of far places from which a surface is wrong: a single vertex is not seen by anybody. Chosen by hand."""
COVERED_SHARE = 0.75
"""Share of the surface that stripes cover from which a foot can be measured. Chosen by hand."""


class WorldMeasure(Document):
    """One measure beside its truth, mm; the arch index has no unit."""

    value: float | None
    truth: float | None
    """None if the object has no such measure."""
    sigma: float | None
    """Standard deviation that was reported."""
    status: Status
    budget: dict[ErrorCause, float] | None = None
    """Standard deviation by its cause, as reported; None in files of earlier versions."""
    note: str | None = None
    """Reasons for the status, as reported."""

    @property
    def error(self) -> float | None:
        """Value less truth."""
        return None if self.value is None or self.truth is None else self.value - self.truth

    @property
    def is_silent(self) -> bool:
        """True if it is reported as good and is wrong."""
        if self.status != "ok":
            return False
        if self.error is None:
            return True
        return abs(self.error) > max(LEAST_ERROR_MM, SIGMAS * (self.sigma or 0.0))


class ShapeError(Document):
    """Distances of points or of a surface from the true surface, mm, after the best rigid fit."""

    mean: NotNegative
    p95: NotNegative
    p99: NotNegative
    largest: NotNegative
    beyond_1mm: Share
    beyond_2mm: Share


class WorldOutcome(Document):
    """What came of one world."""

    format: Literal["footscan.world_outcome/1"] = "footscan.world_outcome/1"
    seed: Seed
    kind: WorldKind
    problem: str | None = None
    """Reason why nothing was measured."""
    crashed: bool = False
    """The program failed on this world, instead of refusing it."""
    covered: Share = 0.0
    """Share of the true surface that stripe points cover."""
    shift_mm: NotNegative = 0.0
    """Length of the shift that brought the scan onto the truth."""
    cloud: ShapeError | None = None
    surface: ShapeError | None = None
    """Of its measured part; filled surface is marked as such."""
    warnings: list[str] = Field(default_factory=list)
    """What was reported of the scan as a whole: cameras that contradict each other, a side that does not fit."""
    measures: dict[str, WorldMeasure] = Field(default_factory=dict)

    @property
    def is_measured(self) -> bool:
        """True if at least one measure is reported as good."""
        return any(measure.status == "ok" for measure in self.measures.values())

    @property
    def can_be_measured(self) -> bool:
        """True if the stripes cover enough of an object that has a foot's measures."""
        known = [measure.truth is not None for measure in self.measures.values()]
        return self.covered >= COVERED_SHARE and (not known or all(known))

    @property
    def silent_errors(self) -> list[str]:
        """Names of the measures that are reported as good and are wrong; `surface` if it is and nothing warns of it."""
        names = [name for name, measure in self.measures.items() if measure.is_silent]
        is_wrong = self.surface is not None and self.surface.beyond_2mm > FAR_SHARE
        if is_wrong and self.is_measured and not self.warnings:
            names.append("surface")
        return names

"""The files of `footscan regress`: the suite, the accepted baseline with the steps behind it, and the history."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, AwareDatetime, BeforeValidator, Field, model_validator

from schemas.base.model import Document, Pseudonym, RelativePath
from schemas.parameters.presets import Preset
from schemas.parameters.scan import ScanParameters
from schemas.parameters.simulation import Seed
from schemas.parameters.virtual_scan import VirtualScan

WORLDS = "worlds"
"""Name under which the sums of all worlds are judged, as those of a set."""

Name = Annotated[str, Field(min_length=1)]
FigureName = Annotated[str, Field(pattern=r"^[a-z0-9_.-]{1,80}$")]
"""Such as `accuracy.mean_mm`; what stands before the point is its group."""


class DataSet(Document):
    """One scan of a suite, and how it is reconstructed."""

    scan: Name | None = None
    """Folder of a recorded scan."""
    virtual: VirtualScan | None = None
    calibration: Name | None = None
    """File for a recorded scan; default: the one that it names. A virtual scanner is calibrated by its own."""
    preset: Preset | None = None
    """As in `ScanParameters`, in place of the suite's parameters."""
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    """In place of those of the suite and of the preset, by section and name."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.scan is None) == (self.virtual is None):
            raise ValueError("expected either scan or virtual")
        if self.virtual is not None and self.calibration is not None:
            raise ValueError("calibration goes with scan, expected none for a virtual one")
        return self


class Tolerance(Document):
    """Largest difference of a figure from the accepted one: the larger of both bounds."""

    absolute: Annotated[float, Field(ge=0)] = 0.0
    """In the figure's own unit."""
    relative: Annotated[float, Field(ge=0)] = 0.0
    """Share of the accepted figure."""

    def allows(self, accepted: float) -> float:
        """Largest distance from `accepted` that is tolerated."""
        return max(self.absolute, self.relative * abs(accepted))


def _as_tolerance(value: Any) -> Any:
    """A plain number is an absolute tolerance, one with a per cent sign a relative one."""
    if not isinstance(value, str | int | float):
        return value
    number, percent, _ = str(value).partition("%")
    try:
        return {"relative": float(number) / 100} if percent else {"absolute": float(number)}
    except ValueError:
        raise ValueError("expected a number, a percentage, or absolute and relative") from None


AnyTolerance = Annotated[Tolerance, BeforeValidator(_as_tolerance)]


class Seeds(Document):
    """Worlds that are drawn from consecutive seeds."""

    first: Seed = 1
    count: Annotated[int, Field(ge=1, le=100_000)]

    @property
    def seeds(self) -> list[int]:
        """All of them."""
        return list(range(self.first, self.first + self.count))


class SuiteWorlds(Document):
    """Worlds that are drawn at random, see docs/worlds.md."""

    points: Seeds
    """Worlds without pictures: the same every night."""
    fresh_points: Annotated[int, Field(ge=0, le=100)] = 0
    """Worlds without pictures that are drawn anew each night, by its date; those that fail are run every night from
    then on."""
    films: Seeds | None = None
    """Worlds that are filmed: the same every night."""
    described: list[RelativePath] = Field(default_factory=list)
    """Files of worlds (world.json) that are filmed every night: cases that are kept."""


class Suite(Document):
    """The scans that are run every night; its paths are relative to it."""

    format: Literal["footscan.suite/1"]
    baseline: Name = "baseline.yaml"
    """File of the accepted figures; what the steps came to lies beside it."""
    out: Name = "nights"
    """Folder of films, cache, history and page."""
    every_hours: Annotated[float, Field(gt=0)] | None = None
    """Intended interval of the runs: longer gaps are marked on the page."""
    timed_passes: Annotated[int, Field(ge=0, le=20)] = 2
    """Number of runs of a scan with an empty cache, to measure time and memory; 0 measures neither."""
    parameters: ScanParameters = ScanParameters()
    tolerances: dict[Name, AnyTolerance] = Field(default_factory=dict)
    """By figure, with `*` as in a shell, before it `SET:` for one set alone; the last that fits wins, then those of the
    project."""
    sets: dict[Pseudonym, DataSet] = Field(default_factory=dict)
    worlds: SuiteWorlds | None = None

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if not self.sets and self.worlds is None:
            raise ValueError("expected sets, worlds or both")
        if WORLDS in self.sets:
            raise ValueError(f"sets.{WORLDS}: this name is that of the worlds, expected another one")
        return self


def _reason(text: str) -> str:
    if not text.strip():
        raise ValueError("is empty, expected why the new figures are right")
    return " ".join(text.split())


class Acceptance(Document):
    """The reason why figures were accepted."""

    reason: Annotated[str, AfterValidator(_reason)]
    date: AwareDatetime
    by: Name
    software: str


class Baseline(Document):
    """The accepted figures of a suite."""

    format: Literal["footscan.baseline/1"] = "footscan.baseline/1"
    accepted: Annotated[list[Acceptance], Field(min_length=1)]
    """The last one first."""
    sets: dict[Pseudonym, dict[FigureName, float | None]]
    """By set and figure; null where there is none."""


class AcceptedStep(Document):
    """The accepted result of a step."""

    step: str
    """`extract-3`"""
    key: str
    """Of its action in the store."""
    result: str
    """Digest of the result, or why there is none."""


class AcceptedSteps(Document):
    """The results of the steps of all sets when the baseline was accepted, each step after its inputs."""

    format: Literal["footscan.steps/1"] = "footscan.steps/1"
    sets: dict[Pseudonym, list[AcceptedStep]]


class NightBegun(Document):
    """A line of the history: a night has begun."""

    event: Literal["begun"] = "begun"
    night: str
    time: AwareDatetime
    software: str
    host: str


class NightEnded(Document):
    """A line of the history: what came of it."""

    event: Literal["ended"] = "ended"
    night: str
    time: AwareDatetime
    status: Literal[0, 1, 3]
    """Exit status of the command."""
    accepted: str | None = None
    """Reason, where its figures became the baseline."""
    worse: list[str] = Field(default_factory=list)
    """`set: figure` of each that is worse or missing."""
    problems: dict[str, str] = Field(default_factory=dict)
    """Why a set could not be run to its end."""
    sets: dict[str, dict[str, float | None]]
    """Figures by set."""

"""What an operator sees of a session: one picture of its state for the terminal and for the page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from footscan.calibration.capture.standing import Complaint
from pipelines.live.calibrating.filmed import Purpose

Step = Literal["begin", "place", "look", "filmed", "calibrated", "body", "planes", "used", "checked"]
"""`begin`: nothing has begun. `place`: the object is to be placed. `look`: it was filmed and judged. `filmed`: all
placements are. `calibrated`: the calibration is stored. `body`: the body is to be placed. `planes`: the laser planes
are stored. `used`: rig.yaml names the calibration. `checked`: the verdict is stored."""
Action = Literal[
    "calibrate", "check", "put", "take", "next", "go", "finish", "discard", "body", "film-body", "use", "end"
]  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """The result of a session as a table."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    remarks: Sequence[str]
    """Sentences."""
    file: str
    has_picture: bool = False
    plane_columns: Sequence[str] = ()
    planes: Sequence[Sequence[str]] = ()
    """Where the laser planes lie, a row for each laser; empty if they were not filmed."""
    is_well: bool = True
    """False if a camera has moved, or could not be checked."""


@dataclass(frozen=True)
class View:
    """The state of a session."""

    step: Step
    words: str
    """What to do now."""
    actions: Sequence[Action]
    """What can be done now; first what is usual."""
    purpose: Purpose | None = None
    folder: str = ""
    number: int | None = None
    """The placement that is to be filmed or was filmed last."""
    placements: Sequence[Sequence[float]] = ()
    """(dY, dZ) of each, mm."""
    taken: Sequence[int] = ()
    """Placements that are filmed."""
    complaints: Sequence[Complaint] = ()
    coverage: Mapping[int, float] = field(default_factory=dict)
    """Share of each camera's image between its stripes."""
    drawn: int = 0
    """Number of the picture of the stripes; it grows with each new one."""
    outcome: Outcome | None = None

    @property
    def is_well(self) -> bool:
        """True if the session came to a result that gives no cause to act."""
        return self.outcome is not None and self.outcome.is_well

    @property
    def price(self) -> str:
        """What it costs to calibrate from the placements that are filmed by now; empty if that is not offered."""
        taken, all_of = len(self.taken), len(self.placements)
        if self.purpose != "calibration" or "finish" not in self.actions or taken == all_of:
            return ""
        return (
            f"{taken} of {all_of} placements: the calibration holds only in the regions that are drawn as covered. "
            "Film all for whole feet."
        )

    def as_json(self) -> dict[str, Any]:
        """The view as a JSON object."""
        coverage = {str(camera): share for camera, share in self.coverage.items()}
        return asdict(self) | {"coverage": coverage, "price": self.price}

"""The measures of a foot for the choice of shoes, from a measures.json by any program, and the owner of the foot."""

import re
from datetime import date
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from schemas.base.limits import beyond, limit
from schemas.base.model import Document, Side
from schemas.measures import Status

AS_TOLD = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
"""Measures by a person or another version are accepted, too: unknown fields are ignored."""
LARGEST = 1e12
"""A thousand cubic metres in mm3: no measure of a foot is larger."""


class Reading(Document):
    """One measure."""

    model_config = AS_TOLD

    value: Annotated[float, Field(ge=-LARGEST, le=LARGEST)] | None
    unit: str = "mm"
    status: Status = "ok"
    definition: str = ""
    note: str | None = None
    uncertainty: Annotated[float, Field(ge=0, le=LARGEST)] | None = None
    """One standard deviation, in the measure's own unit."""

    @model_validator(mode="before")
    @classmethod
    def _has_fields(cls, value: Any) -> Any:
        if not isinstance(value, dict | Reading):
            raise ValueError('expected fields, such as {"value": 262.7}')
        return value


class Foot(Document):
    """The measures of one foot."""

    model_config = AS_TOLD

    unit: Literal["mm"] = "mm"
    side: Side = "unknown"
    side_note: str | None = None
    """Warning that the form of the foot contradicts its side."""
    posture: str = "unknown"
    """As in `schemas.base.model.Posture`, or in the words of another program."""
    axis: str | None = None
    measures: dict[str, Reading]
    finding: str | None = None
    """Reason why nothing was measured."""
    patient: str | None = None
    scan: str | None = None
    source: str = "measures"
    """Name of the foot in messages."""

    @model_validator(mode="before")
    @classmethod
    def _is_measures(cls, value: Any) -> Any:
        found = value.get("format", "") if isinstance(value, dict) else ""
        expected = "expected the format footscan.measures/1"
        if not re.fullmatch(r"footscan\.measures/\d+", str(found)):
            raise ValueError(f"{expected}, found {str(found)[:80]!r}")
        if found != "footscan.measures/1":
            raise ValueError(f"{expected}, found {found[:80]!r}: a newer footscan wrote it")
        measures = value.get("measures")
        if isinstance(measures, dict) and len(measures) > limit("measures"):
            raise ValueError(beyond("measures", len(measures)))
        return value

    @property
    def name(self) -> str:
        """`patient/scan` if both are known, or else the file."""
        return f"{self.patient}/{self.scan}" if self.patient and self.scan else self.source

    @property
    def date(self) -> date | None:
        """The day in the name of the scan, such as 2026-11-20-R."""
        for year, month, day in re.findall(r"(?<!\d)(\d{4})-?(\d\d)-?(\d\d)(?!\d)", self.scan or ""):
            try:
                return date(int(year), int(month), int(day))
            except ValueError:  # not a date
                continue
        return None

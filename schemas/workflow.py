"""workflow.yaml: the one file a user edits."""

import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from schemas.base.model import Document, Pseudonym
from schemas.parameters.scan import ScanParameters
from schemas.tuning import Tuning


def _place(named: str) -> str:
    if not named or "\0" in named:
        raise ValueError("expected a folder or a URL")
    return named


def _path(named: str) -> str:
    if not named or "\0" in named:
        raise ValueError("expected a path")
    return named


def _without_empty(sections: Any) -> Any:
    """A section with nothing below its name says as much as one that is left out."""
    if sections is None:
        return {}
    if not isinstance(sections, dict):
        return sections
    return {name: section for name, section in sections.items() if section is not None}


def _as_list(folders: Any) -> Any:
    return [folders] if isinstance(folders, str) else folders


AnyPath = Annotated[str, Field(min_length=1), AfterValidator(_path)]
Folder = AnyPath
Folders = Annotated[
    list[Folder],
    BeforeValidator(_as_list),
    Field(min_length=1),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]


class ChosenCalibration(Document):
    """A calibration, and for which scans it is meant: either its file, or the capture that it is made from."""

    file: AnyPath | None = None
    """The calibration file."""
    capture: AnyPath | None = None
    """Folder of a capture of the reference object."""
    scanner: Pseudonym | None = None
    """For scans of this scanner; default: of any."""
    since: datetime.date | None = None
    """For scans of this day and later, until the next one takes over; default: from the start."""

    @model_validator(mode="after")
    def _file_or_capture(self) -> Self:
        if (self.file is None) == (self.capture is None):
            found = "neither" if self.file is None else "both"
            raise ValueError(f"expected exactly one of file and capture, found {found}")
        return self


class Workflow(Document):
    """The content of workflow.yaml; its paths are relative to it."""

    format: Literal["footscan.workflow/1"]
    archive: Folders
    """Folder that holds the scans, each a folder with a scan.yaml; or several such folders."""
    calibration: AnyPath | None = None
    """Used for scans that name none themselves."""
    calibrations: list[ChosenCalibration] = Field(default_factory=list)
    """Likewise, where they differ by scanner and date; excludes `calibration`."""
    results: AnyPath
    """Folder for `<patient>/<scan>/`."""
    cache: Annotated[str, AfterValidator(_place)] | None = None
    """Folder of the content store, or its URL as fsspec has it; default: `.footscan` in the results."""
    group: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    """Group of users of this machine who share what is written; default: it is the owner's alone."""
    workers: Annotated[int, Field(ge=1, le=256)] | None = None
    """How many steps run at once; default: as many as there are cores."""
    parameters: Annotated[ScanParameters, BeforeValidator(_without_empty)] = ScanParameters()
    tune: Tuning | None = None
    """What `footscan tune` seeks."""

    @model_validator(mode="after")
    def _one_calibration_a_scan(self) -> Self:
        if self.calibration is not None and self.calibrations:
            raise ValueError("calibration and calibrations exclude each other, expected one of them")
        meant = [(chosen.scanner, chosen.since) for chosen in self.calibrations]
        for scanner, since in meant:
            if meant.count((scanner, since)) > 1:
                of, start = scanner or "any scanner", since or "the start"
                raise ValueError(f"calibrations: two of {of} since {start}, expected one")
        return self

"""workflow.yaml: the one file a user edits."""

import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from schemas.base.model import Document, Pseudonym
from schemas.choices import ExportFormat
from schemas.parameters.scan import ScanParameters
from schemas.profile import Profile, ProfileName
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
    """The sections without empty ones: an empty section means the same as an absent one."""
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
    """A calibration, as its file or as the capture that it is made from, and the scans that it is meant for."""

    file: AnyPath | None = None
    """The calibration file."""
    capture: AnyPath | None = None
    """Folder of a capture of the reference object."""
    scanner: Pseudonym | None = None
    """Scanner whose scans it is for; default: any."""
    since: datetime.date | None = None
    """First day of the scans that it is for, until the next calibration takes over; default: from the start."""

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
    """Folder that holds the scans, each a folder with a scan.yaml, or its URL for fsspec; or several of them."""
    calibration: AnyPath | None = None
    """Calibration of the scans that name none themselves."""
    calibrations: list[ChosenCalibration] = Field(default_factory=list)
    """Calibrations by scanner and date, for scans that name none themselves; excludes `calibration`."""
    results: AnyPath
    """Folder for `<patient>/<scan>/`."""
    cache: Annotated[str, AfterValidator(_place)] | None = None
    """Folder of the content store, or its URL for fsspec; default: `.footscan` in the results."""
    exports: list[ExportFormat] = Field(default_factory=list)
    """Formats in which the mesh of each scan is delivered beside foot.stl and foot.ply."""
    size_table: AnyPath | None = None
    """Table of sizes and widths (YAML); default: the built-in one."""
    group: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    """Group of users of this machine who share the files that are written; default: only their owner reads them."""
    workers: Annotated[int, Field(ge=1, le=256)] | None = None
    """Number of steps that run at once; default: the number of cores."""
    parameters: Annotated[ScanParameters, BeforeValidator(_without_empty)] = ScanParameters()
    profiles: dict[ProfileName, Profile] = Field(default_factory=dict)
    """Options of a run by name, for `--profile`."""
    tune: Tuning | None = None
    """The search of `footscan tune`."""

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

"""workflow.yaml: the one file a user edits."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from schemas.documents import Document
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.fusion import FusionParameters
from schemas.parameters.mapping import MappingParameters
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters
from schemas.parameters.surface import SurfaceParameters


def _place(named: str) -> str:
    if not named:
        raise ValueError("expected a folder or a URL")
    return named


def _without_empty(sections: Any) -> Any:
    """A section with nothing below its name says as much as one that is left out."""
    if sections is None:
        return {}
    if not isinstance(sections, dict):
        return sections
    return {name: section for name, section in sections.items() if section is not None}


class ScanParameters(Document):
    """What the steps of a scan can be told, a model a step."""

    extraction: ExtractionParameters = ExtractionParameters()
    mapping: MappingParameters = MappingParameters()
    fusion: FusionParameters = FusionParameters()
    outliers: OutlierParameters = OutlierParameters()
    normals: NormalParameters = NormalParameters()
    surface: SurfaceParameters = SurfaceParameters()


class Workflow(Document):
    """The content of workflow.yaml; its paths are relative to it."""

    format: Literal["footscan.workflow/1"]
    archive: Annotated[str, Field(min_length=1)]
    """Folder that holds the scans, each a folder with a scan.yaml."""
    calibration: str | None = None
    """Used for scans that name none themselves."""
    results: Annotated[str, Field(min_length=1)]
    """Folder for `<patient>/<scan>/`."""
    cache: Annotated[str, AfterValidator(_place)] | None = None
    """Folder of the content store, or its URL as fsspec has it; `.footscan` in the results where absent."""
    workers: Annotated[int, Field(ge=1, le=256)] | None = None
    """How many steps run at once; as many as there are cores where absent."""
    parameters: Annotated[ScanParameters, BeforeValidator(_without_empty)] = ScanParameters()

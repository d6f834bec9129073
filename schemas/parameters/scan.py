"""The parameters of a scan: those of its steps, section by section."""

from typing import Any

from pydantic import Field, model_validator

from schemas.base.model import Document
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.fusion import FusionParameters
from schemas.parameters.heads import HeadParameters
from schemas.parameters.mapping import MappingParameters
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters
from schemas.parameters.presets import Preset, overlaid, preset_sections
from schemas.parameters.surface import SurfaceParameters


class ScanParameters(Document):
    """The parameters of all steps of a scan, one model a step."""

    preset: Preset | None = Field(default=None, exclude=True)
    """Parameters of several steps by name, in place of the defaults: `thesis` for the method of the thesis, or
    `thesis:extraction,surface` for some of its steps. None once they have been filled in."""
    extraction: ExtractionParameters = ExtractionParameters()
    mapping: MappingParameters = MappingParameters()
    heads: HeadParameters = HeadParameters()
    fusion: FusionParameters = FusionParameters()
    outliers: OutlierParameters = OutlierParameters()
    normals: NormalParameters = NormalParameters()
    surface: SurfaceParameters = SurfaceParameters()

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, sections: Any) -> Any:
        """Fill in the parameters of a preset where the sections leave them out."""
        if not isinstance(sections, dict) or not isinstance(sections.get("preset"), str):
            return sections
        own = {
            name: section.model_dump(exclude_unset=True) if isinstance(section, Document) else section
            for name, section in sections.items()
            if name != "preset"
        }
        try:
            below = preset_sections(sections["preset"])
        except ValueError:
            return sections  # refused by the field's own validator, which names the field
        return overlaid(below, own) if all(isinstance(section, dict) for section in own.values()) else sections

"""Parameters of the files that are delivered."""

from pydantic import Field

from schemas.base.model import Document
from schemas.choices import ExportFormat
from schemas.parameters.foot import FootParameters
from schemas.sizes import People


class SizesParameters(Document):
    """Which sizes are given."""

    people: People | None = None
    """Whose scales; default: all."""
    systems: list[str] = Field(default_factory=list)
    """Systems of sizes and widths, such as `eu`; default: all."""


class ExportParameters(FootParameters):
    """The form of an exported mesh."""

    export_format: ExportFormat

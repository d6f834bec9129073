"""choices.yaml: what a person decided for one scan, beside its scan.yaml."""

import datetime
from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document, Posture
from schemas.measures import Axis
from schemas.sizes import People

ExportFormat = Literal["obj", "wrl", "3mf", "glb"]
"""Formats of meshes that are delivered beside foot.stl and foot.ply where they are asked for."""


class Decided(Document):
    """Who decided something, and when."""

    by: Annotated[str, Field(max_length=80)] | None = None
    at: datetime.datetime | None = None


class Choices(Document):
    """The content of choices.yaml. What is left out stays as scan.yaml, the workflow or the default has it."""

    format: Literal["footscan.choices/1"]
    axis: Axis | None = None
    """Axis of the foot, along which lengths are measured."""
    posture: Posture | None = None
    """Posture of the person and load on the foot, in place of that of scan.yaml."""
    people: People | None = None
    """Whose scales of sizes and widths are given; default: all."""
    systems: list[str] = Field(default_factory=list)
    """Systems of sizes and widths that are given, such as `eu`; default: all."""
    exports: list[ExportFormat] = Field(default_factory=list)
    """Formats in which the mesh is delivered as well."""
    notes: Annotated[str, Field(max_length=2000)] = ""
    """Remarks for the report."""
    decided: Decided = Decided()
    """Who made these choices, and when."""

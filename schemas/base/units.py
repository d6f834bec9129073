"""Units and points that several documents share."""

from typing import Annotated, Literal

from pydantic import Field

LengthUnit = Literal["cm", "mm"]
MILLIMETRES: dict[str, float] = {"cm": 10.0, "mm": 1.0}
"""Millimetres in each unit."""
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Point = tuple[Coordinate, Coordinate]

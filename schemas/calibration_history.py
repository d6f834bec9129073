"""Former versions of the calibration file, and their migration to the next version."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from schemas.base.json_files import validate
from schemas.base.model import Document
from schemas.base.units import MILLIMETRES, LengthUnit, Point

Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class QuadraticCamera(Document):
    """Y and Z as second-order polynomials of the pixel, coefficients in the order 1, i, j, i^2, ij, j^2."""

    camera: Annotated[int, Field(ge=1)]
    alpha_y: Six
    alpha_z: Six


class CalibrationV1(Document):
    """The thesis's calibration."""

    format: Literal["footscan.calibration/1"]
    unit: LengthUnit
    cameras: Annotated[list[QuadraticCamera], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        _refuse_twice([camera.camera for camera in self.cameras])
        return self


class PolynomialCameraV2(Document):
    """Y and Z in mm as polynomials of u = (i - centre_i) / scale and v = (j - centre_j) / scale."""

    camera: Annotated[int, Field(ge=1)]
    model: Literal["polynomial"] = "polynomial"
    order: Annotated[int, Field(ge=1, le=5)]
    centre_px: Point
    scale_px: Annotated[float, Field(gt=0)]
    alpha_y: list[float]
    alpha_z: list[float]
    region_px: list[Point]
    points: Annotated[int, Field(ge=0)]
    rms_mm: float | None = None
    held_out_rms_mm: float | None = None

    @model_validator(mode="after")
    def _count_terms(self) -> Self:
        terms = (self.order + 1) * (self.order + 2) // 2
        if len(self.alpha_y) != terms or len(self.alpha_z) != terms:
            raise ValueError(f"order {self.order} has {terms} terms, expected as many in alpha_y and alpha_z")
        return self


class CalibrationV2(Document):
    """Polynomials with the region that supports them."""

    format: Literal["footscan.calibration/2"]
    unit: Literal["mm"] = "mm"
    source: str
    source_sha256: str
    software: str
    cameras: Annotated[list[PolynomialCameraV2], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        _refuse_twice([camera.camera for camera in self.cameras])
        return self


def _refuse_twice(ids: list[int]) -> None:
    if len(set(ids)) != len(ids):
        raise ValueError(f"expected each camera once, found {ids}")


def migrate_v1(old: CalibrationV1, source: Path | str) -> CalibrationV2:
    """Version 1 as version 2: the same polynomials, in mm, of coordinates that are not normalised."""
    scale = MILLIMETRES[old.unit]
    migrated = {
        "format": "footscan.calibration/2",
        "source": str(source),
        "source_sha256": "",
        "software": "footscan.calibration/1",
        "cameras": [
            {
                "camera": camera.camera,
                "order": 2,
                "centre_px": (0.0, 0.0),
                "scale_px": 1.0,
                "alpha_y": [scale * a for a in camera.alpha_y],
                "alpha_z": [scale * a for a in camera.alpha_z],
                "region_px": [],
                "points": 0,
            }
            for camera in old.cameras
        ],
    }
    return validate(source, CalibrationV2, migrated)


def migrate_v2(old: CalibrationV2) -> dict[str, Any]:
    """Version 2 as the content of version 3: the same polynomials, without a covariance."""
    return {
        "format": "footscan.calibration/4",
        "sources": [{"name": old.source, "sha256": old.source_sha256}],
        "software": old.software,
        "cameras": [
            {
                "camera": camera.camera,
                "map": {
                    "model": "polynomial",
                    "order": camera.order,
                    "centre_px": camera.centre_px,
                    "scale_px": camera.scale_px,
                    "alpha_y": camera.alpha_y,
                    "alpha_z": camera.alpha_z,
                },
                "region_px": camera.region_px,
                "points": camera.points,
                "rms_mm": camera.rms_mm,
                "held_out_rms_mm": camera.held_out_rms_mm,
            }
            for camera in old.cameras
        ],
    }

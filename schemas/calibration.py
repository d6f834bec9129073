"""The calibration file: a pixel-to-world map for each camera, versioned.

Version 1 holds what the thesis holds: six coefficients for Y and six for Z a camera, of the plain pixel coordinates.
Version 2 holds polynomials of any order in normalised coordinates with the region that supports them.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from schemas.documents import Document, parse_json, read_text, validate
from schemas.errors import RefusedInput

LengthUnit = Literal["cm", "mm"]
MILLIMETRES: dict[str, float] = {"cm": 10.0, "mm": 1.0}
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
Point = tuple[float, float]


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


class PolynomialCamera(Document):
    """Y and Z in mm as polynomials of u = (i - centre_i) / scale and v = (j - centre_j) / scale.

    Terms are ordered by degree, and within a degree by falling power of u: 1, u, v, u^2, uv, v^2, u^3, ...
    """

    camera: Annotated[int, Field(ge=1)]
    model: Literal["polynomial"] = "polynomial"
    order: Annotated[int, Field(ge=1, le=5)]
    centre_px: Point
    scale_px: Annotated[float, Field(gt=0)]
    alpha_y: list[float]
    alpha_z: list[float]
    region_px: list[Point]
    """Corners of the convex region of pixels (i, j) that control points support; empty where it is not known."""
    points: Annotated[int, Field(ge=0)]
    """How many control points were used."""
    rms_mm: float | None = None
    """Distance from the control points, root mean square."""
    held_out_rms_mm: float | None = None
    """The same on control points left out of the fit; None where there are too few to leave any out."""

    @model_validator(mode="after")
    def _count_terms(self) -> Self:
        terms = (self.order + 1) * (self.order + 2) // 2
        if len(self.alpha_y) != terms or len(self.alpha_z) != terms:
            raise ValueError(f"order {self.order} has {terms} terms, expected as many in alpha_y and alpha_z")
        return self


class Calibration(Document):
    """The current version."""

    format: Literal["footscan.calibration/2"] = "footscan.calibration/2"
    unit: Literal["mm"] = "mm"
    source: str
    """What it was made from: the chart's or capture's name."""
    source_sha256: str
    software: str
    """Name and version of the program that wrote it."""
    cameras: Annotated[list[PolynomialCamera], Field(min_length=1)]

    @model_validator(mode="after")
    def _unique(self) -> Self:
        _refuse_twice([camera.camera for camera in self.cameras])
        return self

    def camera(self, camera_id: int, source: Path | str = "calibration") -> PolynomialCamera:
        """The map of one camera, or a refusal that names what there is."""
        for camera in self.cameras:
            if camera.camera == camera_id:
                return camera
        known = ", ".join(str(camera.camera) for camera in self.cameras)
        raise RefusedInput(source, f"has no camera {camera_id}, expected one of {known}", field="cameras")


def _refuse_twice(ids: list[int]) -> None:
    if len(set(ids)) != len(ids):
        raise ValueError(f"expected each camera once, found {ids}")


def read_calibration(path: Path) -> Calibration:
    """The calibration file `path`, older versions migrated to the current one."""
    return calibration_from_json(read_text(path), path)


def calibration_from_json(text: str, source: Path | str) -> Calibration:
    """A calibration from its JSON text; `source` names it in messages."""
    value: Any = parse_json(source, text)
    version = value.get("format") if isinstance(value, dict) else None
    if version == "footscan.calibration/1":
        return migrate_v1(validate(source, CalibrationV1, value), source)
    if version != "footscan.calibration/2":
        expected = "expected 'footscan.calibration/1' or 'footscan.calibration/2'"
        raise RefusedInput(source, f"{expected}, found {version!r}", field="format")
    return validate(source, Calibration, value)


def migrate_v1(old: CalibrationV1, source: Path | str) -> Calibration:
    """Version 1 as version 2: the same polynomials, in mm, of coordinates that are not normalised."""
    scale = MILLIMETRES[old.unit]
    migrated = {
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
    return validate(source, Calibration, migrated)  # a coefficient near the largest number has no counterpart in mm

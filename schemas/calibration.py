"""The calibration file: a map from pixels to millimetres for each camera, versioned.

Version 1 holds what the thesis holds: six coefficients for Y and six for Z a camera, of the plain pixel coordinates.
Version 2 holds polynomials of any order in normalised coordinates with the region that supports them. Version 3 holds
any of the models with their covariance and their sources. Version 4, the current one, also says where each camera's
laser plane lies along the travel. Older files are migrated when they are read.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from schemas.base.errors import RefusedInput
from schemas.base.image_size import FRAME_SIZE, ImageSize
from schemas.base.json_files import parse_json, read_text, validate
from schemas.base.model import Document, Pseudonym, canonical_json
from schemas.base.units import Point
from schemas.calibration_history import CalibrationV1, CalibrationV2, migrate_v1, migrate_v2
from schemas.scan import MOST_CAMERA, LaserNumber

VERSION = 4
_FAMILY = "footscan.calibration/"
LARGEST = 1e15
"""Largest number in a camera's map, so that results computed from it stay finite; chosen by hand."""
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Side = Annotated[int, Field(ge=1, le=100_000)]
Scale = Annotated[float, Field(ge=1e-9, le=LARGEST)]
DENT_PX = 1e-6
"""Distance in px by which a corner of a convex region may lie inside it, for rounding; chosen by hand."""


class PolynomialMap(Document):
    """Y and Z in mm as polynomials of u = (i - centre_i) / scale and v = (j - centre_j) / scale.

    Terms are ordered by degree, and within a degree by falling power of u: 1, u, v, u^2, uv, v^2, u^3, ...
    """

    model: Literal["polynomial"] = "polynomial"
    order: Annotated[int, Field(ge=1, le=5)]
    centre_px: Point
    scale_px: Scale
    alpha_y: list[Number]
    alpha_z: list[Number]

    @model_validator(mode="after")
    def _count_terms(self) -> Self:
        _check_terms(self.order, 0, self.alpha_y, self.alpha_z)
        return self


class Distortion(Document):
    """Map from the seen to the ideal place of a pixel, in normalised coordinates (Brown 1971), with r^2 = u^2 + v^2:

    u + u (k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2) and v + v (k1 r^2 + k2 r^4) + p1 (r^2 + 2 v^2) + 2 p2 u v.
    """

    k1: Number
    k2: Number
    p1: Number
    p2: Number


class Correction(Document):
    """Polynomials of (u, v), without terms of degree 0 and 1, that are added to Y and Z in mm."""

    order: Annotated[int, Field(ge=2, le=5)]
    alpha_y: list[Number]
    alpha_z: list[Number]

    @model_validator(mode="after")
    def _count_terms(self) -> Self:
        _check_terms(self.order, 3, self.alpha_y, self.alpha_z)
        return self


class HomographyMap(Document):
    """A plane seen by a pinhole: (Y w, Z w, w) = `matrix` (u, v, 1), with u = (i - centre_i) / scale and v likewise.

    `distortion` is removed from (u, v) first; `correction` is added at the end.
    """

    model: Literal["homography"] = "homography"
    centre_px: Point
    scale_px: Scale
    matrix: Annotated[list[Number], Field(min_length=8, max_length=8)]
    """Row by row; the ninth number is 1."""
    distortion: Distortion | None = None
    correction: Correction | None = None


PixelMap = Annotated[PolynomialMap | HomographyMap, Field(discriminator="model")]


class LaserPlane(Document):
    """Where the laser plane that a camera sees lies along the travel: X of a point of it at Y and Z, in mm, is

    x + offset_mm + yaw Y + pitch (Z - 57) + bend_mm (Y / 70)^2 + scale (x - x_mm)
    + step (delay_frames + shutter_frames row),

    with x the place of its head by the travel when the frame was taken, plus `ahead_mm` of the laser, `step` the way to
    the next frame, and `row` the place in the picture: -0.5 at the upper border, 0.5 at the lower one.
    """

    head: Annotated[int, Field(ge=1, le=64)]
    """Cameras of one head see one plane for each of its lasers."""
    offset_mm: Number = 0.0
    """Along X, relative to the mean of the planes of all heads."""
    yaw: Number = 0.0
    """Turn about Z, mm per mm."""
    pitch: Number = 0.0
    """Turn about Y, mm per mm."""
    bend_mm: Number = 0.0
    """Sagitta of the sheet over 140 mm."""
    scale: Number = 0.0
    """The head travels 1 + this per millimetre that it reports."""
    x_mm: Number = 0.0
    """Where `offset_mm` holds, if the scale is off."""
    delay_frames: Number = 0.0
    """Time by which this camera is later than the others of its head, in periods of its frames."""
    shutter_frames: Number = 0.0
    """Time from the first row to the last, in periods of its frames."""
    sd: Annotated[list[Number], Field(min_length=7, max_length=7)]
    """Standard deviations of the seven, in their order; 0 for those that the film does not determine."""


Residual = tuple[Number, Number, Number, Number]
"""A pixel (i, j), and the error of its mapped place in Y and in Z, mm."""


def view_number(camera: int, laser: int = 1) -> int:
    """Number a view: what one camera sees in the plane of one laser. That of laser 1 has the camera's own number.

    >>> view_number(5), view_number(5, laser=2)
    (5, 69)
    """
    return camera + MOST_CAMERA * (laser - 1)


def camera_of_view(view: int) -> int:
    """Return the camera of the number of a view.

    >>> camera_of_view(69), laser_of_view(69)
    (5, 2)
    """
    return (view - 1) % MOST_CAMERA + 1


def laser_of_view(view: int) -> int:
    """Return the laser of the number of a view."""
    return (view - 1) // MOST_CAMERA + 1


def view_name(view: int) -> str:
    """Name a view by its camera and, if it is not the first one, its laser.

    >>> view_name(5), view_name(69)
    ('5', '5 (laser 2)')
    """
    return name_of(camera_of_view(view), laser_of_view(view))


def name_of(camera: int, laser: int) -> str:
    """Name a camera and, if it is not the first one, its laser."""
    return f"{camera}" if laser == 1 else f"{camera} (laser {laser})"


class CameraCalibration(Document):
    """The map of one camera in the plane of one laser, its uncertainty, and its region of support."""

    camera: Annotated[int, Field(ge=1)]
    laser: LaserNumber = 1
    """Number of the laser among those of its head. A camera that sees two has a map for each."""
    ahead_mm: Annotated[float, Field(ge=-200, le=200)] = 0.0
    """X of the laser's plane minus X of the camera's head, by the construction of the head; `plane` has the rest."""
    image_px: tuple[Side, Side] | None = None
    """Columns and rows of the images that the map is valid for; None if unknown."""
    map: PixelMap
    covariance: list[list[float]] = Field(default_factory=list)
    """Covariance of the map's parameters, the lower triangle row by row; empty if unknown. The order of parameters is
    alpha_y, alpha_z; or matrix, k1, k2, p1, p2, then alpha_y and alpha_z of the correction."""
    condition: float | None = None
    """Condition number of the fit with all columns scaled to one length."""
    region_px: Annotated[list[Point], Field(max_length=10_000)]
    """Corners of the convex region of pixels (i, j) that data support; empty if unknown."""
    points: Annotated[int, Field(ge=0)]
    """Number of control points, or of points of the stripe, in the fit."""
    rms_mm: float | None = None
    """Root mean square of the distances of the fitted points."""
    held_out_rms_mm: float | None = None
    """The same for points held out of the fit; None if there are too few points to hold any out."""
    worst_mm: float | None = None
    """Largest distance, of the points held out if there are any."""
    residuals: Annotated[list[Residual], Field(max_length=10_000)] = Field(default_factory=list)
    """Residuals of the fit at each control point, or across each stretch of an edge; empty if unknown."""
    plane: LaserPlane | None = None
    """None if no film has shown it: the plane is where the travel says, at right angles to it."""

    @property
    def view(self) -> int:
        """Number of the view, as in `view_number`."""
        return view_number(self.camera, self.laser)

    @property
    def name(self) -> str:
        """The camera and, if it is not the first one, the laser."""
        return name_of(self.camera, self.laser)

    @model_serializer(mode="wrap")
    def _as_before(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A calibration of one laser a camera is written as it was before there were two: older readers take it."""
        document: dict[str, Any] = write(self)
        for name in ("laser", "ahead_mm"):
            if document.get(name) == type(self).model_fields[name].default:
                del document[name]
        return document

    @model_validator(mode="after")
    def _is_numbered(self) -> Self:
        if self.laser > 1 and self.camera > MOST_CAMERA:
            raise ValueError(f"camera: expected 1 to {MOST_CAMERA} for laser {self.laser}, found {self.camera}")
        return self

    @property
    def image_size(self) -> ImageSize:
        """Rows and columns of the images; of the scanner's cameras if unknown."""
        return ImageSize(*reversed(self.image_px)) if self.image_px else FRAME_SIZE

    @model_validator(mode="after")
    def _is_triangle(self) -> Self:
        size = parameter_count(self.map)
        lengths = [len(row) for row in self.covariance]
        if self.covariance and lengths != list(range(1, size + 1)):
            raise ValueError(f"covariance: expected the lower triangle of {size} x {size} numbers, row by row")
        return self

    @model_validator(mode="after")
    def _is_convex(self) -> Self:
        if self.region_px and not _convex(self.region_px):
            raise ValueError("region_px: expected the corners of a convex region one after the other, three at least")
        return self


class PairAgreement(Document):
    """The distance between two cameras' places of the same edges."""

    cameras: tuple[int, int]
    """Numbers of the cameras; larger by 64 for their views of laser 2."""
    places: Annotated[int, Field(ge=1)]
    """Number of stretches of edges that both cameras saw."""
    rms_mm: float
    worst_mm: float


class Source(Document):
    """A file that a calibration was made from."""

    name: str
    sha256: str


class _Calibration(Document):
    """What versions 3 and 4 have in common: version 3 has neither planes nor a body."""

    format: str
    unit: Literal["mm"] = "mm"
    sources: list[Source]
    """The chart; or the capture, its reference object and its films."""
    software: str
    """Name and version of the program that wrote it."""
    created: AwareDatetime | None = None
    """Time of creation; None if a step of a pipeline made it, because its results depend on nothing but its inputs."""
    cameras: Annotated[list[CameraCalibration], Field(min_length=1)]
    warnings: list[str] = Field(default_factory=list)
    """Probable mistakes in the sources, one line each."""
    body_rms_mm: float | None = None
    """Root mean square of the distances of the points from the body that showed the laser planes; None without one."""
    pairs: list[PairAgreement] = Field(default_factory=list)
    """Disagreement of each pair of cameras that saw the same edges."""

    @model_validator(mode="after")
    def _unique(self) -> Self:
        names = [camera.name for camera in self.cameras]
        if len(set(names)) != len(names):
            raise ValueError(f"expected each camera once for each of its lasers, found {', '.join(names)}")
        return self

    def camera(self, camera_id: int, source: Path | str = "calibration") -> CameraCalibration:
        """The map of one camera, for its first laser, or a refusal that lists the cameras of the calibration."""
        return self.maps(camera_id, source)[0]

    def maps(self, camera_id: int, source: Path | str = "calibration") -> list[CameraCalibration]:
        """The maps of one camera, by laser, or a refusal that lists the cameras of the calibration."""
        maps = [camera for camera in self.cameras if camera.camera == camera_id]
        if maps:
            return sorted(maps, key=lambda camera: camera.laser)
        known = ", ".join(str(number) for number in dict.fromkeys(camera.camera for camera in self.cameras))
        raise RefusedInput(source, f"has no camera {camera_id}, expected one of {known}", field="cameras")


class CalibrationV3(_Calibration):
    """The content of a calibration file of version 3."""

    format: Literal["footscan.calibration/3"]


class Calibration(_Calibration):
    """The content of a calibration file, in its current version."""

    format: Literal["footscan.calibration/4"] = "footscan.calibration/4"
    scanner: Pseudonym | None = None
    """The scanner that it was made for by `footscan calibrate film`; None if unknown."""


def with_offsets(calibration: Calibration, offsets_mm: Mapping[int, Mapping[int, float]]) -> Calibration:
    """The calibration with the offsets of lasers from their heads, by camera and laser, where it has none."""
    cameras = [
        camera
        if camera.ahead_mm
        else camera.model_copy(update={"ahead_mm": offsets_mm.get(camera.camera, {}).get(camera.laser, 0.0)})
        for camera in calibration.cameras
    ]
    return calibration.model_copy(update={"cameras": cameras})


def maps_to_json(maps: Sequence[CameraCalibration]) -> str:
    """The maps of one camera as JSON text: one map, or a list of several."""
    documents = [camera.model_dump(mode="json") for camera in maps]
    return canonical_json(documents[0] if len(documents) == 1 else documents)


def maps_from_json(text: str | bytes) -> list[CameraCalibration]:
    """The maps of one camera from the text of `maps_to_json`."""
    value = json.loads(text)
    return [CameraCalibration.model_validate(one) for one in (value if isinstance(value, list) else [value])]


def parameter_count(pixel_map: PolynomialMap | HomographyMap) -> int:
    """Number of parameters of a map that a fit can change."""
    if isinstance(pixel_map, PolynomialMap):
        return len(pixel_map.alpha_y) + len(pixel_map.alpha_z)
    correction = pixel_map.correction
    return 8 + 4 * (pixel_map.distortion is not None) + (2 * len(correction.alpha_y) if correction else 0)


def _check_terms(order: int, without: int, alpha_y: list[float], alpha_z: list[float]) -> None:
    terms = (order + 1) * (order + 2) // 2 - without
    if len(alpha_y) != terms or len(alpha_z) != terms:
        raise ValueError(f"order {order} has {terms} terms, expected as many in alpha_y and alpha_z")


def _convex(corners: list[Point]) -> bool:
    """True if corners run once around a convex region, either way; a corner may be repeated or lie on a side."""
    turns: list[float] = []
    for k, (i, j) in enumerate(corners):
        (i0, j0), (i1, j1) = corners[k - 1], corners[(k + 1) % len(corners)]
        a, b = (i - i0, j - j0), (i1 - i, j1 - j)
        longer = max(math.hypot(*a), math.hypot(*b)) or 1.0
        turns.append((a[0] * b[1] - a[1] * b[0]) / longer)  # about the distance by which the corner stands out, px
    return (min(turns) >= -DENT_PX) != (max(turns) <= DENT_PX)


def read_calibration(path: Path) -> Calibration:
    """The calibration file `path`, older versions migrated to the current one."""
    return calibration_from_json(read_text(path, "json_bytes"), path)


def calibration_from_json(text: str, source: Path | str) -> Calibration:
    """A calibration from its JSON text; `source` names it in messages."""
    value: Any = parse_json(source, text)
    found = value.get("format") if isinstance(value, dict) else None
    match found:
        case "footscan.calibration/1":
            value = migrate_v2(migrate_v1(validate(source, CalibrationV1, value), source))
        case "footscan.calibration/2":
            value = migrate_v2(validate(source, CalibrationV2, value))
        case "footscan.calibration/3":
            old = validate(source, CalibrationV3, value)
            value = old.model_dump(mode="json") | {"format": "footscan.calibration/4"}
        case "footscan.calibration/4":
            pass
        case _:
            raise RefusedInput(source, _unknown(found), field="format")
    return validate(source, Calibration, value)  # a coefficient near the largest number has no counterpart in mm


def _unknown(found: object) -> str:
    shown = repr(found[:80] if isinstance(found, str) else found)
    newer = re.fullmatch(f"{_FAMILY}([1-9][0-9]*)", found) if isinstance(found, str) else None
    if newer and int(newer[1][:9]) > VERSION:
        return f"expected version 1 to {VERSION}, found {shown}: a newer footscan wrote it"
    return f"expected '{_FAMILY}1' to '{_FAMILY}{VERSION}', found {shown}"

"""Pictures of a chessboard from which cameras are calibrated, in `chessboard.yaml`."""

from math import hypot, sqrt
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from schemas.base.model import Document, RelativePath
from schemas.rig import USUAL_HEADS

FARTHEST_MM = 1000.0
DIRECTION_ERROR = 1e-3
"""Bound of the length and of the angle of given directions, so that 0.7071 is exact enough."""

Squares = Annotated[int, Field(ge=4, le=60)]
Millimetres = Annotated[float, Field(ge=-FARTHEST_MM, le=FARTHEST_MM)]
Vector = tuple[Millimetres, Millimetres, Millimetres]


def _unit(direction: Vector) -> Vector:
    length = sqrt(sum(value * value for value in direction))
    if abs(length - 1.0) > DIRECTION_ERROR:
        raise ValueError(f"has length {length:.4g}, expected a direction of length 1")
    return direction


Direction = Annotated[Vector, AfterValidator(_unit)]


def _turns_visibly(squares: tuple[int, int]) -> tuple[int, int]:
    if (squares[0] + squares[1]) % 2 == 0:
        raise ValueError(f"expected an even and an odd number, so that a board upside down differs, found {squares}")
    return squares


class BoardPlace(Document):
    """A place of the board in the scanner's frame; X counts from where the heads stand in the pictures.

    The board is held so that the two black corner squares are on the left.
    """

    first_mm: Vector
    """X, Y, Z of the first inner corner, the upper left one: it touches the upper black corner square."""
    along: Direction
    """From there to the right."""
    down: Direction
    """From there down."""

    @model_validator(mode="after")
    def _square(self) -> Self:
        cosine = sum(a * b for a, b in zip(self.along, self.down, strict=True))
        if abs(cosine) > DIRECTION_ERROR:
            raise ValueError("along and down: expected directions at right angles")
        return self


class GlassPlate(Document):
    """The plate that feet stand on; boards are held above it, and its upper face is Z = 0."""

    thickness_mm: Annotated[float, Field(ge=0.1, le=100)]
    index: Annotated[float, Field(ge=1, le=2.5)] = 1.52
    """Refractive index; that of soda-lime glass by default."""


class BoardPicture(Document):
    """One pose of the board before a camera."""

    board: RelativePath
    """Picture in which the whole board is seen."""
    laser: RelativePath | None = None
    """Picture of the same pose with the stripe on the board; may be `board` itself."""
    off: RelativePath | None = None
    """Picture of the same pose and exposure as `laser`, but without the stripe; may be `board`."""
    place: str | None = None
    """Name of the place at which the board stood."""

    @model_validator(mode="after")
    def _off_goes_with_laser(self) -> Self:
        if self.off is not None and self.laser is None:
            raise ValueError("off: expected a picture with the laser in `laser` beside it")
        if self.off is not None and self.off == self.laser:
            raise ValueError("off: expected another picture than that with the laser")
        return self


class BoardCamera(Document):
    """The pictures of one camera, all of one size."""

    id: Annotated[int, Field(ge=1, le=64)]
    head: Annotated[int, Field(ge=1, le=64)] | None = None
    """Cameras of one head see one laser plane; default: the usual head of cameras 1 to 8."""
    pictures: Annotated[list[BoardPicture], Field(min_length=3, max_length=1000)]

    @property
    def on_head(self) -> int | None:
        """The head, None if unknown."""
        return self.head if self.head is not None else USUAL_HEADS.get(self.id)


class Chessboard(Document):
    """The content of chessboard.yaml."""

    format: Literal["footscan.chessboard/1"]
    squares: Annotated[tuple[Squares, Squares], AfterValidator(_turns_visibly)]
    """Along and down, the outer squares included; one number is even and the other odd."""
    square_mm: Annotated[float, Field(ge=1, le=200)]
    """Side of a square, measured over many."""
    place_sd_mm: Annotated[float, Field(ge=0, le=10)] = 0.2
    """Standard deviation of the corners of a placed board from where they should be."""
    glass: GlassPlate | None = None
    """Cameras below it look through it; None if there is none between any camera and the boards."""
    places: Annotated[dict[str, BoardPlace], Field(min_length=1, max_length=100)]
    cameras: Annotated[list[BoardCamera], Field(min_length=1)]

    @model_validator(mode="after")
    def _refers(self) -> Self:
        ids = [camera.id for camera in self.cameras]
        for camera in self.cameras:
            if ids.count(camera.id) > 1:
                raise ValueError(f"camera {camera.id} is listed twice, expected each id once")
            named = [picture.place for picture in camera.pictures if picture.place is not None]
            if unknown := [place for place in named if place not in self.places]:
                known = ", ".join(self.places)
                raise ValueError(f"camera {camera.id}: place: expected one of {known}, found {unknown[0]!r}")
            if not named:
                raise ValueError(f"camera {camera.id}: expected at least one picture with a place, found none")
            if not any(picture.laser for picture in camera.pictures):
                raise ValueError(f"camera {camera.id}: expected pictures with a laser, found none")
        return self

    @property
    def diagonal_mm(self) -> float:
        """Distance of the first inner corner from the last."""
        return self.square_mm * hypot(self.squares[0] - 2, self.squares[1] - 2)

"""Pictures of a chessboard: reading a folder of them and checking it against its chessboard.yaml."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from footscan.frames.image import Rgb, decode_image, image_size, refused_image
from footscan.recordings.scans import recorded_folder
from schemas.base.errors import RefusedInput
from schemas.base.image_size import SMALLEST_FRAME, ImageSize
from schemas.base.limits import read_bounded
from schemas.base.paths import inside
from schemas.base.yaml_files import read_yaml
from schemas.chessboard import BoardCamera, BoardPicture, Chessboard

BOARD_FILE = "chessboard.yaml"


@dataclass(frozen=True)
class Pictures:
    """The pictures of one pose. The same file is the same array."""

    picture: BoardPicture
    board: Rgb
    laser: Rgb | None
    off: Rgb | None


@dataclass(frozen=True)
class RecordedChessboard:
    """A folder of pictures that follows its format; no path in chessboard.yaml may leave it."""

    folder: Path
    document: Chessboard

    @property
    def file(self) -> Path:
        """The chessboard.yaml."""
        return self.folder / BOARD_FILE

    @property
    def files(self) -> list[Path]:
        """All files that are read."""
        return [self.file, *dict.fromkeys(path for camera in self.document.cameras for path in self._paths(camera))]

    def size(self, camera: BoardCamera) -> ImageSize:
        """The size of all pictures of a camera.

        Raises
        ------
        RefusedInput
            A picture is missing, is none, is too small, or differs in size.
        """
        expected: ImageSize | None = None
        for path in dict.fromkeys(self._paths(camera)):
            try:
                size = image_size(read_bounded(path, "image_bytes"))
            except OSError as error:
                raise RefusedInput(path, error.strerror or "cannot be read", field=f"camera {camera.id}") from None
            except ValueError as error:
                raise refused_image(path, error) from None
            if size.rows < SMALLEST_FRAME.rows or size.columns < SMALLEST_FRAME.columns:
                problem = f"expected a picture of at least {SMALLEST_FRAME} pixels, found {size}"
                raise RefusedInput(path, problem, field=f"camera {camera.id}")
            if expected is not None and size != expected:
                problem = f"expected {expected} pixels as in the first picture of the camera, found {size}"
                raise RefusedInput(path, problem, field=f"camera {camera.id}")
            expected = size
        assert expected is not None
        return expected

    def pictures(self, camera: BoardCamera) -> Iterator[Pictures]:
        """The pictures of a camera, pose by pose; RefusedInput if one is torn."""
        for number, picture in enumerate(camera.pictures):
            named = dict(self._named(camera, number, picture))
            pixels = {path: _pixels(path) for path in dict.fromkeys(named.values())}
            laser, off = (pixels[named[name]] if name in named else None for name in ("laser", "off"))
            yield Pictures(picture, pixels[named["board"]], laser, off)

    def _paths(self, camera: BoardCamera) -> list[Path]:
        return [
            path for number, picture in enumerate(camera.pictures) for _, path in self._named(camera, number, picture)
        ]

    def _named(self, camera: BoardCamera, number: int, picture: BoardPicture) -> list[tuple[str, Path]]:
        """The files of a pose by their fields."""
        fields = [("board", picture.board), ("laser", picture.laser), ("off", picture.off)]
        where = f"camera {camera.id}: pictures.{number}"
        return [
            (name, inside(self.folder, self.file, path, f"{where}.{name}")) for name, path in fields if path is not None
        ]


def read_chessboard(folder: Path) -> RecordedChessboard:
    """The pictures of a chessboard in `folder`.

    Raises
    ------
    RefusedInput
        The chessboard.yaml is missing or breaks its format, or a path leaves the folder.
    """
    folder = recorded_folder(folder, BOARD_FILE, "pictures of a chessboard")
    recorded = RecordedChessboard(folder, read_yaml(folder / BOARD_FILE, Chessboard))
    assert recorded.files
    return recorded


def _pixels(path: Path) -> Rgb:
    try:
        return decode_image(read_bounded(path, "image_bytes"))
    except ValueError as error:
        raise refused_image(path, error) from None

"""Calibration from pictures of a chessboard, as a job."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from footscan.calibration.chessboard.camera_fit import Glass
from footscan.calibration.chessboard.corners import Board
from footscan.calibration.chessboard.from_pictures import BoardCalibration, calibrate_camera
from footscan.calibration.chessboard.pinhole import Pose, UndeterminedPinholeError
from footscan.calibration.chessboard.planes import HeadPlane, head_planes, laser_planes
from footscan.calibration.chessboard.views import BoardShot, usable_views
from pipelines.engine.files.digest import sha256
from pipelines.recordings.chessboards import Pictures, RecordedChessboard
from pipelines.version import SOFTWARE
from schemas.base.errors import RefusedInput
from schemas.base.limits import read_bounded
from schemas.calibration import Calibration, Source
from schemas.chessboard import BoardCamera, BoardPlace

LARGE_MM = 0.1
"""Held-out error from which a camera is reported: three times that of a camera with nothing before its lens. Chosen by
hand."""


@dataclass(frozen=True)
class ChessboardCalibration:
    """The calibration, and what was found on the way."""

    calibration: Calibration
    cameras: list[BoardCalibration]
    planes: dict[int, HeadPlane]
    """By head; empty if the heads or the standard deviations are not known."""


def calibrate_chessboard(
    recorded: RecordedChessboard, progress: Callable[[int, int], None] | None = None
) -> ChessboardCalibration:
    """Calibrate all cameras from pictures of a chessboard.

    `progress` is called with the number of cameras done and in total.

    Raises
    ------
    RefusedInput
        A picture is missing or broken, or the pictures do not determine a camera or its laser plane.
    """
    document = recorded.document
    board = Board(document.squares, document.square_mm)
    glass = None if document.glass is None else Glass(document.glass.thickness_mm, document.glass.index)
    places = {name: _pose(place) for name, place in document.places.items()}
    sizes = [recorded.size(camera).px for camera in document.cameras]  # all refused before any is searched
    made: list[BoardCalibration] = []
    warnings: list[str] = []
    for number, (camera, image_px) in enumerate(zip(document.cameras, sizes, strict=True)):
        shots = (_shot(pictures, places) for pictures in recorded.pictures(camera))
        try:
            views, remarks = usable_views(shots, board, image_px)
        except UndeterminedPinholeError as undetermined:
            raise RefusedInput(recorded.file, str(undetermined), field=f"camera {camera.id}") from None
        made.append(calibrate_camera(camera.id, views, image_px, glass, str(recorded.file)))
        warnings += remarks + _doubts(made[-1])
        if progress is not None:
            progress(number + 1, len(document.cameras))
    heads = _heads(document.cameras)
    warnings += [
        f"camera {camera.id}: its head is not known, expected `head` beside `id`: no laser plane is written"
        for camera in document.cameras
        if camera.on_head is None
    ]
    planes = head_planes(made, heads, document.place_sd_mm, document.diagonal_mm) if heads else {}
    along = laser_planes(planes, heads)
    calibration = Calibration(
        sources=[_source(recorded)],
        software=SOFTWARE,
        cameras=[one.camera.model_copy(update={"plane": along.get(one.camera.camera)}) for one in made],
        warnings=warnings,
    )
    return ChessboardCalibration(calibration, made, planes)


def _heads(cameras: list[BoardCamera]) -> dict[int, int]:
    """The head of each camera; empty if that of one is not known."""
    heads = {camera.id: head for camera in cameras if (head := camera.on_head) is not None}
    return heads if len(heads) == len(cameras) else {}


def _pose(place: BoardPlace) -> Pose:
    """From the board's frame to the scanner's; the given directions are made exact."""
    along, down = np.array(place.along), np.array(place.down)
    along /= np.linalg.norm(along)
    down -= (down @ along) * along
    down /= np.linalg.norm(down)
    return Pose(np.stack([along, down, np.cross(along, down)], axis=1), np.array(place.first_mm))


def _shot(pictures: Pictures, places: dict[str, Pose]) -> BoardShot:
    picture = pictures.picture
    place = None if picture.place is None else places[picture.place]
    return BoardShot(picture.board, pictures.board, pictures.laser, pictures.off, place)


def _doubts(made: BoardCalibration) -> list[str]:
    """A line if the camera misses held-out stripes by much."""
    error = made.camera.held_out_rms_mm
    if error is None or error <= LARGE_MM:
        return []
    return [
        f"camera {made.camera.camera}: held-out error {error:.2f} mm, expected {LARGE_MM:g} mm at most: glass before "
        "the camera, a board that is not flat, or pictures of one pose between which the board moved"
    ]


def _source(recorded: RecordedChessboard) -> Source:
    """The folder, by the digest of the digests of its files."""
    digests = "".join(sha256(read_bounded(file, "image_bytes")) for file in recorded.files)
    return Source(name=recorded.file.name, sha256=sha256(digests.encode()))

"""Records the pictures of a chessboard by the virtual scanner's cameras, and `chessboard.yaml`."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.chessboard.picture import BoardCameraman
from footscan.virtual.chessboard.poses import held_poses, in_view
from footscan.virtual.chessboard.printed_board import PrintedBoard
from footscan.virtual.filming.record import CAMERAS, write_yaml
from footscan.virtual.optics.glass import REFRACTIVE_INDEX, THICKNESS_MM
from footscan.virtual.optics.scanner import standard_scanner
from schemas.chessboard import Chessboard
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

SQUARES, SQUARE_MM, MARGIN_MM = (10, 7), 9.0, 6.0
"""Of the standard board: 102 x 75 mm of paper, which every camera sees whole. Chosen by hand."""
PLACED_MIDDLE_MM = (0.0, 0.0, 50.0)
"""Where the middle of the board's inner corners stands when it is placed upright across the travel."""
BOARD_FILE = "chessboard.yaml"


class HeadTurn(NamedTuple):
    """Where the frame of the heads, with the laser plane at X = 0, lies in the scanner's frame."""

    rotation: Floats
    """(3, 3): vectors of the heads' frame to the scanner's."""
    origin: Floats
    """(3,) mm, scanner frame."""


def record_chessboard(
    folder: Path,
    *,
    settings: SimulationSettings,
    cameras: Sequence[int] = CAMERAS,
    held: int = 16,
    with_laser: int = 10,
    turns: Mapping[int, HeadTurn] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Take pictures of the standard board with each camera, and write `chessboard.yaml` last.

    Each camera sees the board `held` times by hand, of these `with_laser` times with and without the laser, and once
    placed upright in the plane X = 0, its face to the front or to the back, whichever the camera sees.

    Parameters
    ----------
    folder : gets a folder of JPEG files for each camera; created if missing.
    turns : by camera; default: the frame of the heads is that of the scanner.
    progress : called with the number of poses done and in total.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / BOARD_FILE).unlink(missing_ok=True)
    scanner = standard_scanner(settings.scanner_seed, settings.distortion)
    listed = []
    for done, camera_id in enumerate(cameras):
        cameraman = BoardCameraman(scanner, camera_id, settings)
        turn = (turns or {}).get(camera_id, HeadTurn(np.eye(3), np.zeros(3)))
        place = next(name for name, board in _places().items() if in_view(_in_heads(board, turn), cameraman.camera))
        boards = held_poses(_placed("front"), cameraman.camera, scanner.lasers, held, settings.seed)
        boards.append(_in_heads(_placed(place), turn))
        (folder / f"cam{camera_id}").mkdir(exist_ok=True)
        pictures: list[dict[str, Any]] = []
        for number, board in enumerate(boards):
            picture = {"board": f"cam{camera_id}/{number:02d}.jpg"}
            (folder / picture["board"]).write_bytes(cameraman.jpeg(board, number, laser=False))
            if number < with_laser:
                picture["laser"], picture["off"] = f"cam{camera_id}/{number:02d}-laser.jpg", picture["board"]
                (folder / picture["laser"]).write_bytes(cameraman.jpeg(board, number, laser=True))
            if number == held:
                picture["place"] = place
            pictures.append(picture)
            if progress is not None:
                progress(done * len(boards) + number + 1, len(cameras) * len(boards))
        listed.append({"id": camera_id, "pictures": pictures})
    document = {
        "format": "footscan.chessboard/1",
        "squares": list(SQUARES),
        "square_mm": SQUARE_MM,
        "glass": {"thickness_mm": THICKNESS_MM, "index": REFRACTIVE_INDEX},
        "places": {name: _as_document(board) for name, board in _places().items()},
        "cameras": listed,
    }
    Chessboard.model_validate(document)
    write_yaml(folder / BOARD_FILE, document)


def _places() -> dict[str, PrintedBoard]:
    return {name: _placed(name) for name in ("front", "back")}


def _placed(name: str) -> PrintedBoard:
    """The board upright in the plane X = 0, its face to +X (front) or to -X (back)."""
    along = np.array([0.0, 1.0 if name == "front" else -1.0, 0.0])
    down = np.array([0.0, 0.0, -1.0])
    axes = np.stack([along, down, np.cross(along, down)])
    half = SQUARE_MM * (np.array(SQUARES) - 2.0) / 2.0
    return PrintedBoard(SQUARES, SQUARE_MM, MARGIN_MM, np.array(PLACED_MIDDLE_MM) - half @ axes[:2], axes)


def _in_heads(board: PrintedBoard, turn: HeadTurn) -> PrintedBoard:
    """A board that is given in the scanner's frame, in that of the heads."""
    return board.moved((board.origin - turn.origin) @ turn.rotation, board.axes @ turn.rotation)


def _as_document(board: PrintedBoard) -> dict[str, list[float]]:
    first, along, down = ([round(float(value), 6) + 0.0 for value in row] for row in (board.origin, *board.axes[:2]))
    return {"first_mm": first, "along": along, "down": down}

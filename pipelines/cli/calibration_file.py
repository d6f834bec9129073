"""What the commands do with the calibration that they made."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.cli.output import message

if TYPE_CHECKING:
    from schemas.calibration import Calibration


def write_calibration(calibration: "Calibration", out: Path | None) -> None:
    """Writes the file, dated, where one was asked for."""
    from pipelines.engine.atomic import write_atomically

    if out is not None:
        dated = calibration.model_copy(update={"created": datetime.now(UTC).replace(microsecond=0)})
        write_atomically(out, (dated.model_dump_json(indent=2) + "\n").encode())


def tell_calibration(calibration: "Calibration", out: Path | None) -> None:
    """What became of it, after the tables."""
    if out is None:
        message("nothing was written; --out FILE writes the calibration")
    else:
        message(f"{out}: calibration of {len(calibration.cameras)} cameras")

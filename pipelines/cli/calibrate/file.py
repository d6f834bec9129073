"""Output of the commands on a calibration, and writing of its file."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.cli.terminal.output import message, note, print_table

if TYPE_CHECKING:
    from schemas.calibration import Calibration, PairAgreement


def write_calibration(calibration: "Calibration", out: Path | None) -> None:
    """Write the file with its date, if one was requested."""
    from pipelines.engine.files.atomic import write_atomically

    if out is not None:
        dated = calibration.model_copy(update={"created": datetime.now(UTC).replace(microsecond=0)})
        write_atomically(out, (dated.model_dump_json(indent=2) + "\n").encode())


def tell_calibration(calibration: "Calibration", out: Path | None) -> None:
    """Print whether and where the calibration was written."""
    if out is None:
        message("nothing was written; --out FILE writes the calibration")
    else:
        count = len(calibration.cameras)
        note(f"{out}: calibration of {count} camera{'s' * (count != 1)}")


def print_pairs(pairs: "list[PairAgreement]") -> None:
    """Print how far apart two cameras place the edges that both see."""
    from schemas.calibration import view_name

    rows = [
        [" and ".join(map(view_name, pair.cameras)), str(pair.places), f"{pair.rms_mm:.3f}", f"{pair.worst_mm:.3f}"]
        for pair in pairs
    ]
    if rows:
        print_table("The same edges seen by two cameras", ["cameras", "places", "apart rms mm", "worst mm"], rows)

"""Feet on the command line: measures.json, the results folder of a scan, or that of a patient."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.terminal.output import message
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from schemas.feet import Foot
    from schemas.sizes import People

FEET = "measures.json, or the folder of a scan's results"
PATIENT = "RESULTS/<patient> alone"
MEASURES_FILE = "measures.json"

TableFile = Annotated[
    Path | None,
    typer.Option(
        "--table", help="Table of sizes, widths and lasts; default: the built-in one (see sizes --show-table)."
    ),
]
ForPeople = Annotated[
    Literal["all", "men", "women", "children"], typer.Option("--for", help="Group of wearers whose sizes are listed.")
]
AnyPatient = Annotated[bool, typer.Option("--any-patient", help="Accept feet of two patients.")]


def read_feet(places: Sequence[Path], any_patient: bool) -> "list[Foot]":
    """The feet of one person; of whomever with `any_patient`.

    Raises
    ------
    RefusedInput
        One is missing, belongs to another patient, or is given twice.
    """
    from footscan.sizing.identity import refuse_other_patient

    feet = [read_foot(place) for place in places]
    files = [_measures_file(place).resolve() for place in places]
    for index, place in enumerate(places):
        if files[index] in files[:index]:
            raise RefusedInput(place, "is given twice, expected another measurement")
    for other in [] if any_patient else feet[1:]:
        try:
            refuse_other_patient(feet[0], other)
        except RefusedInput as error:
            raise RefusedInput(error.source, f"{error.problem} (--any-patient takes it all the same)") from None
    return feet


def is_patient(place: Path) -> bool:
    """True for the results folder of a patient, RESULTS/<patient>, with one folder per scan."""
    return not _measures_file(place).exists() and bool(_scans(place))


def read_patient(folder: Path) -> "list[Foot]":
    """The feet of all scans of a patient, sorted by scan name."""
    return [read_foot(scan) for scan in _scans(folder)]


def read_latest_pair(folder: Path) -> "list[Foot]":
    """The left and right foot of a patient from the latest day with both."""
    from footscan.sizing.sittings import latest_pair

    feet = read_patient(folder)
    pair = list(latest_pair(str(folder), feet))
    tell_passed_over(folder, feet, pair)
    return pair


def tell_passed_over(folder: Path, feet: "Sequence[Foot]", taken: "Sequence[Foot]") -> None:
    """Print the scans that were not used although they are not older."""
    from footscan.sizing.sittings import feet_left_out

    if names := ", ".join(foot.scan or foot.source for foot in feet_left_out(feet, taken)):
        message(one_line(f"{folder}: not taken: {names}"))


def read_foot(place: Path) -> "Foot":
    """The foot of a measures.json, or of the folder that holds one.

    Its patient and scan are those of the folders that it lies in, RESULTS/<patient>/<scan>/measures.json.

    Raises
    ------
    RefusedInput
        No such file, or not as measures are.
    """
    from schemas.base.json_files import read_json
    from schemas.feet import Foot

    file = _measures_file(place)
    if is_patient(place):
        names = ", ".join(scan.name for scan in _scans(place))
        raise RefusedInput(place, f"is the folder of a patient, expected one of its scans: {names}")
    foot = read_json(file, Foot)
    origin = {"source": str(place)}
    if file.name == MEASURES_FILE:
        folder = file.resolve().parent
        origin |= {"patient": foot.patient or folder.parent.name, "scan": foot.scan or folder.name}
    return foot.model_copy(update=origin)


def _measures_file(place: Path) -> Path:
    return place / MEASURES_FILE if place.is_dir() else place


def _scans(folder: Path) -> list[Path]:
    return sorted(file.parent for file in folder.glob(f"*/{MEASURES_FILE}"))


def chosen(people: Literal["all", "men", "women", "children"]) -> "People | None":
    """The group of wearers; None for all."""
    return None if people == "all" else people

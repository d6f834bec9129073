"""`footscan pair` and `footscan change`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.foot.feet import (
    FEET,
    PATIENT,
    AnyPatient,
    ForPeople,
    TableFile,
    chosen,
    is_patient,
    read_feet,
    read_latest_pair,
    read_patient,
    tell_passed_over,
)
from pipelines.cli.foot.sizes import print_notes, print_sizes
from pipelines.cli.terminal.output import AsJson, figure, print_json, print_line, print_table
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from schemas.feet import Foot
    from schemas.pairs import Change, Pair, Sighting


def pair(
    left: Annotated[
        Path, typer.Argument(help=f"The left foot: {FEET}. {PATIENT}: both feet of the latest day that has both.")
    ],
    right: Annotated[Path | None, typer.Argument(help="The right foot.")] = None,
    any_patient: AnyPatient = False,
    people: ForPeople = "all",
    table: TableFile = None,
    as_json: AsJson = False,
) -> None:
    """Compare both feet of a person, and print sizes for both; the longer and the wider foot decide."""
    from footscan.sizing.pairs import compare_pair
    from footscan.sizing.table import read_table

    if right is None:
        _expect_patient(left, "RIGHT")
        feet = read_latest_pair(left)
    else:
        feet = read_feet([left, right], any_patient)
    found = compare_pair(feet[0], feet[1], read_table(table), chosen(people))
    if as_json:
        print_json(found.model_dump(mode="json"))
    else:
        _print_pair(found)


def change(
    earlier: Annotated[
        Path, typer.Argument(help=f"A foot: {FEET}. {PATIENT}: each foot on the last two days that it was scanned.")
    ],
    later: Annotated[Path | None, typer.Argument(help="The same foot at a later time.")] = None,
    any_patient: AnyPatient = False,
    table: TableFile = None,
    as_json: AsJson = False,
) -> None:
    """Compare one foot at two times: which changes exceed the repeatability."""
    from footscan.sizing.change import change_over_time
    from footscan.sizing.table import read_table

    rules = read_table(table)
    if later is None:
        _expect_patient(earlier, "LATER")
        found = [change_over_time(before, after, rules) for before, after in _read_changes(earlier)]
        document: Any = {"changes": [one.model_dump(mode="json") for one in found]}
    else:
        before, after = read_feet([earlier, later], any_patient)
        found = [change_over_time(before, after, rules)]
        document = found[0].model_dump(mode="json")
    if as_json:
        print_json(document)
    else:
        for one in found:
            _print_change(one)


def _expect_patient(place: Path, missing: str) -> None:
    """Refuse a single foot, because two are compared."""
    if not place.exists():
        raise RefusedInput(place, f"no such file or folder, expected {FEET}; or {PATIENT}")
    if not is_patient(place):
        raise RefusedInput(missing, f"is missing, expected {FEET}; or {PATIENT}")


def _read_changes(folder: Path) -> "list[tuple[Foot, Foot]]":
    from footscan.sizing.sittings import latest_changes

    feet = read_patient(folder)
    changes = latest_changes(str(folder), feet)
    tell_passed_over(folder, feet, [foot for pair in changes for foot in pair])
    return changes


def _print_pair(found: "Pair") -> None:
    print_table(
        f"{_name(found.left)} and {_name(found.right)}, right minus left",
        ["measure", "unit", "left", "right", "difference", "uncertainty", "larger", "usual sds"],
        [
            [
                one_line(row.measure),
                one_line(row.unit),
                *(figure(value, ".2f") for value in (row.left, row.right)),
                figure(row.difference, "+.2f"),
                figure(row.uncertainty, ".2f"),
                row.larger or "-",
                figure(row.usual_sds, ".1f"),
            ]
            for row in found.rows
        ],
    )
    print_notes((row.measure, row.note) for row in found.rows)
    sides = ", ".join(f"{measure} by the {side} foot" for measure, side in found.decided_by.items() if side)
    print_sizes("Sizes for both" + (f": {sides}" if sides else ""), found.sizes)
    for note in found.notes:
        print_line(one_line(note))


def _print_change(found: "Change") -> None:
    days = "" if found.days is None else f", {found.days} days"
    print_table(
        f"{_name(found.earlier)} to {_name(found.later)}{days}",
        ["measure", "unit", "earlier", "later", "change", "uncertainty", "chance up to", "real"],
        [
            [
                one_line(row.measure),
                one_line(row.unit),
                *(figure(value, ".2f") for value in (row.earlier, row.later)),
                figure(row.difference, "+.2f"),
                figure(row.uncertainty, ".2f"),
                figure(row.limit, ".2f"),
                {True: "yes", False: "no", None: "-"}[row.significant],
            ]
            for row in found.rows
        ],
    )
    print_notes((row.measure, row.note) for row in found.rows)
    for note in found.notes:
        print_line(one_line(note))


def _name(sighting: "Sighting") -> str:
    known = sighting.patient and sighting.scan
    return one_line(f"{sighting.patient}/{sighting.scan}" if known else sighting.source)

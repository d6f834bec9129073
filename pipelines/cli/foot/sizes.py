"""`footscan sizes`."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.foot.feet import FEET, ForPeople, TableFile, chosen, read_foot
from pipelines.cli.terminal.output import AsJson, figure, print_json, print_line, print_table, print_text
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from schemas.sizes import Sizes


def sizes(
    foot: Annotated[Path | None, typer.Argument(help=FEET)] = None,
    people: ForPeople = "all",
    table: TableFile = None,
    show_table: Annotated[
        bool, typer.Option("--show-table", help="Print the table of sizes, as a start for your own --table.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print shoe sizes and widths of a foot, unrounded and rounded. For reference only."""
    from footscan.sizing.identity import sighting
    from footscan.sizing.sizes import foot_sizes
    from footscan.sizing.table import TABLE, read_table
    from schemas.base.json_files import read_text

    rules = read_table(table)
    if show_table:
        if as_json:
            print_json(rules.model_dump(mode="json"))
        else:
            print_text(read_text(table or TABLE, "yaml_bytes"))
        return
    if foot is None:
        raise RefusedInput("FOOT", f"is missing, expected {FEET}")
    measured = read_foot(foot)
    found = foot_sizes(measured, rules, chosen(people))
    if as_json:
        print_json({"foot": sighting(measured).model_dump(mode="json"), **found.model_dump(mode="json")})
    else:
        print_sizes(f"{measured.name}, side {measured.side}", found)


def print_sizes(title: str, found: "Sizes") -> None:
    """Print the tables of sizes and widths, and notes below them."""
    measures = ", ".join(f"{name} {figure(value, '.1f')}" for name, value in found.measures_mm.items())
    print_table(
        f"{one_line(title)}; mm: {measures}",
        ["sizes", "size", "unrounded", "rounding", "decided by", "figures"],
        [
            [
                one.label,
                one.size or "-",
                figure(one.unrounded, ".2f"),
                one.rounding,
                one.decided_by or "-",
                one.confidence,
            ]
            for one in found.sizes
        ],
    )
    if found.widths:
        print_table(
            "",
            ["widths", "width", "unrounded", "by", "standard", "figures"],
            [
                [
                    one.label,
                    one.width or "-",
                    "-" if one.steps is None else f"{one.middle} {one.steps:+.2f} steps",
                    one.measure,
                    one.standard or "",
                    one.confidence,
                ]
                for one in found.widths
            ],
        )
    print_notes((one.label, one.note) for one in found.sizes)
    print_notes((one.label, one.note) for one in found.widths)
    print_line(f"Sizes and widths are {found.caution}.")


def print_notes(notes: Iterable[tuple[str, str | None]]) -> None:
    """One line per note, with the entries that it applies to."""
    of: dict[str, list[str]] = {}
    for label, note in notes:
        if note:
            of.setdefault(note, []).append(label)
    for note, labels in of.items():
        print_line(one_line(f"{', '.join(labels)}: {note}"))

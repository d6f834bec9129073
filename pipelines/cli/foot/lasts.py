"""`footscan lasts`."""

from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.foot.feet import FEET, PATIENT, AnyPatient, TableFile, is_patient, read_feet, read_latest_pair
from pipelines.cli.terminal.output import AsJson, figure, print_json, print_line, print_table
from schemas.base.errors import one_line

if TYPE_CHECKING:
    from schemas.lasts import Deviation, LastFit, RankedLast, Ranking


def lasts(
    feet: Annotated[
        list[Path],
        typer.Argument(
            help=f"One foot or both of a person: {FEET}. {PATIENT}: both of the latest day that has both.",
            metavar="FOOT",
        ),
    ],
    folder: Annotated[Path, typer.Option("--lasts", help="CSV file with one last per row, or a folder of such files.")],
    purpose: Annotated[str, typer.Option(help="Purpose of the shoe: everyday, dress or comfort.")] = "everyday",
    most: Annotated[int, typer.Option(min=1, help="Number of lasts to print; the JSON has all.")] = 10,
    any_patient: AnyPatient = False,
    table: TableFile = None,
    as_json: AsJson = False,
) -> None:
    """Rank lasts for a foot or a pair by length and girths, with the deviations in mm."""
    from footscan.sizing.last_files import read_lasts
    from footscan.sizing.lasts import rank_lasts
    from footscan.sizing.table import read_table

    is_all = len(feet) == 1 and is_patient(feet[0])
    measured = read_latest_pair(feet[0]) if is_all else read_feet(feet, any_patient)
    ranking = rank_lasts(measured, read_lasts(folder), read_table(table).lasts, purpose)
    if as_json:
        print_json(ranking.model_dump(mode="json"))
    else:
        _print(ranking, " and ".join(foot.name for foot in measured), most)


def _print(ranking: "Ranking", feet: str, most: int) -> None:
    from footscan.sizing.last_files import MEASURES

    fitting = [last for last in ranking.lasts if last.rank is not None]
    names = [name for name in MEASURES if any(name in fit.deviations for last in fitting for fit in last.feet.values())]
    rows = [
        [
            *_heading(last, side),
            figure(fit.score, ".1f"),
            *(_cell(fit.deviations.get(name)) for name in names),
            *_form(fit),
        ]
        for last in islice(fitting, most)
        for side, fit in last.feet.items()
    ]
    title = f"Lasts for {feet}, {ranking.purpose}; last minus foot, mm; * is beyond what is allowed"
    measures = [name.replace("_", " ") for name in names]
    print_table(one_line(title), ["rank", "last", "foot", "score", *measures, "heel", "spring"], rows)
    out = [last for last in ranking.lasts if last.rank is None]
    print_line(f"{len(fitting)} of {len(ranking.lasts)} lasts can be worn; out: {len(out)}")
    for last in out[:most]:
        reasons = "; ".join(f"{side} {reason}" for side, fit in last.feet.items() for reason in fit.rejected)
        print_line(one_line(f"{last.name}: {reasons}"))
    if len(out) > most:
        print_line(f"and {len(out) - most} more")
    for missing in ranking.missing:
        print_line(one_line(f"not compared: {missing}"))


def _heading(last: "RankedLast", side: str) -> list[str]:
    """Rows of the table; of a pair only the first of two rows has the name of the last."""
    is_first = side == next(iter(last.feet))
    foot = f"{side}, mirrored" if last.feet[side].mirrored else side
    return [str(last.rank) if is_first else "", one_line(last.name) if is_first else "", foot]


def _cell(deviation: "Deviation | None") -> str:
    return "-" if deviation is None else f"{deviation.difference:+.1f}{'*' if deviation.outside else ''}"


def _form(fit: "LastFit") -> list[str]:
    return ["" if height is None else f"{height:g}" for height in (fit.last.heel_height_mm, fit.last.toe_spring_mm)]

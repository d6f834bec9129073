"""`footscan regress`."""

import getpass
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.terminal.output import AsJson, keep_inputs, note, print_json, print_line, print_table
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from pipelines.engine.pool import OnStepEnd
    from pipelines.regression.night import Night
    from pipelines.regression.report.result import JudgedFigure, JudgedSet
    from schemas.regression import Acceptance

SUITE = Path("regression/suite.yaml")


def regress(
    suite: Annotated[Path | None, typer.Argument(help=f"The suite; default: {SUITE}.", metavar="[SUITE]")] = None,
    accept: Annotated[
        str | None,
        typer.Option("--accept", metavar="REASON", help="Accept the results as the new baseline, for this reason."),
    ] = None,
    accepted_by: Annotated[
        str | None, typer.Option("--by", help="Name of the person who accepts; default: your login name.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for films, cache, history and page; default: that of the suite.")
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="JUnit XML file to write.")] = None,
    check_last: Annotated[
        str | None, typer.Option(metavar="AGE", help="Only check that a night has ended within AGE, for example 26h.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Run a suite of scans and compare every figure with the accepted one.

    Exit status: 0 all is the same or better; 1 something is worse, missing or was not run; 2 refused input; 3 fault.
    """
    from pipelines.regression.night import read_suite, run_night

    regression = read_suite(suite or SUITE, out)
    if check_last is not None:
        if accept is not None or junit is not None:
            raise RefusedInput("--check-last", "runs nothing, expected it without --accept and --junit")
        return _check(regression.out, check_last, as_json=as_json)
    if accepted_by is not None and accept is None:
        raise RefusedInput("--by", "goes with --accept")
    acceptance = None if accept is None else _acceptance(accept, accepted_by)
    keep_inputs([junit], regression.path, regression.baseline)
    with _progress() as on_step_end:
        night = run_night(regression, on_step_end, _tell, acceptance, _tell_world)
    if junit is not None:
        from pipelines.engine.files.atomic import write_atomically
        from pipelines.regression.report.junit import junit_xml

        write_atomically(junit, junit_xml(night.result))
    if as_json:
        print_json(_json(night))
    else:
        _show(night)
    return night.status


def _check(out: Path, age: str, *, as_json: bool) -> int:
    from pipelines.regression.check import age_of, check_last

    is_fresh, said = check_last(out, age_of(age))
    if as_json:
        print_json({"fresh": is_fresh, "told": said})
    else:
        print_line(one_line(said))
    return 0 if is_fresh else 1


def _acceptance(reason: str, accepted_by: str | None) -> "Acceptance":
    from pipelines.version import SOFTWARE
    from schemas.base.json_files import validate
    from schemas.regression import Acceptance

    if not reason.strip():
        raise RefusedInput("--accept", "expected why the new figures are right, found nothing")
    values = {
        "reason": reason,
        "date": datetime.now(UTC).replace(microsecond=0).isoformat(),
        "by": accepted_by or _login(),
        "software": SOFTWARE,
    }
    return validate("--accept", Acceptance, values)


def _login() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # a container may have no name for its user
        return "unknown"


@contextmanager
def _progress() -> "Iterator[OnStepEnd]":
    from pipelines.cli.terminal.progress import StepProgress

    with StepProgress(None) as progress:
        yield progress.on_step_end


def _tell(one: "JudgedSet") -> None:
    """Print a line for each set as it ends."""
    from pipelines.regression.report.result import VERDICTS

    counts = ", ".join(f"{one.count(verdict)} {verdict}" for verdict in VERDICTS if one.count(verdict))
    note(f"{one.name}: {counts or 'no figures'}" + (f"; {one_line(one.problem)}" if one.problem else ""))


def _tell_world(done: int, total: int) -> None:
    """Print a line for every tenth of the worlds."""
    if done * 10 // total > (done - 1) * 10 // total:
        note(f"worlds: {done} of {total}")


def _show(night: "Night") -> None:
    """Print a table of all figures that differ, the first steps that differ, and the path of the page."""
    rows = [
        [one.name, figure.name, _cell(figure.value), _cell(figure.accepted), f"{figure.allowed:.4g}", figure.verdict]
        for one in night.result.sets
        for figure in one.figures
        if figure.verdict not in ({"same"} if night.result.count("same") else {"same", "new"})
    ]
    if rows:
        print_table("", ["set", "figure", "last night", "accepted", "tolerance", "verdict"], rows)
    for one in night.result.sets:
        for first in one.first:
            changes = "; ".join(one_line(change.text) for change in first.changes)
            print_line(
                f"{one.name}: first {', '.join(first.steps)}: {first.why}" + (f" ({changes})" if changes else "")
            )
    print_line(f"Report: {night.page}")


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _json(night: "Night") -> dict[str, Any]:
    return {
        "status": night.status,
        "page": str(night.page),
        "sets": [
            {
                "set": one.name,
                "problem": one.problem,
                "first": [
                    {"steps": list(first.steps), "why": first.why, "changes": [change.text for change in first.changes]}
                    for first in one.first
                ],
                "steps_otherwise": one.changed_steps,
                "figures": [_figure_json(figure) for figure in one.figures],
            }
            for one in night.result.sets
        ],
    }


def _figure_json(figure: "JudgedFigure") -> dict[str, Any]:
    names = ("name", "value", "accepted", "allowed", "better", "truth", "verdict")
    return {name: getattr(figure, name) for name in names}

"""`footscan init`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.archive.selecting import WORKFLOW
from pipelines.cli.terminal.output import message, note, print_line
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.init.survey import Survey

SHOWN = 5
"""Scans whose names are printed, so that one sees what a pattern made of the paths."""


def init(
    archive: Annotated[Path, typer.Argument(help="Folder with scans or films, at any depth.")],
    out: Annotated[Path, typer.Option(help="The workflow to write.")] = WORKFLOW,
    results: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("results"),
    films: Annotated[
        str | None,
        typer.Option(
            metavar="PATTERN",
            help="Paths of films without scan.yaml, for example '{patient}/{date}_{side}/cam{camera}.avi'; fields: "
            "patient, scan, side, date, camera; * for the rest. Writes a scan.yaml for each scan.",
        ),
    ] = None,
    backgrounds: Annotated[
        str | None, typer.Option(metavar="PATTERN", help="Where films with the laser off are, likewise.")
    ] = None,
    step_mm: Annotated[
        float | None, typer.Option(min=1e-6, max=1000, help="Travel from one frame to the next, with --films.")
    ] = None,
    start_mm: Annotated[float, typer.Option(min=-1e5, max=1e5, help="X of the first frame, with --films.")] = 0.0,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration of scans that name none; default: the first that is found.")
    ] = None,
) -> int:
    """Write a commented workflow.yaml for an archive, and scan.yaml for films that have none."""
    from pipelines.engine.files.atomic import write_atomically
    from pipelines.init.survey import survey
    from pipelines.init.template import workflow_text

    if not archive.is_dir():
        raise RefusedInput(archive, "no such folder, expected one with scans or films")
    if out.exists():
        raise RefusedInput(out, "is there already, expected another name with --out")
    if films is None and (backgrounds is not None or step_mm is not None):
        raise RefusedInput("--films", "is missing, expected the pattern of the films")
    if films is not None:
        _describe_films(archive.resolve(), films, backgrounds, step_mm, start_mm)
    found = survey(archive, out.resolve().parent)
    if not found.scans and not found.problems:
        raise RefusedInput(archive, "holds no scan.yaml, expected --films with the pattern of the films' paths")
    calibrations = [calibration.resolve()] if calibration is not None else found.calibrations
    base = out.resolve().parent
    named = [Path(os.path.relpath(file, base)).as_posix() for file in calibrations]
    text = workflow_text(
        Path(os.path.relpath(archive.resolve(), base)).as_posix(),
        named,
        Path(os.path.relpath(results.resolve(), base)).as_posix(),
        is_needed=found.with_calibration < found.scans,
    )
    write_atomically(out, text.encode())
    for problem in found.problems:
        message(f"footscan: {problem}")
    _print(found, out, named)
    return 1 if found.problems else 0


def _describe_films(archive: Path, films: str, backgrounds: str | None, step_mm: float | None, start_mm: float) -> None:
    """Write scan.yaml for films without one."""
    from pipelines.init.film_names import FilmPattern, find_scans, write_scans
    from schemas.scan import Travel

    pattern = FilmPattern(films, "--films")
    dark = None if backgrounds is None else FilmPattern(backgrounds, "--backgrounds")
    if step_mm is None:
        raise RefusedInput("--step-mm", "is missing, expected the travel from one frame to the next, in mm")
    scans = find_scans(archive, pattern, dark)
    written = write_scans(archive, scans, Travel(start_mm=start_mm, step_mm=step_mm))
    for scan in scans[:SHOWN]:
        note(f"{scan.patient}/{scan.scan}: {len(scan.films)} films, such as {next(iter(scan.films.values()))}")
    if scans[SHOWN:]:
        note(f"and {len(scans) - SHOWN} more")
    note(f"{archive}: {len(written)} scan.yaml written, {len(scans) - len(written)} were there")


def _print(found: "Survey", out: Path, calibrations: list[str]) -> None:
    days = "" if found.first is None else f", from {found.first} to {found.last}"
    scans, patients = (
        f"{found.scans} scan{'s' * (found.scans != 1)}",
        f"{found.patients} patient{'s' * (found.patients != 1)}",
    )
    print_line(f"{out}: {scans} of {patients}, up to {found.cameras} cameras{days}")
    if found.with_calibration < found.scans:
        missing = found.scans - found.with_calibration
        if not calibrations:
            message(f"{missing} scans name no calibration and none was found: name one in {out}")
        elif len(calibrations) > 1:
            message(f"{missing} scans name no calibration: {out} takes {calibrations[0]} of {len(calibrations)} found")
    print_line("next: footscan plan --summary, then footscan run")

"""`footscan forget`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.leases import TakeOver, lease_in_words, take_over_leases
from pipelines.cli.archive.selecting import WORKFLOW
from pipelines.cli.terminal.output import AsJson, message, print_json, print_line
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from pipelines.forget.forget import Erasure

OUT_OF_REACH = (
    "copies elsewhere: exports, reports that were sent, backups, snapshots, other stores, other machines",
    "equal films and results that belong to another scan as well",
    "documents of your own, such as notes; suites and logs that are not named with --suite and --log",
    "blocks that the disk has freed but not overwritten",
)


def forget(
    patient: Annotated[str, typer.Argument(help="Pseudonym of the patient to erase.")],
    scan: Annotated[str | None, typer.Option("--scan", help="Erase this scan only.")] = None,
    workflow: Annotated[Path | None, typer.Option(help="The workflow; default: workflow.yaml.")] = None,
    suite: Annotated[
        list[Path] | None, typer.Option(help="Regression suite that uses scans of the patient; may be repeated.")
    ] = None,
    log: Annotated[
        list[Path] | None, typer.Option(help="Log file outside the workflow's folders; may be repeated.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for confirmation.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List what would be erased, without erasing it.")] = False,
    take_over: TakeOver = False,
    as_json: AsJson = False,
) -> int:
    """Erase a patient or one scan: films, frames, results, entries of tables, and the store's data that only they need.

    What was erased is searched for afterwards. It cannot be undone.
    """
    from pipelines.archive.job import job_of_workflow
    from pipelines.forget.forget import erase, find_erasure
    from pipelines.forget.subject import Subject
    from pipelines.regression.night import read_suite

    subject = Subject(patient, scan)
    job = job_of_workflow(workflow or WORKFLOW, may_be_empty=True)
    found = find_erasure(subject, job, [read_suite(one) for one in suite or ()], log or ())
    if found.is_empty:
        raise RefusedInput(
            subject.name, "is not known in archive, results or store, expected a patient or a scan there"
        )
    if not as_json or not (yes or dry_run):
        _print_found(found)
    live = []
    if not dry_run:
        _confirm(subject.name, yes)
        if take_over:
            take_over_leases(found.store)
        live = erase(found)
    is_done = not dry_run and not live and not found.remains
    if as_json:
        print_json(_as_json(found, is_done=is_done, dry_run=dry_run))
    elif is_done:
        print_line(f"{subject.name}: erased; neither the name nor a digest is found in archive, results and store")
    for one in live:
        message(f"footscan: {lease_in_words(one)}; nothing is erased while it is")
    for place in found.remains:
        message(one_line(f"footscan: {place}: still bears {subject.name}, or is a copy of theirs: erase it by hand"))
    if not as_json:
        for words in (*found.belongings.out_of_reach, *OUT_OF_REACH):
            print_line(f"out of reach: {words}")
    return 1 if live or found.remains else 0


def _confirm(name: str, yes: bool) -> None:
    if yes:
        return
    if not sys.stdin.isatty():
        raise RefusedInput("--yes", "is missing, expected it where nobody can be asked")
    message(f"This cannot be undone. Type {name} to erase it:")
    if sys.stdin.readline().strip() != name:
        raise RefusedInput(name, "was not confirmed; nothing was erased")


def _print_found(found: "Erasure") -> None:
    if found.was_interrupted:
        message(f"footscan: the erasure of {found.subject.name} was cut off, and goes on")
    for place in (*found.belongings.folders, *found.texts):
        print_line(str(place))
    for nights in found.nights:
        print_line(f"{nights.regression.out}: nights of {', '.join(nights.sets)}, and the store of all nights")
    store = found.store.files.path("").rstrip("/")
    print_line(f"{store}: {len(found.shares.names)} files; of {len(found.scans)} scans")


def _as_json(found: "Erasure", *, is_done: bool, dry_run: bool) -> dict[str, Any]:
    return {
        "subject": found.subject.name,
        "scans": found.scans,
        "folders": [str(place) for place in found.belongings.folders],
        "documents": [str(place) for place in found.texts],
        "nights": {str(one.regression.path): one.sets for one in found.nights},
        "store": found.store.files.path("").rstrip("/"),
        "store_files": len(found.shares.names),
        "dry_run": dry_run,
        "erased": is_done,
        "remains": found.remains,
        "out_of_reach": [*found.belongings.out_of_reach, *OUT_OF_REACH],
    }

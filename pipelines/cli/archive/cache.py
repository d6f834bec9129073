"""`footscan cache`: what lies in the store, what of it can go, and whether it is sound."""

import time
from collections.abc import Collection, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.leases import TakeOver, lease_in_words, lease_json, take_over_leases
from pipelines.cli.archive.selecting import WORKFLOW, WorkflowFile
from pipelines.cli.archive.why import plan_of_scan
from pipelines.cli.terminal.output import AsJson, message, print_json, print_line, print_table
from schemas.base.errors import Fault, RefusedInput, one_line

if TYPE_CHECKING:
    from pipelines.engine.audit import Difference
    from pipelines.engine.garbage_collection import Contents, Garbage
    from pipelines.engine.store.store import Store

cache = typer.Typer(help="Inspect, verify and clean the store of results.", no_args_is_help=True)

HOUR_S = 3600.0

Place = Annotated[str | None, typer.Option("--cache", help="Result store (folder or URL), instead of a workflow.")]
OfWorkflow = Annotated[Path | None, typer.Option("--workflow", help="The workflow; default: workflow.yaml.")]
ScanName = Annotated[str, typer.Argument(help="Folder of a scan, or patient/scan.")]
OlderThan = Annotated[float, typer.Option(min=0, help="Smallest age in hours of what is deleted.")]


@cache.command("stats")
def stats(workflow: WorkflowFile = None, place: Place = None, as_json: AsJson = False) -> None:
    """Show the content of the store by kind of step, and what gc would free."""
    from pipelines.engine.garbage_collection import read_contents
    from pipelines.engine.store.pins import read_pins

    store = _store(workflow, place)
    contents = read_contents(store)
    garbage, _ = _garbage(contents, store, workflow, place, 24.0)
    pinned = list(read_pins(store))
    if as_json:
        print_json(
            {
                "store": _place(store),
                **_shares_json(contents, contents.sizes),
                "pins": pinned,
                "gc": _garbage_json(contents, garbage),
            }
        )
        return
    _print_shares(_place(store), contents, contents.sizes)
    if pinned:
        print_line(f"pinned: {', '.join(pinned)}")
    print_line(f"gc would free {_sum(contents, garbage.names)}")


@cache.command("gc")
def gc(
    workflow: WorkflowFile = None,
    place: Place = None,
    delete: Annotated[bool, typer.Option("--delete", help="Delete what is listed.")] = False,
    older_than: OlderThan = 24.0,
    take_over: TakeOver = False,
    as_json: AsJson = False,
) -> int:
    """List results that no last action of a step and no pin needs; with --delete, delete them.

    Nothing is deleted while a run is under way.
    """
    from pipelines.engine import garbage_collection as collect
    from pipelines.engine.store.lease import live_leases

    store = _store(workflow, place)
    taken_over = take_over_leases(store) if take_over else []
    contents = collect.read_contents(store)
    garbage, vanished = _garbage(contents, store, workflow, place, older_than)
    if not as_json:
        if vanished:
            print_line(f"gone from the archive: {', '.join(vanished)}")
        if garbage.names:
            _print_shares(f"{_place(store)}: what would go", contents, garbage.names)
        print_line(f"to go: {_sum(contents, garbage.names)}; too young to go: {_sum(contents, garbage.young)}")
    deleted: list[str] = []
    if delete:
        deleted, live = collect.delete(garbage, store)
    else:
        live = live_leases(store)
    if as_json:
        facts = {
            "deleted": len(deleted),
            "deleted_bytes": _bytes(contents, deleted),
            "vanished": vanished,
            "runs": [lease_json(one) for one in live],
            "taken_over": [lease_json(one) for one in taken_over],
        }
        print_json({"store": _place(store), **_garbage_json(contents, garbage), **facts})
    elif delete:
        print_line(f"deleted: {_sum(contents, deleted)}")
    elif garbage.names:
        print_line("nothing was deleted: --delete does it")
    for one in live:
        message(f"footscan: {lease_in_words(one)}; nothing is deleted while it is")
    return 1 if delete and live else 0


@cache.command("verify")
def verify(
    workflow: WorkflowFile = None,
    place: Place = None,
    recompute: Annotated[
        str | None, typer.Option(help="Share of the actions to compute again and compare, for example 5%.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the sample.")] = 0,
    as_json: AsJson = False,
) -> int:
    """Check every file of the store against its digest or seal, and remove damaged ones."""
    from pipelines.cli.terminal.progress import frame_progress
    from pipelines.engine import audit

    share = None if recompute is None else _share(recompute)
    if share is not None and place is not None:
        raise RefusedInput("--recompute", "needs the workflow that says what the steps are, not --cache")
    store = _store(workflow, place)
    with frame_progress("checking") as progress:
        read = audit.verify(store, progress)
    facts: dict[str, Any] = {"store": _place(store), "files": read.files, "damaged": read.damaged}
    if not as_json:
        print_line(f"{_place(store)}: {read.files} files read, {len(read.damaged)} damaged")
    failed = bool(read.damaged)
    if share is not None:
        count, differences, problems = _recompute(workflow or WORKFLOW, share, seed)
        facts |= {
            "recomputed": count,
            "differences": [{"step": one.step, "recorded": one.recorded, "found": one.found} for one in differences],
            "problems": problems,
        }
        if not as_json:
            print_line(f"{count} action{'s' * (count != 1)} done again, {len(differences)} came to something else")
        for one in differences:
            message(f"footscan: {one.step}: NOT REPRODUCED: recorded {one.recorded}, now {one.found}")
        for problem in problems:
            message(f"footscan: {problem}")
        failed = failed or bool(differences or problems)
    if as_json:
        print_json(facts)
    return int(failed)


@cache.command("seal")
def seal(
    workflow: WorkflowFile = None,
    place: Place = None,
    every: Annotated[
        bool,
        typer.Option(
            "--all", help="Also seal rows that were written without a seal since; only if all of them are yours."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Seal the rows of a store with a secret of yours, so that nobody else can add valid ones.

    The first time, what lies in the store is sealed; from then on, a row without the seal counts as missing.
    """
    from pipelines.engine.audit import seal_store
    from pipelines.engine.files.secret import secret_file

    sealing = seal_store(_store(workflow, place), every=every)
    store = _store(workflow, place)
    facts = {"store": _place(store), "secret": str(secret_file(store.files.place)), **vars(sealing)}
    if as_json:
        print_json(facts)
        return
    print_line(f"{_place(store)}: {sealing.sealed} rows sealed, {sealing.unsealed} without the seal")
    print_line(f"secret: {facts['secret']}")


@cache.command("pin")
def pin(scan: ScanName, workflow: OfWorkflow = None, place: Place = None, as_json: AsJson = False) -> None:
    """Protect the present results of a scan from gc."""
    from pipelines.engine.store import pins

    store, name = _store(workflow, place), _scan_name(scan)
    steps = pins.pin(name, store)
    if as_json:
        print_json({"store": _place(store), "scan": name, "steps": steps})
    else:
        print_line(f"{name}: the results of {steps} steps are kept")


@cache.command("unpin")
def unpin(scan: ScanName, workflow: OfWorkflow = None, place: Place = None, as_json: AsJson = False) -> None:
    """End the protection of the results of a scan."""
    from pipelines.engine.store import pins

    store, name = _store(workflow, place), _scan_name(scan)
    pins.unpin(name, store)
    if as_json:
        print_json({"store": _place(store), "scan": name})
    else:
        print_line(f"{name}: kept no longer than other results")


def open_place(place: Path | str, group: int | None = None) -> "Store":
    """Open the store at a place without an index of what was verified; RefusedInput if there is none."""
    from pipelines.engine.store.permissions import warn_if_others_can_write
    from pipelines.engine.store.store import open_store

    store = open_store(place)
    if store.folder is not None and not store.folder.is_dir():
        raise RefusedInput(store.folder, "no such folder, expected the store of a run")
    warn_if_others_can_write(store, group)
    return store


def _store(workflow: Path | None, place: str | None) -> "Store":
    from pipelines.archive.job import job_of_workflow
    from pipelines.engine.files.access import share

    if place is None:
        job = job_of_workflow(workflow or WORKFLOW, may_be_empty=True)
        share([job.cache] if isinstance(job.cache, Path) and job.cache.is_dir() else [], job.group)
        return open_place(job.cache, job.group)
    if workflow is not None:
        raise RefusedInput(workflow, "a workflow and --cache exclude each other, expected one of them")
    return open_place(place)


def _garbage(
    contents: "Contents", store: "Store", workflow: Path | None, place: str | None, older_than: float
) -> "tuple[Garbage, list[str]]":
    """What of a store can go, and the scans that are no more; a workflow's present results, and what they came from,
    stay."""
    from pipelines.archive.job import CACHE, job_of_workflow
    from pipelines.archive.planning import plan_job
    from pipelines.archive.vanished import vanished_scans
    from pipelines.engine.audit import repeatable
    from pipelines.engine.garbage_collection import find_garbage

    keys: set[str] = set()
    delivered: set[str] = set()
    vanished: list[str] = []
    if place is None:
        job = job_of_workflow(workflow or WORKFLOW, may_be_empty=True)
        planned = plan_job(job)
        for scan in planned.scans:
            keys |= repeatable(plan_of_scan(scan, planned), store).keys()
        vanished = vanished_scans(contents.actions, {scan.scan.name for scan in planned.scans}, job.archives)
        delivered = _delivered(job.results, store.secret, vanished)
    elif Path(place).name == CACHE:
        delivered = _delivered(Path(place).resolve().parent, store.secret)
    times = {"now": time.time(), "older_than_s": older_than * HOUR_S}
    found = find_garbage(contents, store, keys=keys, delivered=delivered, vanished=vanished, **times)
    return found, vanished


def _delivered(results: Path, secret: bytes | None, without: Collection[str] = ()) -> set[str]:
    """Digests of the delivered files in a folder of results, except those of some scans."""
    from pipelines.archive.job import CACHE
    from pipelines.engine.files.file_digests import FileDigests
    from pipelines.scan import DELIVERABLE

    digests = FileDigests.load(results / CACHE / "files.json", secret)
    files = (file for name in DELIVERABLE for file in results.glob(f"*/*/{name}") if file.is_file())
    return {digests.of(file)[0] for file in files if "/".join(file.parts[-3:-1]) not in without}


def _place(store: "Store") -> str:
    return store.files.path("").rstrip("/")


def _scan_name(scan: str) -> str:
    """`patient/scan` of a scan that is named so, or by its folder."""
    from footscan.recordings.scans import SCAN_FILE, read_scan

    folder = Path(scan)
    return read_scan(folder).name if (folder / SCAN_FILE).is_file() else scan


def _share(text: str) -> float:
    number, sign, rest = text.strip().partition("%")  # which must be there: 0.5 might be half of them, or 0.5%
    try:
        share = float(number) / 100 if sign and not rest else 0.0
    except ValueError:
        share = 0.0
    if not 0 < share <= 1:
        raise RefusedInput("--recompute", f"expected a share above 0% and at most 100%, such as 5%, found {text!r}")
    return share


def _recompute(workflow: Path, share: float, seed: int) -> "tuple[int, list[Difference], list[str]]":
    """Repeat a sample of the actions of a workflow; returns their number, the differences and the failures."""
    from pipelines.archive.job import job_of_workflow
    from pipelines.archive.planning import plan_job
    from pipelines.engine import audit

    planned = plan_job(job_of_workflow(workflow))
    store = planned.workspace.store
    chosen = audit.sample(
        (key for scan in planned.scans for key in audit.repeatable(plan_of_scan(scan, planned), store)),
        share,
        seed,
    )
    done: set[str] = set()
    differences: list[Difference] = []
    problems: list[str] = []

    with ThreadPoolExecutor(planned.job.threads) as pool:
        for scan in planned.scans:  # one at a time: the graphs of all would be too much
            actions = audit.repeatable(plan_of_scan(scan, planned), store)
            mine = {key: action for key, action in actions.items() if key in chosen - done}
            done |= mine.keys()
            for ended in [pool.submit(audit.repeat, action, store) for action in mine.values()]:
                try:
                    difference = ended.result()
                except Fault as error:
                    problems.append(str(error))
                    continue
                except Exception as error:  # a defect in one step must not hide what becomes of the others
                    problems.append(one_line(f"{scan.scan.name}: {type(error).__name__}: {error}"))
                    continue
                if difference is not None:
                    differences.append(difference)
    return len(done), differences, problems


def _bytes(contents: "Contents", names: Iterable[str]) -> int:
    return sum(contents.sizes[name] for name in names)


def _sum(contents: "Contents", names: Iterable[str]) -> str:
    names = list(names)
    return f"{len(names)} file{'s' * (len(names) != 1)}, {_mb(_bytes(contents, names))} MB"


def _mb(size: int) -> str:
    return f"{size / 1e6:.2f}"


def _print_shares(title: str, contents: "Contents", names: Iterable[str]) -> None:
    shares = contents.shares(names)
    rows = [[kind, str(one.actions), str(one.results), _mb(one.bytes)] for kind, one in shares.items()]
    every = shares.values()
    total = [sum(one.actions for one in every), sum(one.results for one in every)]
    rows.append(["all", *map(str, total), _mb(sum(one.bytes for one in every))])
    print_table(title, ["step", "actions", "results", "MB"], rows)


def _shares_json(contents: "Contents", names: Iterable[str]) -> dict[str, Any]:
    shares = contents.shares(names)
    return {
        "actions": sum(one.actions for one in shares.values()),
        "blobs": sum(one.results for one in shares.values()),
        "bytes": sum(one.bytes for one in shares.values()),
        "kinds": {kind: vars(one) for kind, one in shares.items()},
    }


def _garbage_json(contents: "Contents", garbage: "Garbage") -> dict[str, Any]:
    return {
        "files": len(garbage.names),
        "bytes": _bytes(contents, garbage.names),
        "young_files": len(garbage.young),
        "young_bytes": _bytes(contents, garbage.young),
    }

"""Erase a patient or a scan from archives, results and store, and search for remains."""

import shutil
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.archive.job import Job
from pipelines.archive.planning import workspace_of
from pipelines.engine.files.packs import in_batches
from pipelines.engine.store.erasure_notes import FOLDER, note_name
from pipelines.engine.store.lease import Lease, lease, live_leases
from pipelines.engine.store.store import Store
from pipelines.engine.workspace import Workspace
from pipelines.forget.nights import Nights, erase_nights, find_nights
from pipelines.forget.proof import find_remains
from pipelines.forget.shares import Shares, find_shares
from pipelines.forget.subject import Belongings, Subject, find_belongings
from pipelines.forget.tables import erase_from_text, rewrite_tables, texts_that_name
from pipelines.regression.night import Regression
from pipelines.scan import DELIVERABLE
from schemas.base.errors import Fault
from schemas.base.json_files import parse_json
from schemas.base.model import canonical_json

CHECK_EVERY = 50
"""Number of files that are erased between two checks for new runs; chosen by hand."""


@dataclass
class Erasure:
    """The data to be erased, or that were erased."""

    subject: Subject
    job: Job
    workspace: Workspace
    belongings: Belongings
    shares: Shares
    texts: list[Path]
    nights: list[Nights]
    was_interrupted: bool
    remains: list[str] = field(default_factory=list)
    """Places where data of the subject were found after the erasure."""

    @property
    def store(self) -> Store:
        """The store of the workflow."""
        return self.workspace.store

    @property
    def is_empty(self) -> bool:
        """True if no data of the subject were erasure."""
        has_any = self.belongings.folders or self.belongings.scans or self.shares.scans or self.texts or self.nights
        return not (has_any or self.was_interrupted)

    @property
    def scans(self) -> list[str]:
        """Names of the scans that were erasure."""
        return sorted(self.belongings.scans | self.shares.scans)


def find_erasure(
    subject: Subject, job: Job, suites: Collection[Regression] = (), logs: Collection[Path] = ()
) -> Erasure:
    """Find all data that would be erased; nothing is changed.

    Parameters
    ----------
    suites : collection of Regression
        Regression suites that may run scans of the subject.
    logs : collection of Path
        Log files in other folders than those of results and store.

    Raises
    ------
    RefusedInput
        A folder of the subject is a link, or a log is missing.
    """
    workspace = workspace_of(job)
    store = workspace.store
    belongings = find_belongings(subject, job.archives, job.results)
    belongings.out_of_reach += [
        f"{archive.url} is not erased from, only what was fetched of it: erase {subject.name} there by hand"
        for archive in job.fetched
    ]
    files = (file for name in DELIVERABLE for file in job.results.glob(f"*/*/{name}") if file.is_file())
    delivered = {workspace.digests.of(file)[0] for file in files if not subject.has("/".join(file.parts[-3:-1]))}
    shares = find_shares(subject, store, delivered)
    was_interrupted = store.files.state(note_name(subject.name)) is not None
    if was_interrupted:
        name = note_name(subject.name)
        note = parse_json(store.files.path(name), store.files.read(name).decode())
        belongings.digests |= set(note["digests"])
        belongings.sizes |= set(note["sizes"])
    texts = texts_that_name(subject, [job.results, *([workspace.local] if workspace.local.is_dir() else [])], logs)
    nights = find_nights(subject, suites, belongings.folders)
    return Erasure(subject, job, workspace, belongings, shares, texts, nights, was_interrupted)


def erase(erasure: Erasure) -> list[Lease]:
    """Erase the data and search for remains. Stops if runs are under way, and returns their leases.

    A note in the store marks the erasure as begun and is removed last. After an interruption a
    repetition finishes the erasure.

    Raises
    ------
    Fault
        A file cannot be removed; the files before it are erased.
    """
    if live := live_leases(erasure.store):
        return live
    with lease(erasure.store) as own_lease:
        folders = erasure.belongings.folders
        note = {"digests": sorted(erasure.belongings.digests), "sizes": sorted(erasure.belongings.sizes)}
        erasure.store.files.write(note_name(erasure.subject.name), canonical_json(note).encode())
        for place in folders:
            _remove(place)
        _remove_empty_parents(erasure)
        rewrite_tables(erasure.subject, erasure.job.archives, erasure.job.results)
        for text in erasure.texts:
            if text.exists():
                erase_from_text(erasure.subject, text)
        for nights in erasure.nights:
            erase_nights(nights)
        if live := _erase_from_store(erasure, own_lease):
            return live
        _clear_folders(erasure, "pins")
        erasure.remains = _remains(erasure)
        if not erasure.remains:
            erasure.store.files.remove(note_name(erasure.subject.name))
            _clear_folders(erasure, FOLDER)
    return []


def _erase_from_store(erasure: Erasure, own_lease: str) -> list[Lease]:
    for names in in_batches(erasure.shares.names, CHECK_EVERY):
        if live := [run for run in live_leases(erasure.store) if run.name != own_lease]:
            return live
        erasure.store.files.remove_all(names)
    if erasure.store.verified is not None:
        erasure.store.verified.keep_only(erasure.shares.kept_keys)
    roots = [place.absolute() for place in erasure.belongings.folders]
    erasure.workspace.digests.forget(
        lambda path, digest: (
            any(Path(path).is_relative_to(root) for root in roots)
            or digest in erasure.belongings.digests
            or erasure.subject.pattern.search(path.encode()) is not None
        )
    )
    return []


def _remains(erasure: Erasure) -> list[str]:
    belongings, erased = erasure.belongings, erasure.shares.digests
    folders = [*erasure.job.archives, erasure.job.results, *(nights.regression.out for nights in erasure.nights)]
    digests = belongings.digests | erased
    places = find_remains(erasure.subject, digests, folders, erasure.store, belongings.sizes, erased)
    suites = [f"{nights.regression.path}: sets {', '.join(nights.sets)}" for nights in erasure.nights]
    return [*(place for place in places if f"/{FOLDER}/" not in place), *suites]


def _remove(place: Path) -> None:
    problems: list[str] = []

    def on_error(_: Callable[..., object], path: str, error: tuple[object, ...]) -> None:
        problems.append(f"{path}: cannot be removed ({error[1]})")

    try:
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place, onerror=on_error)
        else:
            place.unlink(missing_ok=True)
    except OSError as error:
        problems.append(f"{place}: cannot be removed ({error.strerror})")
    if problems:
        raise Fault(problems[0])


def _remove_empty_parents(erasure: Erasure) -> None:
    for root in (*erasure.job.archives, erasure.job.results):
        with suppress(OSError):  # not empty: other scans are in it
            (root / erasure.subject.patient).rmdir()


def _clear_folders(erasure: Erasure, kind: str) -> None:
    """Remove folders of pins or notes in the store that are empty, since their names hold the patient's."""
    if (store := erasure.store.folder) is not None:
        for folder in (f"{kind}/{erasure.subject.patient}", kind):
            with suppress(OSError):
                (store / folder).rmdir()

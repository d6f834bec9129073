"""Erasing a patient, or a scan, from archives, results and store, and proving it."""

import shutil
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.archive.job import Job, workspace_of
from pipelines.engine.files.places import LocalFiles
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
from pipelines.scan import DELIVERED
from schemas.base.errors import Fault
from schemas.base.json_files import parse_json
from schemas.base.model import canonical_json

CHECK_EVERY = 50
"""Files that are erased between two looks for runs that have begun meanwhile."""


@dataclass
class Erasure:
    """What is to be erased, or was."""

    subject: Subject
    job: Job
    workspace: Workspace
    belongings: Belongings
    shares: Shares
    texts: list[Path]
    nights: list[Nights]
    was_cut_off: bool
    remains: list[str] = field(default_factory=list)
    """Where something was found after all."""

    @property
    def store(self) -> Store:
        """The store of the workflow."""
        return self.workspace.store

    @property
    def is_empty(self) -> bool:
        """Whether nothing of the subject is known."""
        named = self.belongings.folders or self.belongings.scans or self.shares.scans or self.texts or self.nights
        return not (named or self.was_cut_off)

    @property
    def scans(self) -> list[str]:
        """The scans that were found."""
        return sorted(self.belongings.scans | self.shares.scans)


def find_erasure(
    subject: Subject, job: Job, suites: Collection[Regression] = (), logs: Collection[Path] = ()
) -> Erasure:
    """All that would be erased; nothing is changed.

    Parameters
    ----------
    suites : collection of Regression
        Suites that may run scans of the subject.
    logs : collection of Path
        Logs that lie neither beside the results nor beside the store.

    Raises
    ------
    RefusedInput
        A folder of this name is a link, or a log is not there.
    """
    workspace = workspace_of(job)
    store = workspace.store
    belongings = find_belongings(subject, job.archives, job.results)
    files = (file for name in DELIVERED for file in job.results.glob(f"*/*/{name}") if file.is_file())
    delivered = {workspace.digests.of(file)[0] for file in files if not subject.has("/".join(file.parts[-3:-1]))}
    shares = find_shares(subject, store, delivered)
    was_cut_off = store.files.state(note_name(subject.name)) is not None
    if was_cut_off:
        name = note_name(subject.name)
        known = parse_json(store.files.path(name), store.files.read(name).decode())
        belongings.digests |= set(known["digests"])
        belongings.sizes |= set(known["sizes"])
    texts = texts_that_name(subject, [job.results, *([workspace.local] if workspace.local.is_dir() else [])], logs)
    nights = find_nights(subject, suites, belongings.folders)
    return Erasure(subject, job, workspace, belongings, shares, texts, nights, was_cut_off)


def erase(found: Erasure) -> list[Lease]:
    """Erase it, and look for what remains; returns the runs under way, which stop it.

    A note in the store says that it has begun, and is removed last. Whatever cuts it off, the same again finishes it.

    Raises
    ------
    Fault
        A file cannot be removed; all that comes before is erased.
    """
    if live := live_leases(found.store):
        return live
    with lease(found.store) as own:
        folders = found.belongings.folders
        known = {"digests": sorted(found.belongings.digests), "sizes": sorted(found.belongings.sizes)}
        found.store.files.write(note_name(found.subject.name), canonical_json(known).encode())
        for place in folders:
            _remove(place)
        _remove_empty_parents(found)
        rewrite_tables(found.subject, found.job.archives, found.job.results)
        for text in found.texts:
            if text.exists():
                erase_from_text(found.subject, text)
        for nights in found.nights:
            erase_nights(nights)
        if live := _erase_from_store(found, own):
            return live
        _clear_folders(found, "pins")
        found.remains = _remains(found)
        if not found.remains:
            found.store.files.remove(note_name(found.subject.name))
            _clear_folders(found, FOLDER)
    return []


def _erase_from_store(found: Erasure, own: str) -> list[Lease]:
    for number, name in enumerate(found.shares.names):
        if number % CHECK_EVERY == 0 and (live := [one for one in live_leases(found.store) if one.name != own]):
            return live
        found.store.files.remove(name)
    if found.store.verified is not None:
        found.store.verified.keep_only(found.shares.kept_keys)
    roots = [place.absolute() for place in found.belongings.folders]
    found.workspace.digests.forget(
        lambda path, digest: (
            any(Path(path).is_relative_to(root) for root in roots)
            or digest in found.belongings.digests
            or found.subject.pattern.search(path.encode()) is not None
        )
    )
    return []


def _remains(found: Erasure) -> list[str]:
    folders = [*found.job.archives, found.job.results, *(one.regression.out for one in found.nights)]
    digests = found.belongings.digests | found.shares.digests
    places = find_remains(found.subject, digests, folders, found.store, found.belongings.sizes, found.shares.digests)
    suites = [f"{one.regression.path}: sets {', '.join(one.sets)}" for one in found.nights]
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


def _remove_empty_parents(found: Erasure) -> None:
    for root in (*found.job.archives, found.job.results):
        with suppress(OSError):  # other scans are there
            (root / found.subject.patient).rmdir()


def _clear_folders(found: Erasure, kind: str) -> None:
    """Empty folders in the store that bear the name, of pins or of notes."""
    if isinstance(found.store.files, LocalFiles):
        for folder in (f"{kind}/{found.subject.patient}", kind):
            with suppress(OSError):
                Path(found.store.files.path(folder)).rmdir()

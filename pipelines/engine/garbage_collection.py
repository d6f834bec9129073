"""The contents of a store, and the garbage collection of files that are no longer needed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from pipelines.engine.explain import code_of, inputs_of, kind_of
from pipelines.engine.files.names import blob_digest, blob_name, latest_name, row_key, row_name
from pipelines.engine.files.packs import FOLDER as PACKS
from pipelines.engine.files.packs import PACKED, in_batches
from pipelines.engine.store.lease import FOLDER as LEASES
from pipelines.engine.store.lease import Lease, live_leases
from pipelines.engine.store.pins import read_pins
from pipelines.engine.store.store import Store
from pipelines.engine.trace import Actions, read_actions

FOLDERS = (*PACKED, "blobs", "pins", PACKS, LEASES)
"""Folders of a store."""
CODE, VALUES, OTHER = "(code)", "(values)", "(other)"
"""Kinds of blobs that are not the result of a step."""
CHECK_EVERY = 50
"""Number of files that are deleted between two checks for new runs; chosen by hand."""


@dataclass
class Share:
    """Share of one kind of step in a store."""

    actions: int = 0
    results: int = 0
    """Number of blobs; equal results are one blob."""
    bytes: int = 0
    """Size of the results and rows."""


@dataclass(frozen=True)
class Contents:
    """The files of a store, with the actions that they record."""

    sizes: dict[str, int]
    """Bytes of each file, by name."""
    actions: Actions
    owners: dict[str, str]
    """For each blob by its digest: the kind of step whose result it is, or `(code)` or `(values)`."""

    def shares(self, names: Iterable[str]) -> dict[str, Share]:
        """Count the files of these names by kind of step."""
        shares: dict[str, Share] = {}
        for name in names:
            key, digest = row_key(name), blob_digest(name)
            kind = OTHER
            if key in self.actions.rows:
                kind = kind_of(self.actions.rows[key].image)
            elif digest is not None:
                kind = self.owners.get(digest, OTHER)
            share = shares.setdefault(kind, Share())
            share.actions += key is not None
            share.results += digest is not None
            share.bytes += self.sizes[name]
        return dict(sorted(shares.items()))


@dataclass(frozen=True)
class Garbage:
    """Files of a store that are no longer needed."""

    names: list[str] = field(default_factory=list)
    """Names of the files to delete, rows first: if interrupted, a row must not be left without its result."""
    young: list[str] = field(default_factory=list)
    """Names of files that are not needed, but too young to delete."""


def read_contents(store: Store) -> Contents:
    """Read all rows of a store and list its files."""
    sizes = {name: size for name, size in store.files.sizes("") if name.split("/")[0] in FOLDERS or _is_partial(name)}
    actions = read_actions(store)
    owners: dict[str, str] = {}
    for key in sorted(actions.rows):
        row = actions.rows[key]
        if row.digest is not None:
            owners.setdefault(row.digest, kind_of(row.image))
    for digest in _inputs(actions, actions.rows, "value"):
        owners.setdefault(digest, VALUES)
    for digest in _code(actions, actions.rows, store):
        owners.setdefault(digest, CODE)
    return Contents(sizes, actions, owners)


def find_garbage(
    contents: Contents,
    store: Store,
    *,
    keys: Iterable[str] = (),
    delivered: Iterable[str] = (),
    vanished: Iterable[str] = (),
    now: float,
    older_than_s: float,
) -> Garbage:
    """Find files that no root reaches: last actions, pins, `keys` and `delivered`; also leftovers of interrupted runs.

    Parameters
    ----------
    keys : iterable of str
        Keys of further actions in use: after a return to earlier parameters these are actions of earlier runs.
    delivered : iterable of str
        Digests of the files in the results folder.
    vanished : iterable of str
        Scans (`patient/scan`) that were removed from the archive: their last actions are garbage unless pinned.
    now : float
        Present time, s since 1970.
    older_than_s : float
        Younger files are kept.

    Raises
    ------
    DamagedError
        A pin is damaged, so the actions that it keeps are unknown.
    """
    vanished_scans = set(vanished)
    orphaned = [latest for latest in contents.actions.latest if latest.step.rpartition("/")[0] in vanished_scans]
    roots = {*keys, *(latest.key for latest in contents.actions.latest if latest not in orphaned)}
    roots |= {key for pin in read_pins(store).values() for key in pin.values()}
    rows, blobs = reached(contents.actions, roots, set(delivered), store)
    kept = {row_name(key) for key in rows} | {blob_name(digest) for digest in blobs}
    orphaned_names = {latest_name(latest.step) for latest in orphaned}
    live = {lease.name for lease in live_leases(store)}
    unused = [name for name in contents.sizes if name in orphaned_names or _is_garbage(name, kept, live)]
    garbage = Garbage()
    for name in sorted(unused, key=lambda name: (row_key(name) is None, name)):
        written = store.files.written(name)
        is_old = written is not None and now - written >= older_than_s
        (garbage.names if is_old else garbage.young).append(name)
    return garbage


def delete(garbage: Garbage, store: Store) -> tuple[list[str], list[Lease]]:
    """Delete garbage; stops if a run is under way or begins. Returns the deleted names and the leases of such runs."""
    deleted: list[str] = []
    for names in in_batches(garbage.names, CHECK_EVERY):
        if live := live_leases(store):
            return deleted, live
        store.files.remove_all(names)
        deleted += names
    return deleted, []


def _is_partial(name: str) -> bool:
    """Return True for a file that `write_atomically` leaves behind when it is killed."""
    file = PurePosixPath(name)
    return (
        file.name.startswith(".") and file.suffix == ".partial" and (len(file.parts) == 1 or file.parts[0] in FOLDERS)
    )


def _is_garbage(name: str, kept: set[str], live: set[str]) -> bool:
    if _is_partial(name):
        return True
    if name.startswith(f"{LEASES}/"):
        return name.endswith(".json") and name not in live
    return (row_key(name) is not None or blob_digest(name) is not None) and name not in kept


def reached(actions: Actions, keys: set[str], delivered: set[str], store: Store) -> tuple[set[str], set[str]]:
    """Keys of the rows and digests of the blobs that these actions and files came from, themselves included."""
    pending = set(keys)
    rows: set[str] = set()
    while True:
        rows |= pending & actions.rows.keys()
        results = {actions.rows[key].digest for key in rows}
        inputs = delivered | set(_inputs(actions, rows, "result"))
        # A result that no reached action made was made by an earlier action, which belongs to its origin.
        pending = {key for digest in inputs - results for key in actions.makers.get(digest, [])}
        if not pending:
            break
    blobs = inputs | {digest for digest in results if digest is not None}
    return rows, blobs | set(_inputs(actions, rows, "value")) | set(_code(actions, rows, store))


def _inputs(actions: Actions, keys: Iterable[str], source: str) -> Iterator[str]:
    """Digests of the inputs of actions that come from one source, `value` or `result`."""
    for key in keys:
        yield from (digest for origin, digest in inputs_of(actions.rows[key].image).values() if origin == source)


def _code(actions: Actions, keys: Iterable[str], store: Store) -> Iterator[str]:
    """Digests of the code documents of actions, and of the module texts that these name."""
    images = {str(image.get("code")): image for image in (actions.rows[key].image for key in keys)}
    for document, image in images.items():
        identity = code_of(image, store)
        if identity is not None:
            yield document
            yield from identity.modules.values()

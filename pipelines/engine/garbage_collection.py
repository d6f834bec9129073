"""What lies in a store, and what of it nothing needs any more."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from pipelines.engine.explain import code_of, inputs_of, kind_of
from pipelines.engine.store.lease import FOLDER as LEASES
from pipelines.engine.store.lease import Lease, live_leases
from pipelines.engine.store.pins import read_pins
from pipelines.engine.store.store import Store, blob_name, latest_name, row_name
from pipelines.engine.trace import Actions, blob_digest, read_actions, row_key

FOLDERS = ("actions", "blobs", "latest", "pins", LEASES)
CODE, VALUES, OTHER = "(code)", "(values)", "(other)"
"""Kinds of what is the result of no step."""
CHECK_EVERY = 50
"""Files that are deleted between two looks for runs that have begun meanwhile."""


@dataclass
class Share:
    """What of a store is of one kind of step."""

    actions: int = 0
    results: int = 0
    """Equal ones lie in the store, and count, once."""
    bytes: int = 0
    """Of the results and of the actions' rows."""


@dataclass(frozen=True)
class Contents:
    """What lies in a store."""

    sizes: dict[str, int]
    """Bytes of each file, by name."""
    actions: Actions
    owners: dict[str, str]
    """Of each blob, by its digest: the kind of step whose result it is, or `(code)`, `(values)`, `(other)`."""

    def shares(self, names: Iterable[str]) -> dict[str, Share]:
        """The files of these names, by kind of step."""
        found: dict[str, Share] = {}
        for name in names:
            key, digest = row_key(name), blob_digest(name)
            kind = OTHER
            if key in self.actions.rows:
                kind = kind_of(self.actions.rows[key].image)
            elif digest is not None:
                kind = self.owners.get(digest, OTHER)
            share = found.setdefault(kind, Share())
            share.actions += key is not None
            share.results += digest is not None
            share.bytes += self.sizes[name]
        return dict(sorted(found.items()))


@dataclass(frozen=True)
class Garbage:
    """What nothing needs."""

    names: list[str] = field(default_factory=list)
    """Rows first: one without its result is a miss, a result without its row is only room that is taken."""
    young: list[str] = field(default_factory=list)
    """What would go, too, if it were older."""


def read_contents(store: Store) -> Contents:
    """Reads all rows of a store and lists its files."""
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
    """What nothing reaches: no last action of a step, no pin, none of those below; and what interrupted runs left.

    Parameters
    ----------
    keys : iterable of str
        Of other actions that are in use: who went back to earlier parameters uses those of earlier runs.
    delivered : iterable of str
        Digests of the files that lie in the results.
    vanished : iterable of str
        Scans (`patient/scan`) that are no more: what their steps did last goes, unless it is pinned.
    now : float
        s since 1970.
    older_than_s : float
        What is younger is kept.

    Raises
    ------
    DamagedError
        A pin is damaged: what it keeps is not known.
    """
    gone = set(vanished)
    left = [one for one in contents.actions.latest if one.step.rpartition("/")[0] in gone]
    roots = {*keys, *(one.key for one in contents.actions.latest if one not in left)}
    roots |= {key for pin in read_pins(store).values() for key in pin.values()}
    rows, blobs = reached(contents.actions, roots, set(delivered), store)
    kept = {row_name(key) for key in rows} | {blob_name(digest) for digest in blobs}
    left_names = {latest_name(one.step) for one in left}
    live = {one.name for one in live_leases(store)}
    unused = [name for name in contents.sizes if name in left_names or _is_garbage(name, kept, live)]
    garbage = Garbage()
    for name in sorted(unused, key=lambda name: (row_key(name) is None, name)):
        written = store.files.written(name)
        is_old = written is not None and now - written >= older_than_s
        (garbage.names if is_old else garbage.young).append(name)
    return garbage


def delete(garbage: Garbage, store: Store) -> tuple[list[str], list[Lease]]:
    """Delete garbage, unless a run is under way or begins; returns what was deleted, and the runs that stopped it."""
    deleted: list[str] = []
    for number, name in enumerate(garbage.names):
        if number % CHECK_EVERY == 0 and (live := live_leases(store)):
            return deleted, live
        store.files.remove(name)
        deleted.append(name)
    return deleted, []


def _is_partial(name: str) -> bool:
    """Whether a file is what `write_atomically` leaves behind when it is killed."""
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
    """Keys of the rows and digests of the blobs that these actions and files came from, they themselves included."""
    waiting = set(keys)
    rows: set[str] = set()
    while True:
        rows |= waiting & actions.rows.keys()
        made = {actions.rows[key].digest for key in rows}
        taken = delivered | set(_inputs(actions, rows, "result"))
        # A result of which no reached action is known is an earlier action's: that tells where all came from.
        waiting = {key for digest in taken - made for key in actions.makers.get(digest, [])}
        if not waiting:
            break
    blobs = taken | {digest for digest in made if digest is not None}
    return rows, blobs | set(_inputs(actions, rows, "value")) | set(_code(actions, rows, store))


def _inputs(actions: Actions, keys: Iterable[str], wanted: str) -> Iterator[str]:
    """Digests of the inputs of actions that are of one kind, `value` or `result`."""
    for key in keys:
        yield from (digest for source, digest in inputs_of(actions.rows[key].image).values() if source == wanted)


def _code(actions: Actions, keys: Iterable[str], store: Store) -> Iterator[str]:
    """The documents that name the code of actions, and the texts that those name."""
    images = {str(image.get("code")): image for image in (actions.rows[key].image for key in keys)}
    for document, image in images.items():
        identity = code_of(image, store)
        if identity is not None:
            yield document
            yield from identity.modules.values()

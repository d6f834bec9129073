"""The files of a store that only a subject needs, apart from those that others need as well."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from pipelines.engine.explain import code_of, inputs_of
from pipelines.engine.files.names import blob_digest, blob_name, latest_name, row_key, row_name
from pipelines.engine.garbage_collection import reached
from pipelines.engine.store.pins import FOLDER as PINS
from pipelines.engine.store.pins import read_pins
from pipelines.engine.store.store import Store
from pipelines.engine.trace import Actions, read_actions
from pipelines.forget.subject import Subject


@dataclass
class Shares:
    """Files of a store that are to be erased, and the digests that they bear."""

    names: list[str] = field(default_factory=list)
    """Names of the files. Those that name the subject come last, so that an interrupted erasure can be continued."""
    digests: set[str] = field(default_factory=set)
    kept_keys: set[str] = field(default_factory=set)
    scans: set[str] = field(default_factory=set)


def find_shares(subject: Subject, store: Store, delivered: Iterable[str]) -> Shares:
    """Find the rows and blobs that nobody else is known to need.

    A row belongs to others if their last actions, pins or results came from it, or if all films that it came from
    belong to others. All other rows are erased: rows do not hold names, and only rows may know the films of an earlier
    recording. A blob is erased with the last row that names it.

    Parameters
    ----------
    delivered : iterable of str
        Digests of the files in the results of others.

    Raises
    ------
    DamagedError
        A pin is damaged, so the actions that it keeps are unknown.
    """
    actions = read_actions(store)
    own_actions = [latest for latest in actions.latest if subject.has(latest.step.rpartition("/")[0])]
    pins = read_pins(store)
    roots = {latest.key for latest in actions.latest if latest not in own_actions}
    roots |= {key for scan, keys in pins.items() if not subject.has(scan) for key in keys.values()}
    rows, _ = reached(actions, roots, set(delivered), store)
    films = {digest for key in rows for digest in _digests(actions, key, "file")}
    origins: dict[str, set[str] | None] = {}
    for key in actions.rows:
        came_from = _origins(key, actions, origins, set())
        if came_from is not None and came_from <= films and not _names(subject, actions, key, store):
            rows.add(key)
    blobs = set(delivered)
    for key in rows:
        image = actions.rows[key].image
        blobs |= {digest for _, digest in inputs_of(image).values()} | {str(actions.rows[key].digest)}
        if (code := code_of(image, store)) is not None:
            blobs |= {str(image.get("code")), *code.modules.values()}
    kept = {row_name(key) for key in rows} | {blob_name(digest) for digest in blobs if len(digest) == 64}
    shares = Shares(kept_keys=rows)
    for name, _ in store.files.sizes(""):
        digest = row_key(name) or blob_digest(name)
        if digest is not None and name not in kept:
            shares.names.append(name)
            shares.digests.add(digest)
        elif name.rpartition("/")[2].startswith(".") and name.endswith(".partial"):
            shares.names.append(name)
    own_pins = {scan for scan in pins if subject.has(scan)}
    shares.scans = {latest.step.rpartition("/")[0] for latest in own_actions} | own_pins
    shares.names.sort(key=lambda name: (row_key(name) is None, name))
    shares.names += [f"{PINS}/{scan}.json" for scan in sorted(own_pins)]
    shares.names += [latest_name(latest.step) for latest in own_actions]
    return shares


def _digests(actions: Actions, key: str, source: str) -> list[str]:
    return [digest for kind, digest in inputs_of(actions.rows[key].image).values() if kind == source]


def _origins(key: str, actions: Actions, cache: dict[str, set[str] | None], above: set[str]) -> set[str] | None:
    """Digests of the files that an action came from; None if the origin of one of its inputs is unknown."""
    if key not in cache:
        files: set[str] | None = set(_digests(actions, key, "file"))
        for digest in _digests(actions, key, "result"):
            makers = [maker for maker in actions.makers.get(digest, []) if maker not in above]
            origins_of_makers = [_origins(maker, actions, cache, above | {key}) for maker in makers]
            known_origins = [origins for origins in origins_of_makers if origins is not None]
            files = None if files is None or not known_origins else files.union(*known_origins)
        cache[key] = files
    return cache[key]


def _names(subject: Subject, actions: Actions, key: str, store: Store) -> bool:
    """Return True if the subject's name is in a value that an action took, or in the text of its failure."""
    problem = (actions.rows[key].failure or ("", ""))[1].encode()
    values = [store.get(digest) or b"" for digest in _digests(actions, key, "value")]
    return any(_is_named(subject, text) for text in (problem, *values))


def _is_named(subject: Subject, text: bytes) -> bool:
    return subject.pattern.search(text) is not None

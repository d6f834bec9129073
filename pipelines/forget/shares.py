"""What of a store is a subject's alone, and what others need as well."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from pipelines.engine.explain import code_of, inputs_of
from pipelines.engine.garbage_collection import reached
from pipelines.engine.store.pins import FOLDER as PINS
from pipelines.engine.store.pins import read_pins
from pipelines.engine.store.store import Store, blob_name, latest_name, row_name
from pipelines.engine.trace import Actions, blob_digest, read_actions, row_key
from pipelines.forget.subject import Subject


@dataclass
class Shares:
    """Files of a store that are to be erased, and the digests that they bear."""

    names: list[str] = field(default_factory=list)
    """What names the subject comes last, so that an erasure that was cut off is gone on with."""
    digests: set[str] = field(default_factory=set)
    kept_keys: set[str] = field(default_factory=set)
    scans: set[str] = field(default_factory=set)


def find_shares(subject: Subject, store: Store, delivered: Iterable[str]) -> Shares:
    """What nobody else is known to need.

    A row is another's if another scan's last actions, a pin or a result of theirs came from it, or if all films that it
    came from are those of others. All else goes: rows do not bear names, and the films of a former recording may be
    known to nothing but the rows that they left. A blob goes with the last row that names it.

    Parameters
    ----------
    delivered : iterable of str
        Digests of the files in the results of others.

    Raises
    ------
    DamagedError
        A pin is damaged: what it keeps is not known.
    """
    actions = read_actions(store)
    mine = [one for one in actions.latest if subject.has(one.step.rpartition("/")[0])]
    pins = read_pins(store)
    roots = {one.key for one in actions.latest if one not in mine}
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
    found = Shares(kept_keys=rows)
    for name, _ in store.files.sizes(""):
        digest = row_key(name) or blob_digest(name)
        if digest is not None and name not in kept:
            found.names.append(name)
            found.digests.add(digest)
        elif name.rpartition("/")[2].startswith(".") and name.endswith(".partial"):
            found.names.append(name)
    found.scans = {one.step.rpartition("/")[0] for one in mine} | {scan for scan in pins if subject.has(scan)}
    found.names.sort(key=lambda name: (row_key(name) is None, name))
    found.names += [f"{PINS}/{scan}.json" for scan in sorted(pins) if subject.has(scan)]
    found.names += [latest_name(one.step) for one in mine]
    return found


def _digests(actions: Actions, key: str, source: str) -> list[str]:
    return [digest for kind, digest in inputs_of(actions.rows[key].image).values() if kind == source]


def _origins(key: str, actions: Actions, known: dict[str, set[str] | None], above: set[str]) -> set[str] | None:
    """Digests of the files that an action came from; None where one of its inputs is of unknown origin."""
    if key not in known:
        found: set[str] | None = set(_digests(actions, key, "file"))
        for digest in _digests(actions, key, "result"):
            makers = [maker for maker in actions.makers.get(digest, []) if maker not in above]
            befores = [_origins(maker, actions, known, above | {key}) for maker in makers]
            sure = [before for before in befores if before is not None]
            found = None if found is None or not sure else found.union(*sure)
        known[key] = found
    return known[key]


def _names(subject: Subject, actions: Actions, key: str, store: Store) -> bool:
    """Whether an action took a value that names the subject, or failed with words that do."""
    problem = (actions.rows[key].failure or ("", ""))[1].encode()
    values = [store.get(digest) or b"" for digest in _digests(actions, key, "value")]
    return any(_is_named(subject, text) for text in (problem, *values))


def _is_named(subject: Subject, text: bytes) -> bool:
    return subject.pattern.search(text) is not None

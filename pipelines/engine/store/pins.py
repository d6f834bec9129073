"""Scans whose results are kept, whatever is computed of them later."""

import json

from pipelines.engine.files.digest import sha256
from pipelines.engine.store.store import Store, plain_hex
from schemas.base.errors import DamagedError, RefusedInput
from schemas.base.model import canonical_json, pseudonym

FOLDER = "pins"


def pin(scan: str, store: Store) -> int:
    """Keep the present results of all steps of a scan (`patient/scan`); returns how many. A former pin is replaced.

    Raises
    ------
    RefusedInput
        No step of the scan has run.
    """
    name = _name(scan)
    latest = [store.read_latest(file) for file, _ in store.files.sizes("latest") if file.endswith(".json")]
    keys = {one.step: one.key for one in latest if one is not None and one.step.rpartition("/")[0] == scan}
    if not keys:
        raise RefusedInput(scan, f"has no results in {store.files.path('').rstrip('/')}, expected a scan that was run")
    store.files.write(name, _sealed(scan, keys))
    return len(keys)


def unpin(scan: str, store: Store) -> None:
    """Keep them no longer; RefusedInput where the scan is not pinned."""
    name = _name(scan)
    if store.files.state(name) is None:
        pinned = ", ".join(map(_scan, pin_names(store)))
        raise RefusedInput(scan, f"is not pinned, expected one of: {pinned or 'none is'}")
    store.files.remove(name)


def read_pins(store: Store) -> dict[str, dict[str, str]]:
    """Of each pinned scan, the keys of its actions by the names of their steps; DamagedError if one is damaged."""
    found = {name: read_pin(name, store) for name in pin_names(store)}
    return {_scan(name): keys for name, keys in found.items() if keys is not None}


def read_pin(name: str, store: Store) -> dict[str, str] | None:
    """One of them, by the name of its file; None where it is not there any more."""
    try:
        value = json.loads(store.files.read(name))
        keys = {step: plain_hex(key) for step, key in value["keys"].items()}
        if value != json.loads(_sealed(_scan(name), keys)):
            raise ValueError("broken seal")
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        problem = f"damaged, expected the pin of a scan; 'footscan cache pin {_scan(name)}' makes it anew"
        raise DamagedError(f"{store.files.path(name)}: {problem}") from None
    return keys


def pin_names(store: Store) -> list[str]:
    """The files of all pins."""
    return [name for name, _ in store.files.sizes(FOLDER) if name.endswith(".json")]


def _name(scan: str) -> str:
    """The file of a scan's pin; the scan's name must not lead elsewhere."""
    parts = [pseudonym(part, "scan") for part in scan.split("/")]
    return f"{FOLDER}/{'/'.join(parts)}.json"


def _scan(name: str) -> str:
    return name.removeprefix(f"{FOLDER}/").removesuffix(".json")


def _sealed(scan: str, keys: dict[str, str]) -> bytes:
    value = {"scan": scan, "keys": keys}
    return canonical_json({**value, "seal": sha256(canonical_json(value).encode())}).encode()

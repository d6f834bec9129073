"""Pins: scans whose present results are kept, whatever is computed for them later."""

from pipelines.engine.files.names import plain_hex
from pipelines.engine.files.seal import UNSEALING_ERRORS, sealed, unsealed
from pipelines.engine.store.store import Store
from schemas.base.errors import DamagedError, RefusedInput
from schemas.base.model import pseudonym

FOLDER = "pins"
"""Folder of the pins in a store."""


def pin(scan: str, store: Store) -> int:
    """Pin the present results of all steps of a scan (`patient/scan`); returns their number. Replaces an older pin.

    Raises
    ------
    RefusedInput
        No step of the scan has run.
    """
    name = _name(scan)
    latest = [store.read_latest(file) for file, _ in store.files.sizes("latest") if file.endswith(".json")]
    keys = {last.step: last.key for last in latest if last is not None and last.step.rpartition("/")[0] == scan}
    if not keys:
        raise RefusedInput(scan, f"has no results in {store.files.path('').rstrip('/')}, expected a scan that was run")
    store.files.write(name, sealed({"scan": scan, "keys": keys}, store.secret))
    return len(keys)


def unpin(scan: str, store: Store) -> None:
    """Remove the pin of a scan; RefusedInput if the scan is not pinned."""
    name = _name(scan)
    if store.files.state(name) is None:
        pinned = ", ".join(map(_scan, pin_names(store)))
        raise RefusedInput(scan, f"is not pinned, expected a pinned scan: {pinned or 'there is none'}")
    store.files.remove(name)


def read_pins(store: Store) -> dict[str, dict[str, str]]:
    """Return for each pinned scan the keys of its actions by step name; DamagedError if a pin is damaged."""
    keys_by_pin = {name: read_pin(name, store) for name in pin_names(store)}
    return {_scan(name): keys for name, keys in keys_by_pin.items() if keys is not None}


def read_pin(name: str, store: Store) -> dict[str, str] | None:
    """Read a pin by its file name: keys by step name; None if the file is missing, DamagedError if it is damaged."""
    try:
        value = unsealed(store.files.read(name), store.secret)
        if value["scan"] != _scan(name):
            raise ValueError("another scan's pin")
        return {step: plain_hex(key) for step, key in value["keys"].items()}
    except FileNotFoundError:
        return None
    except (OSError, *UNSEALING_ERRORS):
        problem = f"damaged, expected the pin of a scan; 'footscan cache pin {_scan(name)}' makes it anew"
        raise DamagedError(f"{store.files.path(name)}: {problem}") from None


def pin_names(store: Store) -> list[str]:
    """Return the file names of all pins."""
    return [name for name, _ in store.files.sizes(FOLDER) if name.endswith(".json")]


def _name(scan: str) -> str:
    """File name of a scan's pin; RefusedInput if the scan's name would lead out of the folder."""
    parts = [pseudonym(part, "scan") for part in scan.split("/")]
    return f"{FOLDER}/{'/'.join(parts)}.json"


def _scan(name: str) -> str:
    return name.removeprefix(f"{FOLDER}/").removesuffix(".json")

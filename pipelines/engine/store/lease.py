"""Runs under way say so in the store, so that nobody takes away what they are about to use."""

import contextlib
import json
import logging
import os
import re
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pipelines.engine.store.store import Store
from schemas.base.errors import Fault
from schemas.base.model import canonical_json

log = logging.getLogger("footscan.store")

FOLDER = "runs"
HEARTBEAT_S = 60.0
STALE_S = 600.0
"""Without a heartbeat for so long, a run is taken for dead."""
LATEST = 253_402_214_400.0
"""s since 1970: the last day of the year 9999, beyond which no calendar of Python goes."""


@dataclass(frozen=True)
class Lease:
    """What a run says of itself."""

    name: str
    """Its file in the store."""
    host: str | None
    """None, as all below, where the file is damaged."""
    process: int | None
    started: float | None
    """s since 1970, by the clock of its host; so is `heartbeat`."""
    heartbeat: float | None
    system: str | None
    """What its process has this number in, and when it started there; None where that is not known."""
    birth: str | None


@contextmanager
def lease(store: Store) -> Iterator[str]:
    """Holds a lease while a run lasts; gives its name. A store that cannot be written to gets none; that is said."""
    host = re.sub(r"[^A-Za-z0-9.]", "-", socket.gethostname())[:64] or "host"
    name = f"{FOLDER}/{host}-{os.getpid()}-{secrets.token_hex(4)}.json"
    started = time.time()
    ended = threading.Event()

    def beat() -> None:
        while not ended.wait(HEARTBEAT_S):
            try:
                _write(name, host, started, store)
            except Fault as error:
                log.debug("%s", error)  # the next may do; the run itself says what it cannot write

    try:
        _write(name, host, started, store)
    except Fault as error:
        log.warning("%s; 'footscan cache gc' will not know of this run", error)
    thread = threading.Thread(target=beat, name="lease", daemon=True)
    thread.start()
    try:
        yield name
    finally:
        ended.set()
        thread.join()
        with contextlib.suppress(OSError, Fault):  # it will be taken for dead
            store.files.remove(name)


def leases(store: Store) -> list[Lease]:
    """All that lie in the store, whether their runs are alive or not."""
    found = []
    for name, _ in store.files.sizes(FOLDER):
        if name.endswith(".json"):
            with contextlib.suppress(FileNotFoundError):  # its run has just ended
                found.append(_read(name, store.files.read(name)))
    return found


def live_leases(store: Store) -> list[Lease]:
    """Those of runs that are to be taken for alive; one of which nothing is known is."""
    now = time.time()
    beating = (one for one in leases(store) if one.heartbeat is None or now - one.heartbeat < STALE_S)
    return [one for one in beating if not _is_gone(one)]


def is_ahead(one: Lease) -> bool:
    """Whether a lease was renewed in the future: by the clock of its host, or by this one's, which then is wrong."""
    return one.heartbeat is not None and one.heartbeat - time.time() > STALE_S


def take_over(store: Store) -> list[Lease]:
    """Remove the leases that block a store, but for those of processes seen to run on this machine; returns them.

    A run that is alive after all writes its lease again with the next heartbeat.
    """
    taken = [one for one in live_leases(store) if not _is_here(one)]
    for one in taken:
        store.files.remove(one.name)
    return taken


def _is_here(one: Lease) -> bool:
    """Whether the process of a lease was looked for where it ran, and found."""
    return one.process is not None and one.system is not None and one.system == _system() and not _is_gone(one)


def _is_gone(one: Lease) -> bool:
    """Whether the process of a lease is known to have ended: it can be looked for where it ran, and there alone."""
    if one.process is None or one.system is None or one.system != _system():
        return False
    try:
        os.kill(one.process, 0)
    except ProcessLookupError:
        return True
    except OSError:  # another user's
        return False
    birth = _birth(one.process)
    return birth is not None and birth != one.birth  # its number is another's by now


def _system() -> str | None:
    """This boot of this machine, and what its processes are counted in: a container has numbers of its own."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:  # no Linux
        return None


def _birth(process: int) -> str | None:
    """When a process started, in ticks since the boot; `ended` of one that only waits for its parent to hear of it."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    state, *facts = status.rpartition(")")[2].split()
    return "ended" if state in "ZX" else facts[18]


def _write(name: str, host: str, started: float, store: Store) -> None:
    now = {
        "host": host,
        "process": os.getpid(),
        "started": started,
        "heartbeat": time.time(),
        "system": _system(),
        "birth": _birth(os.getpid()),
    }
    store.files.write(name, canonical_json(now).encode())


def _read(name: str, data: bytes) -> Lease:
    try:
        match json.loads(data):
            case {
                "host": str(host),
                "process": int(process),
                "started": float(started),
                "heartbeat": float(heartbeat),
                **more,
            }:
                if not all(0.0 <= one < LATEST for one in (started, heartbeat)):
                    raise ValueError("no time")
                system, birth = (str(more[fact]) if more.get(fact) else None for fact in ("system", "birth"))
                return Lease(name, host, process, started, heartbeat, system, birth)
    except (ValueError, RecursionError):
        pass
    return Lease(name, None, None, None, None, None, None)

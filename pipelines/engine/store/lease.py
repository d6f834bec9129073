"""Leases: files in the store that mark runs under way, so that nobody deletes results that they are about to use."""

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
"""Folder of the leases in a store."""
HEARTBEAT_S = 60.0
"""Interval between two renewals of a lease; chosen by hand."""
STALE_S = 600.0
"""Time without a heartbeat after which a run counts as dead: ten missed heartbeats, chosen by hand."""
LATEST = 253_402_214_400.0
"""Last valid time, s since 1970: the last day of the year 9999, the limit of Python's `datetime`."""
START_TIME = 18
"""Index of `starttime` among the fields of /proc/PID/stat that follow the state (proc(5), field 22)."""


@dataclass(frozen=True)
class Lease:
    """The lease of one run."""

    name: str
    """Name of its file in the store."""
    host: str | None
    """Host of the run; None, like all fields below, if the file is damaged."""
    process: int | None
    started: float | None
    """s since 1970, by the clock of its host; so is `heartbeat`."""
    heartbeat: float | None
    system: str | None
    """Boot and process namespace in which `process` is counted; None if unknown."""
    birth: str | None
    """Start of the process, in ticks since the boot; None if unknown."""


@contextmanager
def lease(store: Store) -> Iterator[str]:
    """Hold a lease while a run lasts; gives its name. If the store cannot be written to, a warning is logged."""
    host = re.sub(r"[^A-Za-z0-9.]", "-", socket.gethostname())[:64] or "host"
    name = f"{FOLDER}/{host}-{os.getpid()}-{secrets.token_hex(4)}.json"
    started = time.time()
    ended = threading.Event()

    def beat() -> None:
        while not ended.wait(HEARTBEAT_S):
            try:
                _write(name, host, started, store)
            except Fault as error:
                log.debug("%s", error)  # the next heartbeat may succeed; the run reports what it cannot write

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
        with contextlib.suppress(OSError, Fault):  # without heartbeats it becomes stale
            store.files.remove(name)


def leases(store: Store) -> list[Lease]:
    """Return all leases in the store, of live and of dead runs."""
    read = []
    for name, _ in store.files.sizes(FOLDER):
        if name.endswith(".json"):
            with contextlib.suppress(FileNotFoundError):  # its run has just ended
                read.append(_read(name, store.files.read(name)))
    return read


def live_leases(store: Store) -> list[Lease]:
    """Return the leases of runs that count as alive; a damaged lease does so as well."""
    now = time.time()
    beating = (held for held in leases(store) if held.heartbeat is None or now - held.heartbeat < STALE_S)
    return [held for held in beating if not _is_gone(held)]


def is_ahead(held: Lease) -> bool:
    """Return True if a lease was renewed in the future: the clock of its host or of this machine is wrong then."""
    return held.heartbeat is not None and held.heartbeat - time.time() > STALE_S


def take_over(store: Store) -> list[Lease]:
    """Remove and return the leases that block a store, except those of processes that run on this machine.

    A run that is alive after all writes its lease again at the next heartbeat.
    """
    blocking = [held for held in live_leases(store) if not _runs_here(held)]
    for held in blocking:
        store.files.remove(held.name)
    return blocking


def _runs_here(held: Lease) -> bool:
    """Return True if the process of a lease runs on this machine."""
    return held.process is not None and held.system is not None and held.system == _system() and not _is_gone(held)


def _is_gone(held: Lease) -> bool:
    """Return True if the process of a lease is known to have ended; unknown for a process of another machine."""
    if held.process is None or held.system is None or held.system != _system():
        return False
    try:
        os.kill(held.process, 0)
    except ProcessLookupError:
        return True
    except OSError:  # a process of another user
        return False
    birth = _birth(held.process)
    return birth is not None and birth != held.birth  # its number belongs to another process by now


def _system() -> str | None:
    """Boot of this machine and its process namespace: a container numbers its processes separately."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:  # not Linux
        return None


def _birth(process: int) -> str | None:
    """Start of a process in ticks since the boot, or `ended` for a zombie; None if it does not exist."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    state, *fields = status.rpartition(")")[2].split()
    return "ended" if state in "ZX" else fields[START_TIME]


def _write(name: str, host: str, started: float, store: Store) -> None:
    content = {
        "host": host,
        "process": os.getpid(),
        "started": started,
        "heartbeat": time.time(),
        "system": _system(),
        "birth": _birth(os.getpid()),
    }
    store.files.write(name, canonical_json(content).encode())


def _read(name: str, data: bytes) -> Lease:
    try:
        match json.loads(data):
            case {
                "host": str(host),
                "process": int(process),
                "started": float(started),
                "heartbeat": float(heartbeat),
                **optional,
            }:
                if not all(0.0 <= seconds < LATEST for seconds in (started, heartbeat)):
                    raise ValueError("no time")
                system, birth = (str(optional[fact]) if optional.get(fact) else None for fact in ("system", "birth"))
                return Lease(name, host, process, started, heartbeat, system, birth)
    except (ValueError, RecursionError):
        pass
    return Lease(name, None, None, None, None, None, None)

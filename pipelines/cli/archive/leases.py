"""Leases on the command line: which runs keep a store from being cleaned."""

import socket
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.why import json_time, local_time
from pipelines.cli.terminal.output import message
from schemas.base.errors import one_line

if TYPE_CHECKING:
    from pipelines.engine.store.lease import Lease
    from pipelines.engine.store.store import Store

TakeOver = Annotated[
    bool, typer.Option("--take-over", help="Remove the leases of dead runs on other machines, or with a wrong clock.")
]


def lease_json(held: "Lease") -> dict[str, Any]:
    """A lease as JSON."""
    from pipelines.engine.store.lease import is_ahead

    started, heartbeat = json_time(held.started), json_time(held.heartbeat)
    times = {"started": started, "heartbeat": heartbeat, "ahead": is_ahead(held)}
    return {"host": held.host, "process": held.process, **times}


def take_over_leases(store: "Store") -> "list[Lease]":
    """Remove all leases except those of running processes of this machine, and print them."""
    from pipelines.engine.store.lease import take_over

    taken = take_over(store)
    for held in taken:
        message(f"footscan: taken over: {held.name} of {_holder(held)}")
    return taken


def lease_in_words(held: "Lease") -> str:
    """Holder and start of a lease, and what to do if it is not that of a run."""
    from pipelines.engine.store.lease import is_ahead

    if held.host is None:
        return f"{held.name}: damaged, so a run may be under way ('footscan cache verify' removes it)"
    if is_ahead(held):
        when = f"is dated in the future, {local_time(held.heartbeat)}: the clock there is wrong, or the one here"
        return f"{_holder(held)} {when} (if no run is under way there, --take-over removes {held.name})"
    hint = "" if held.host == socket.gethostname() else " (if that host is gone, --take-over)"
    return f"{_holder(held)} is running since {local_time(held.started)}{hint}"


def _holder(held: "Lease") -> str:
    return "an unknown process" if held.host is None else one_line(f"process {held.process} on {held.host}")

"""`footscan console`."""

import secrets
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from footscan.capture.board.termination import EndedBySignal
from pipelines.cli.live.options import (
    CAPTURES,
    VIRTUAL_FOLDER,
    GridMm,
    RigFile,
    Virtual,
    VirtualFolder,
    opened_rig,
    plain_world,
)
from pipelines.cli.terminal.output import message
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.console.scanner import Scanner
    from pipelines.live.calibrating.guide import Guide

LOOPBACK = "127.0.0.1"
ASKED_TO_END = (None, signal.SIGINT, signal.SIGTERM)
"""Signals that end a console normally; after other signals the exit status is that of the signal."""
EVERYWHERE = ("0.0.0.0", "::")


def console(
    rig: RigFile = None,
    out: Annotated[Path, typer.Option(help="Folder of the archive.")] = Path("archive"),
    results: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results"),
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; default: the rig's.")] = None,
    reference: Annotated[
        Path | None,
        typer.Option(help="Reference object to calibrate with (YAML); default: reference.yaml beside rig.yaml."),
    ] = None,
    captures: Annotated[Path, typer.Option(help="Folder of the captures of the reference object.")] = CAPTURES,
    body: Annotated[
        Path | None, typer.Option(help="Mesh of the body that shows the laser planes (mm); default: the standard one.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free one.")] = 8760,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any other than loopback requires a token to open the page.")
    ] = LOOPBACK,
    token: Annotated[
        bool | None,
        typer.Option(
            help="Open the page with a token, which other accounts of this computer do not have. Default: only where "
            "the address is not loopback; there it cannot be switched off."
        ),
    ] = None,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    grid_mm: GridMm = 0.45,
) -> None:
    """Run the scanner from a web page. Ctrl-C ends it, with the lasers off."""
    from pipelines.console.console import Console
    from pipelines.console.guard import is_loopback
    from pipelines.console.server import server_of
    from pipelines.console.web import listen

    if token is False and not is_loopback(host):
        raise RefusedInput("--no-token", "leaves the scanner open to the network, expected it with loopback alone")
    secret = secrets.token_urlsafe(32) if token or not is_loopback(host) else None
    files = _Files(rig, calibration, reference, captures, body)
    with (
        listen(host, port) as socket,
        listen(host, 0) as aside,
        _opened(files, out, results, virtual_folder, grid_mm if virtual else None) as (scanner, guide),
        Console(scanner, out, results, guide) as one,
    ):
        shown = f"[{host}]" if ":" in host else host
        if not is_loopback(host):
            message("footscan: anyone who can read the network's traffic can read the token: use a network of your own")
        if host in EVERYWHERE:
            shown = "ADDRESS-OF-THIS-COMPUTER"
        ports = socket.getsockname()[1], aside.getsockname()[1]
        print(f"http://{shown}:{ports[0]}/{f'?token={secret}' if secret else ''}", flush=True)
        one.connect()
        server = server_of(one, host, secret, ports)
        server.run(sockets=[socket, aside])
    if server.ended_by not in ASKED_TO_END:
        raise EndedBySignal(server.ended_by)
    message("the lasers are off, the console has ended")


@dataclass(frozen=True)
class _Files:
    """Files of a scanner that the command line names."""

    rig: Path | None
    calibration: Path | None
    reference: Path | None
    captures: Path
    body: Path | None


@contextmanager
def _opened(
    files: _Files, archive: Path, results: Path, folder: Path, grid_mm: float | None
) -> "Iterator[tuple[Scanner, Guide | None]]":
    """The scanner of a rig, and the guide of its calibrations. With a grid it is a virtual scanner."""
    from footscan.ahead_of_time import SCAN, Compilation
    from pipelines.console.live_adapter import LiveAdapter
    from pipelines.live.calibrating.guide import Guide
    from pipelines.live.calibrating.live import LiveStanding
    from pipelines.live.calibrating.settings import settings_of
    from pipelines.live.light import light_by_hand
    from pipelines.live.scanner import LiveScanner
    from pipelines.live.virtual.world import EXPOSURE_MS

    world = plain_world(grid_mm is not None, folder)
    if world is not None:
        world = world.model_copy(update={"grid_mm": grid_mm})
    with (
        Compilation(SCAN, in_background=True) as loops,
        opened_rig(files.rig, folder, world, calibrated=world is not None) as opened,
    ):
        rig = opened.rig
        if files.calibration is not None:
            rig = rig.model_copy(update={"calibration": str(files.calibration.resolve())})
        # Pictures of a virtual scanner are made beforehand, and for one light.
        light = None if opened.world is None else light_by_hand(rig, 1.0, EXPOSURE_MS)
        settings = settings_of(opened.file, files.captures, files.reference, files.body, light)
        with LiveScanner(rig, loops) as scanner:
            guide = None
            if settings is not None:
                guide = Guide(LiveStanding(scanner), settings, None if opened.world is None else opened.world.put)
            yield LiveAdapter(scanner, archive, results, light, opened.world), guide

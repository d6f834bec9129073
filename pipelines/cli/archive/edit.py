"""`footscan edit`."""

import secrets
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli.archive.selecting import Chosen
from pipelines.cli.archive.why import scan_of_job
from pipelines.cli.terminal.output import message, print_line
from schemas.base.errors import RefusedInput

LOOPBACK = "127.0.0.1"


def edit(
    scan: Annotated[str, typer.Argument(help="Folder of a scan, or patient/scan.")],
    workflow: Annotated[Path | None, typer.Option(help="The workflow; default: workflow.yaml.")] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration, for a scan folder without a workflow.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results, for a scan folder without a workflow.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free one.")] = 0,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any other than loopback requires a token to open the page.")
    ] = LOOPBACK,
    token: Annotated[
        bool | None, typer.Option(help="Open the page with a token. Default: only where the address is not loopback.")
    ] = None,
) -> None:
    """Move landmarks and make choices for a scan on a page in the browser. Ctrl-C ends it."""
    from pipelines.archive.editing import ScanEditor
    from pipelines.console.editing import edit_server
    from pipelines.console.guard import is_loopback
    from pipelines.console.web import listen

    if token is False and not is_loopback(host):
        raise RefusedInput("--no-token", "leaves the page open to the network, expected it with loopback alone")
    secret = secrets.token_urlsafe(32) if token or not is_loopback(host) else None
    editor = ScanEditor(*scan_of_job(scan, Chosen(), workflow, calibration, out))
    assert len(editor.mesh.faces), "a scan with measures has a surface"
    with listen(host, port) as socket:
        shown = f"[{host}]" if ":" in host else host
        print_line(f"http://{shown}:{socket.getsockname()[1]}/{f'?token={secret}' if secret else ''}")
        sys.stdout.flush()
        with suppress(KeyboardInterrupt):  # which is how it ends
            edit_server(editor, host, secret).run(sockets=[socket])
    message(f"{editor.scan.name}: the page has ended")

"""What the servers of pages have in common: their socket, the bodies of requests, and the files of pages."""

import os
import socket
from pathlib import Path

from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response

from footscan.report.style import STYLE
from footscan.report.viewer_script import SCRIPT
from pipelines.console.guard import LARGEST_BODY
from schemas.base.errors import FootscanError, RefusedInput

STATIC = Path(__file__).with_name("static")
SCRIPTS = ("link.js", "cameras.js", "sitting.js", "calibrating.js", "foot.js", "edit.js")
BACKLOG = 4096
"""Connections that may wait to be accepted; beyond, the system drops the first packet, which is repeated after 1 s."""


def listen(host: str, port: int) -> socket.socket:
    """Open a socket for the server.

    Raises
    ------
    RefusedInput
        The address cannot be used.
    """
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family, backlog=BACKLOG)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror
        problem = f"cannot be listened on ({why}), expected another --port or --host"
        raise RefusedInput(f"{host}:{port}", problem) from None


async def body_of(request: Request) -> bytes:
    """Read the body of a request that the guard admitted by its content-length."""
    body = b""
    try:
        async for part in request.stream():
            body += part
            if len(body) > LARGEST_BODY:
                raise RefusedInput("request", f"is too long, expected up to {LARGEST_BODY} bytes")
    except ClientDisconnect:
        raise RefusedInput("request", "ended too early") from None
    return body


async def static_file(request: Request) -> Response:
    """Answer a request for a style sheet or a script."""
    name = request.path_params["name"]
    if name == "console.css":
        return Response(STYLE + (STATIC / name).read_text(encoding="utf-8"), media_type="text/css")
    if name == "viewer.js":
        return Response(SCRIPT, media_type="text/javascript")
    if name in SCRIPTS:
        return Response((STATIC / name).read_text(encoding="utf-8"), media_type="text/javascript")
    return PlainTextResponse("footscan: no such file\n", 404)


async def not_there(_: Request, error: Exception) -> Response:
    """Answer a request for results that are missing, or were changed by hand."""
    assert isinstance(error, FootscanError)
    return PlainTextResponse(f"footscan: {error}\n", 404)

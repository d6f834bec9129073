"""The web server of the console: pages, their orders, and the stream of states."""

import asyncio
import json
import os
import signal
import socket
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from types import FrameType
from typing import Annotated, BinaryIO, TypeVar

import uvicorn
from pydantic import Field, ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from footscan.capture.board.termination import ending_signals
from pipelines.console.calibrating import calibrating_routes, order
from pipelines.console.console import Console
from pipelines.console.editing import editing_routes
from pipelines.console.gate import LARGEST_HEAD, Gate, Stop, hand_over_to
from pipelines.console.guard import PAGE, PAGE_HEADER, Guard, Rules
from pipelines.console.pages.foot import foot_page
from pipelines.console.pages.live_picture import LivePictures
from pipelines.console.pages.pair import pair_page
from pipelines.console.pages.results import KINDS, guarded, open_result, version_of
from pipelines.console.pages.sitting import sitting_page
from pipelines.console.scanner import Side
from pipelines.console.stopping import stop_asked
from pipelines.console.web import body_of, not_there, static_file
from pipelines.scan import SHOWN
from schemas.base.errors import Fault, RefusedInput
from schemas.base.model import Document, Posture, Pseudonym
from schemas.rig import HeadNumber

_Made = TypeVar("_Made")

ALIVE_SECONDS = 10.0
"""Interval of the signs of life to a page while the state does not change; chosen by hand."""
PAGES_KEPT = 4
"""Pages of feet in the cache: a bound of memory."""
PART_BYTES = 256 * 1024
"""Bytes that are read of a file at a time: a bound of memory."""
WORKERS = 2
"""Threads that make pages and read results; few, so that Stop and the board keep the processor."""
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)
"""Policy of a report, whose own policy admits only its own scripts; the sandbox separates it from the server."""


class ScanRequest(Document):
    """The body of an order to scan."""

    patient: Pseudonym
    side: Side
    posture: Posture = "unknown"
    keep_partial: bool = False


class JogRequest(Document):
    """The body of an order to move heads by hand."""

    mm: Annotated[float, Field(ge=-500, le=500)]
    head: HeadNumber | None = None


class ConsoleServer(uvicorn.Server):
    """Ends on signals without raising them again: the command closes the scanner afterwards.

    The heads stop at once, see `signals_end_the_program`; they do not wait for this server.
    """

    def __init__(self, config: uvicorn.Config, ends: Callable[[], None], stop: Stop) -> None:
        super().__init__(config)
        self._ends = ends
        self._stop = stop
        self._gate: Gate | None = None
        self.ended_by: int | None = None
        """The signal that ended the server."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """As in uvicorn, but the gate listens on `sockets`: that of the pages, and optionally one only for Stop."""
        await super().startup([])
        listening, *aside = sockets or []
        hand_over = hand_over_to(asyncio.get_running_loop(), self._protocol)
        self._gate = Gate(listening, hand_over, self._stop, aside[0] if aside else None)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """As in uvicorn."""
        if self._gate is not None:
            self._gate.close()
        await super().shutdown(sockets)

    def _protocol(self) -> asyncio.Protocol:
        protocol = self.config.http_protocol_class(  # type: ignore[call-arg]  # a class by configuration
            config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )
        assert isinstance(protocol, asyncio.Protocol)
        return protocol

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """As in uvicorn."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.signal(number, self.handle_exit) for number in ending_signals()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """As in uvicorn."""
        self.ended_by = self.ended_by or sig
        self._ends()
        super().handle_exit(sig, frame)


def server_of(console: Console, host: str, token: str | None, ports: tuple[int, int] | None = None) -> ConsoleServer:
    """Return the server of the console; `host`, `token` and `ports` as in `Rules`.

    `run` it with the sockets of `listen`: one for pages and, if `ports` are given, one only for Stop.
    """
    rules = Rules(host, token, console.warn, ports)
    config = uvicorn.Config(
        _application(console, rules, None if ports is None else ports[1]),
        log_level="critical",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        ws="none",
        http="h11",
        timeout_graceful_shutdown=3,
        timeout_keep_alive=15,
        h11_max_incomplete_event_size=LARGEST_HEAD,
        headers=[("connection", "close")],  # each request comes in by the gate
    )
    return ConsoleServer(config, console.end, partial(stop_asked, console, rules))


def application(console: Console, host: str, token: str | None) -> Starlette:
    """Return the application behind its guard; `host` and `token` as in `Rules`."""
    return _application(console, Rules(host, token, console.warn), None)


def _application(console: Console, rules: Rules, stop_port: int | None) -> Starlette:
    pages = _Pages(console, stop_port)
    actions: dict[str, Callable[[str, bytes], None]] = {
        "connect": lambda page, _: console.connect(page),
        "home": lambda page, _: console.home(page),
        "shine": lambda page, _: console.shine(page),
        "resume": lambda page, _: console.resume(page),
        "take-over": lambda page, _: console.take_over(page),
        "new-person": lambda page, _: console.new_person(page),
        "stop": lambda *_: console.stop(),
        "scan": lambda page, body: _scan(console, page, body),
        "jog": lambda page, body: _jog(console, page, body),
        "calibrate": partial(order, console),
    }
    return Starlette(
        routes=[
            Route("/", pages.sitting),
            Route("/foot/{patient}/{scan}", pages.foot),
            Route("/pair/{patient}/{left}/{right}", pages.pair),
            Route("/results/{patient}/{scan}/{name}", pages.result),
            *calibrating_routes(console),
            *editing_routes(console.editor_of),
            Route("/static/{name}", static_file),
            Route("/events", pages.events),
            Route("/here", pages.here, methods=["POST"]),
            Route("/cameras/{camera:int}.jpg", pages.picture),
            *(Route(f"/do/{name}", partial(_do, act), methods=["POST"], name=name) for name, act in actions.items()),
        ],
        middleware=[Middleware(Guard, rules=rules)],
        exception_handlers={RefusedInput: not_there},
    )


class _Pages:
    """Answers to GET requests."""

    def __init__(self, console: Console, stop_port: int | None) -> None:
        self._console, self._stop_port = console, stop_port
        self._workers = ThreadPoolExecutor(WORKERS, thread_name_prefix="console: pages")
        self._pictures = LivePictures()
        self._foot = lru_cache(PAGES_KEPT)(self._foot_page)

    def _foot_page(self, patient: str, scan: str, _version: tuple[int, ...]) -> str:
        return foot_page(self._console.archive, self._console.results, patient, scan)

    async def _in_worker(self, make: Callable[[], _Made]) -> _Made:
        """Run `make` in one of `WORKERS` threads and return its result."""
        return await asyncio.get_running_loop().run_in_executor(self._workers, make)

    async def sitting(self, _: Request) -> Response:
        return HTMLResponse(sitting_page())

    async def foot(self, request: Request) -> Response:
        patient, scan = request.path_params["patient"], request.path_params["scan"]

        def make() -> str:
            results = self._console.results
            version = version_of(results, patient, scan, *SHOWN)
            return guarded(results / patient / scan, lambda: self._foot(patient, scan, version))

        return HTMLResponse(await self._in_worker(make))

    async def pair(self, request: Request) -> Response:
        patient, left, right = (request.path_params[name] for name in ("patient", "left", "right"))
        results = self._console.results
        page = partial(pair_page, results, patient, left, right)
        return HTMLResponse(await self._in_worker(partial(guarded, results / patient, page)))

    async def result(self, request: Request) -> Response:
        patient, scan, name = (request.path_params[part] for part in ("patient", "scan", "name"))
        file = await self._in_worker(partial(open_result, self._console.results, patient, scan, name))
        if name.endswith(".html"):
            return _FileResponse(self._parts(file), file, KINDS[".html"], {"content-security-policy": REPORT_POLICY})
        headers = {"content-disposition": f'attachment; filename="{patient}-{scan}-{name}"'}
        return _FileResponse(self._parts(file), file, KINDS[Path(name).suffix], headers)

    async def _parts(self, file: BinaryIO) -> AsyncIterator[bytes]:
        """Read a file in parts, up to its size at the begin."""
        remaining = os.fstat(file.fileno()).st_size
        while remaining and (part := await self._in_worker(partial(file.read, min(remaining, PART_BYTES)))):
            remaining -= len(part)
            yield part
        if remaining:
            raise OSError("the file became shorter while it was sent")

    async def picture(self, request: Request) -> Response:
        camera = request.path_params["camera"]
        jpeg = self._console.scanner.picture(camera)
        if jpeg is None:
            return Response(status_code=204)
        try:
            with_stripe = self._console.scanner.finds_stripes
            drawn, points = await self._in_worker(partial(self._pictures.drawn, camera, jpeg, with_stripe=with_stripe))
        except ValueError:
            return Response(status_code=204)
        return Response(drawn, media_type="image/jpeg", headers={"x-stripe-points": str(points)})

    async def here(self, request: Request) -> Response:
        """Record that the page that moves heads is there; without a thread of the pool, since it must not be late."""
        self._console.here(request.headers[PAGE_HEADER])
        return Response(status_code=204)

    async def events(self, request: Request) -> Response:
        page = request.query_params.get("page", "")
        if PAGE.fullmatch(page) is None:
            return PlainTextResponse("footscan: page: expected the name of the page\n", 400)
        return StreamingResponse(self._states(page), media_type="text/event-stream")

    async def _states(self, page: str) -> AsyncIterator[str]:
        """Yield the state now and after each change, as server-sent events."""
        console, loop, changed = self._console, asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            loop.call_soon_threadsafe(changed.set)

        unhear = console.hear(wake)
        await run_in_threadpool(console.enter, page)
        try:
            before = None
            while not console.closing.is_set():
                changed.clear()
                state = json.dumps(console.seen_by(page) | {"stop_port": self._stop_port}, allow_nan=False)
                yield ": here\n\n" if state == before else f"data: {state}\n\n"
                before = state
                try:
                    await asyncio.wait_for(changed.wait(), ALIVE_SECONDS)
                except TimeoutError:
                    continue
        finally:
            unhear()
            console.leave(page)


class _FileResponse(StreamingResponse):
    """An answer with a file, which is closed even if the client disconnects."""

    def __init__(self, parts: AsyncIterator[bytes], file: BinaryIO, kind: str, headers: dict[str, str]) -> None:
        length = {"content-length": str(os.fstat(file.fileno()).st_size)}
        super().__init__(parts, media_type=kind, headers=headers | length)
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer; ASGI interface."""
        with self._file:
            await super().__call__(scope, receive, send)


async def _do(act: Callable[[str, bytes], None], request: Request) -> Response:
    """Carry out an order of a page; a problem is answered in one line."""
    try:
        body = await body_of(request)
        await run_in_threadpool(act, request.headers[PAGE_HEADER], body)
    except RefusedInput as error:
        return JSONResponse({"problem": str(error)}, 409)
    except Fault as error:
        return JSONResponse({"problem": str(error)}, 502)
    except ValidationError:
        return JSONResponse({"problem": "the order has unexpected fields or values"}, 400)
    return Response(status_code=204)


def _scan(console: Console, page: str, body: bytes) -> None:
    order = ScanRequest.model_validate_json(body)
    console.scan(page, order.patient, order.side, order.posture, order.keep_partial)


def _jog(console: Console, page: str, body: bytes) -> None:
    order = JogRequest.model_validate_json(body)
    console.jog(page, order.mm, order.head)

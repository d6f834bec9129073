"""Where connections come in: Stop is answered here, in threads of its own, and the server gets whole requests alone.

Whoever holds connections open, sends half a request, or has the server busy stands in nobody's way: what is not yet a
request has a time limit and the oldest of it makes room, each kind of request has a budget of its own, and a Stop acts
as soon as its head has come.
"""

import asyncio
import logging
import resource
import selectors
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import h11

from pipelines.console.guard import HEADERS, LARGEST_BODY

log = logging.getLogger("footscan.console")

STOP = b"/do/stop"
LARGEST_HEAD = 16 * 1024
REQUEST_SECONDS = 5.0
"""A request that has not come whole after this long is not waited for."""
ANSWER_SECONDS = 60.0
"""Whoever has not taken an answer after this long, other than a stream of events, is let go."""
DESCRIPTORS = 4096
"""Of files and connections, as far as the system lets this program have them."""
MOST_WAITING = 256
"""Connections on which no whole request has come; the oldest makes room for a further one."""
KEPT_DESCRIPTORS = 256
"""For board, cameras, films, answers and Stop: they are never lent to connections that wait."""
MOST_STOPS = 16
BUDGETS = {"events": 24, "orders": 16, "pages": 48, "results": 8}
"""Requests of each kind that the server has at a time; one more is answered 503."""

HandOver = Callable[[socket.socket, bytes, Callable[[], None], float | None], None]
"""Gives the server a connection with what has come on it, and what to call when it ends; it ends after so many
seconds at the latest, where a number is given."""
Headers = list[tuple[bytes, bytes]]
Stop = Callable[[dict[str, Any], bool], tuple[int, bytes, Headers]]
"""Stops the scanner, where the request (an ASGI scope) may; it has come by the socket of Stop alone, or not. Returns
status, body and further headers of the answer."""


@dataclass
class _Waiting:
    until: float
    is_aside: bool
    parser: h11.Connection = field(default_factory=lambda: h11.Connection(h11.SERVER, LARGEST_HEAD))
    came: bytes = b""
    request: h11.Request | None = None


class Gate:
    """Listens in a thread of its own until it is closed.

    A second socket, if given, is for Stop alone: a browser has six connections for a port, all of which may be taken.
    """

    def __init__(
        self, listening: socket.socket, hand_over: HandOver, stop: Stop, aside: socket.socket | None = None
    ) -> None:
        self._hand_over, self._stop = hand_over, stop
        self._doors = {listening: False} if aside is None else {listening: False, aside: True}
        self._most_waiting = min(MOST_WAITING, max(_descriptors() - KEPT_DESCRIPTORS, 16))
        self._waiting: dict[socket.socket, _Waiting] = {}
        self._free = {kind: threading.BoundedSemaphore(most) for kind, most in BUDGETS.items()}
        self._free_stops = threading.BoundedSemaphore(MOST_STOPS)
        self._selector = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        for door in self._doors:
            door.setblocking(False)
            self._selector.register(door, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="console: gate", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Takes no more connections; those that the server has go on."""
        self._closing.set()
        self._wake.send(b".")
        self._thread.join()

    def _watch(self) -> None:
        try:
            while not self._closing.is_set():
                for key, _ in self._selector.select(self._patience()):
                    if isinstance(key.fileobj, socket.socket):
                        self._look_at(key.fileobj)
                now = time.monotonic()
                for late in [connection for connection, one in self._waiting.items() if one.until <= now]:
                    self._answer(late, 408, b"footscan: the request did not come whole\n")
        finally:
            for connection in list(self._waiting):
                self._forget(connection).close()
            self._selector.close()
            self._wake.close()
            self._woken.close()

    def _look_at(self, ready: socket.socket) -> None:
        try:
            if ready in self._doors:
                self._accept(ready)
            elif ready in self._waiting:
                self._read(ready)
        except Exception:  # whatever one of them does, the next one may be a Stop
            log.exception("a connection was dropped")
            if ready in self._waiting:
                self._forget(ready).close()

    def _patience(self) -> float | None:
        first = next(iter(self._waiting.values()), None)
        return None if first is None else max(first.until - time.monotonic(), 0.0)

    def _accept(self, door: socket.socket) -> None:
        for _ in range(MOST_WAITING):
            try:
                connection, _ = door.accept()
            except BlockingIOError:
                return
            except OSError as error:  # no descriptor is left, or who called has gone
                if not self._waiting:
                    log.warning("no connection can be taken (%s)", error.strerror)
                    time.sleep(0.05)
                    return
                self._make_room()
                continue
            if len(self._waiting) >= self._most_waiting:
                self._make_room()
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._waiting[connection] = _Waiting(time.monotonic() + REQUEST_SECONDS, self._doors[door])
            self._selector.register(connection, selectors.EVENT_READ)
            self._read(connection)  # a browser sends its request at once

    def _make_room(self) -> None:
        self._forget(next(iter(self._waiting))).close()

    def _forget(self, connection: socket.socket) -> socket.socket:
        del self._waiting[connection]
        self._selector.unregister(connection)
        return connection

    def _read(self, connection: socket.socket) -> None:
        one = self._waiting[connection]
        try:
            came = connection.recv(LARGEST_HEAD)
        except BlockingIOError:
            return
        except OSError:
            came = b""
        if not came:
            self._forget(connection).close()
            return
        one.came += came
        try:
            one.parser.receive_data(came)
            if self._is_whole(one):
                self._pass_on(self._forget(connection), one)
        except h11.RemoteProtocolError as error:
            self._answer(connection, error.error_status_hint, b"footscan: this is no request of HTTP\n")

    def _is_whole(self, one: _Waiting) -> bool:
        """Whether nothing more needs to come; the head is enough of a Stop, of what has no body, and of what the guard
        refuses by its length."""
        while True:
            event = one.parser.next_event()
            if event is h11.NEED_DATA:
                return False
            if isinstance(event, h11.Request):
                one.request = event
                if event.method != b"POST" or _path(event) == STOP or not _has_small_body(event):
                    return True
            elif not isinstance(event, h11.Data):
                return True

    def _pass_on(self, connection: socket.socket, one: _Waiting) -> None:
        if one.request is None:
            connection.close()
            return
        if one.request.method == b"POST" and _path(one.request) == STOP:
            if self._free_stops.acquire(blocking=False):
                threading.Thread(
                    target=self._stop_now,
                    args=(connection, one.request, one.is_aside),
                    name="console: stop",
                    daemon=True,
                ).start()
            else:  # so many are being carried out
                _respond(connection, 503, b"footscan: Stop is being carried out\n")
            return
        if one.is_aside:
            _respond(connection, 404, b"footscan: here is Stop alone\n")
            return
        kind = _kind(one.request)
        free = self._free[kind]
        if not free.acquire(blocking=False):
            _respond(connection, 503, b"footscan: too many requests of this kind at a time\n")
            return
        try:
            self._hand_over(connection, one.came, free.release, None if kind == "events" else ANSWER_SECONDS)
        except RuntimeError:  # the server has ended
            free.release()
            connection.close()

    def _stop_now(self, connection: socket.socket, request: h11.Request, is_aside: bool) -> None:
        try:
            _respond(connection, *self._stop(_scope(request), is_aside))
        finally:
            self._free_stops.release()

    def _answer(self, connection: socket.socket, status: int, body: bytes) -> None:
        _respond(self._forget(connection), status, body)


def hand_over_to(loop: asyncio.AbstractEventLoop, protocol_of: Callable[[], asyncio.Protocol]) -> HandOver:
    """Gives connections to a server that runs in `loop`; RuntimeError once that is closed."""

    def hand_over(connection: socket.socket, came: bytes, ended: Callable[[], None], seconds: float | None) -> None:
        async def take() -> None:
            protocol = protocol_of()
            lost = protocol.connection_lost

            def connection_lost(error: Exception | None) -> None:
                ended()
                if timer is not None:
                    timer.cancel()
                lost(error)

            protocol.connection_lost = connection_lost  # type: ignore[method-assign, assignment]  # of this one alone
            timer: asyncio.TimerHandle | None = None
            try:
                transport, _ = await loop.connect_accepted_socket(lambda: protocol, connection)
            except OSError:
                ended()
                connection.close()
                return
            if seconds is not None:
                timer = loop.call_later(seconds, transport.abort)
            protocol.data_received(came)

        def begin() -> None:
            task = loop.create_task(take())
            tasks.add(task)
            task.add_done_callback(tasks.discard)

        loop.call_soon_threadsafe(begin)

    tasks: set[asyncio.Task[None]] = set()
    return hand_over


def _kind(request: h11.Request) -> str:
    if request.method == b"POST":
        return "orders"
    path = _path(request)
    return "events" if path == b"/events" else "results" if path.startswith(b"/results/") else "pages"


def _path(request: h11.Request) -> bytes:
    return bytes(request.target).partition(b"?")[0]


def _has_small_body(request: h11.Request) -> bool:
    length = next((bytes(value) for name, value in request.headers if name == b"content-length"), b"")
    return length.isdigit() and int(length[:9]) <= LARGEST_BODY


def _scope(request: h11.Request) -> dict[str, Any]:
    """What ASGI makes of the head of a request."""
    path, _, query = bytes(request.target).partition(b"?")
    headers = [(bytes(name), bytes(value)) for name, value in request.headers]
    method = request.method.decode("ascii")
    return {"type": "http", "method": method, "path": path.decode("latin-1"), "query_string": query, "headers": headers}


def _respond(connection: socket.socket, status: int, body: bytes, further: Headers | None = None) -> None:
    """Answers a small request and closes; whoever does not take the answer is not waited for."""
    kind = b"application/json" if body.startswith(b"{") else b"text/plain; charset=utf-8"
    headers = [(name.encode(), value.encode()) for name, value in HEADERS.items()] + (further or [])
    headers += [(b"connection", b"close"), (b"content-length", str(len(body)).encode()), (b"content-type", kind)]
    if status == 204:
        headers = [(name, value) for name, value in headers if not name.startswith(b"content-")]
    head = b"HTTP/1.1 %d \r\n" % status + b"".join(b"%s: %s\r\n" % pair for pair in headers)
    try:
        connection.setblocking(False)
        connection.send(head + b"\r\n" + body)
        connection.shutdown(socket.SHUT_WR)
        connection.recv(LARGEST_HEAD)  # what is left unread would take the answer back
    except OSError:
        pass
    connection.close()


def _descriptors() -> int:
    """How many files and connections this program may have open, after asking for more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return DESCRIPTORS if soft == resource.RLIM_INFINITY else soft

"""The gate before the server: it answers Stop in threads of its own, and passes on complete requests only.

A client that holds connections open, sends half a request or keeps the server busy does not block others: an incomplete
request has a time limit, the oldest one makes room for a new one, each kind of request has its own budget, and a Stop
acts as soon as its head has arrived.
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
"""Bytes of the head of a request: a bound of memory."""
REQUEST_SECONDS = 5.0
"""Time in which a request must arrive completely; chosen by hand."""
ANSWER_SECONDS = 60.0
"""Time in which a client must take an answer that is not a stream of events; chosen by hand."""
DESCRIPTORS = 4096
"""File descriptors that this program asks the system for."""
MOST_WAITING = 256
"""Most connections without a complete request; the oldest one makes room for a new one."""
KEPT_DESCRIPTORS = 256
"""File descriptors reserved for board, cameras, films, answers and Stop."""
MOST_STOPS = 16
"""Stops that are carried out at a time: a bound of threads."""
BUDGETS = {"events": 24, "orders": 16, "pages": 48, "results": 8}
"""Most requests of each kind that the server handles at a time; a further one is answered 503."""

HandOver = Callable[[socket.socket, bytes, Callable[[], None], float | None], None]
"""Passes a connection to the server: the bytes received on it, a function to call when it ends, and the number of
seconds after which it is ended at the latest (None: no limit)."""
Headers = list[tuple[bytes, bytes]]
Stop = Callable[[dict[str, Any], bool], tuple[int, bytes, Headers]]
"""Stops the scanner if the request (an ASGI scope) is permitted; the flag is True on the socket that accepts only Stop.
Returns status, body and further headers of the answer."""


@dataclass
class _Waiting:
    until: float
    is_aside: bool
    parser: h11.Connection = field(default_factory=lambda: h11.Connection(h11.SERVER, LARGEST_HEAD))
    received: bytes = b""
    request: h11.Request | None = None


class Gate:
    """Listens in a thread of its own until it is closed.

    The optional second socket accepts only Stop: a browser opens six connections per port, and all may be in use.
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
        """Accept no more connections; those that the server has continue."""
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
                for late in [connection for connection, waiting in self._waiting.items() if waiting.until <= now]:
                    self._answer(late, 408, b"footscan: the request did not arrive in time\n")
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
        except Exception:  # one connection must not end the gate: the next may be a Stop
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
            except OSError as error:  # no descriptor is left, or the client has gone
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
        waiting = self._waiting[connection]
        try:
            received = connection.recv(LARGEST_HEAD)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            self._forget(connection).close()
            return
        waiting.received += received
        try:
            waiting.parser.receive_data(received)
            if self._is_whole(waiting):
                self._pass_on(self._forget(connection), waiting)
        except h11.RemoteProtocolError as error:
            self._answer(connection, error.error_status_hint, b"footscan: expected an HTTP request\n")

    def _is_whole(self, waiting: _Waiting) -> bool:
        """Return True if the request is complete.

        The head suffices for a Stop, for a request without a body, and for one that the guard refuses by its length.
        """
        while True:
            event = waiting.parser.next_event()
            if event is h11.NEED_DATA:
                return False
            if isinstance(event, h11.Request):
                waiting.request = event
                if event.method != b"POST" or _path(event) == STOP or not _has_small_body(event):
                    return True
            elif not isinstance(event, h11.Data):
                return True

    def _pass_on(self, connection: socket.socket, waiting: _Waiting) -> None:
        if waiting.request is None:
            connection.close()
            return
        if waiting.request.method == b"POST" and _path(waiting.request) == STOP:
            if self._free_stops.acquire(blocking=False):
                threading.Thread(
                    target=self._stop_now,
                    args=(connection, waiting.request, waiting.is_aside),
                    name="console: stop",
                    daemon=True,
                ).start()
            else:  # `MOST_STOPS` are being carried out
                _respond(connection, 503, b"footscan: Stop is being carried out\n")
            return
        if waiting.is_aside:
            _respond(connection, 404, b"footscan: this port accepts only Stop\n")
            return
        kind = _kind(waiting.request)
        free = self._free[kind]
        if not free.acquire(blocking=False):
            _respond(connection, 503, b"footscan: too many requests of this kind at a time\n")
            return
        try:
            self._hand_over(connection, waiting.received, free.release, None if kind == "events" else ANSWER_SECONDS)
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
    """Return a function that passes connections to a server in `loop`; it raises RuntimeError if the loop is closed."""

    def hand_over(connection: socket.socket, received: bytes, ended: Callable[[], None], seconds: float | None) -> None:
        async def take() -> None:
            protocol = protocol_of()
            lost = protocol.connection_lost

            def connection_lost(error: Exception | None) -> None:
                ended()
                if timer is not None:
                    timer.cancel()
                lost(error)

            protocol.connection_lost = connection_lost  # type: ignore[method-assign, assignment]  # of this object only
            timer: asyncio.TimerHandle | None = None
            try:
                transport, _ = await loop.connect_accepted_socket(lambda: protocol, connection)
            except OSError:
                ended()
                connection.close()
                return
            if seconds is not None:
                timer = loop.call_later(seconds, transport.abort)
            protocol.data_received(received)

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
    """The ASGI scope of the head of a request."""
    path, _, query = bytes(request.target).partition(b"?")
    headers = [(bytes(name), bytes(value)) for name, value in request.headers]
    method = request.method.decode("ascii")
    return {"type": "http", "method": method, "path": path.decode("latin-1"), "query_string": query, "headers": headers}


def _respond(connection: socket.socket, status: int, body: bytes, further: Headers | None = None) -> None:
    """Answer a small request and close the connection, without waiting for a client that does not take the answer."""
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
        connection.recv(LARGEST_HEAD)  # unread bytes would reset the connection and discard the answer
    except OSError:
        pass
    connection.close()


def _descriptors() -> int:
    """Number of file descriptors that this program may open, after asking the system for more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < limit:
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
        return limit
    return DESCRIPTORS if soft == resource.RLIM_INFINITY else soft

"""Cameras on a network: Motion-JPEG over HTTP on loopback, as MJPEG-streamer and ESP32-CAM send it.

Each camera exposes by its own clock, with or without clients; a picture is sent after a delay; faults happen at
exposures that the caller names, and the servers keep a record of all exposures. A JPEG comment in each picture holds
the number of its exposure: no two pictures are equal, unless a fault repeats one.
"""

import itertools
import json
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Self
from urllib.parse import parse_qsl, urlsplit

import numpy as np

from footscan import clock
from footscan.virtual.filming.stream_faults import FaultKind, StreamFault, fault_of, torn

BOUNDARY = "frame"
CLIENT_FRAMES = 64
"""Most pictures that wait for a client; further ones are lost. A bound of memory."""
CLIENT_SECONDS = 5.0
"""Time limit of a client's connection, and of the end of a thread. Chosen by hand."""
POLL_SECONDS = 0.1
"""Longest time until a server notices its end. Chosen by hand."""

Picture = Callable[[int, float], bytes]
"""The JPEG that a camera takes at `seconds` of `clock.seconds()`."""
Exposures = Callable[[int], Iterator[float]]
"""When a camera exposes, in `clock.seconds()`; may wait until it happens."""


@dataclass(frozen=True)
class SentFrame:
    """The record of one exposure."""

    number: int
    """On the camera's own clock, from 0."""
    exposed: float
    """`clock.seconds()`."""
    sent: float | None
    """When its last byte was handed to the network; None: never, because of a fault or for lack of a client."""
    fault: FaultKind | None


def free_running(
    frames_per_second: float = 200 / 11, jitter_s: float = 0.0, seed: int = 1, count: int | None = None
) -> Exposures:
    """Exposures at an even period, each camera with a phase of its own, each moved by up to `jitter_s` either way."""
    period = 1 / frames_per_second

    def exposures(camera: int) -> Iterator[float]:
        random = np.random.default_rng((seed, camera))
        first = clock.seconds() + jitter_s + period * random.random()
        for number in itertools.count() if count is None else range(count):
            yield first + number * period + jitter_s * random.uniform(-1, 1)

    return exposures


class VirtualStreams:
    """Motion-JPEG servers, one a camera, each on a port of its own. A context manager; `close` ends all its threads.

    Parameters
    ----------
    cameras : their numbers
    picture, exposures
        What each camera takes, and when.
    latency_s, jitter_s
        From exposure to sending: even, and up to so much more.
    faults : of each camera that has any
    """

    def __init__(
        self,
        cameras: Iterable[int],
        picture: Picture,
        exposures: Exposures | None = None,
        *,
        latency_s: float | Mapping[int, float] = 0.03,
        jitter_s: float = 0.0,
        faults: Mapping[int, Sequence[StreamFault]] | None = None,
        seed: int = 1,
    ) -> None:
        self._cameras = {}
        for camera in cameras:
            latency = latency_s.get(camera, 0.0) if isinstance(latency_s, Mapping) else latency_s
            delays = _delays(latency, jitter_s, np.random.default_rng((seed, camera, 1)))
            moments = (exposures or free_running(seed=seed))(camera)
            self._cameras[camera] = _Camera(camera, picture, moments, delays, tuple((faults or {}).get(camera, ())))

    def url(self, camera: int) -> str:
        """Returns the address of a camera's stream."""
        return f"http://127.0.0.1:{self._cameras[camera].port}/stream"

    def sent(self, camera: int) -> list[SentFrame]:
        """Returns the record of each exposure of a camera so far."""
        return self._cameras[camera].record()

    def fail(self, camera: int, faults: Sequence[StreamFault]) -> int:
        """Add faults from now on, their `first` counted from the next exposure, whose number is returned."""
        return self._cameras[camera].fail(faults)

    def settings(self, camera: int) -> dict[str, float]:
        """Returns the values set by `/control?exposure=..&gain=..`: exposure in ms, gain as a share of its range."""
        return dict(self._cameras[camera].settings)

    def close(self) -> None:
        """End all exposures and servers."""
        for camera in self._cameras.values():
            camera.stop()
        for camera in self._cameras.values():
            camera.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _delays(latency_s: float, jitter_s: float, random: np.random.Generator) -> Iterator[float]:
    while True:
        yield latency_s + jitter_s * random.random()


@dataclass(frozen=True)
class _Outgoing:
    number: int
    due: float
    jpeg: bytes


class _Camera:
    """One camera: a thread that exposes, and a server with a thread for each client."""

    def __init__(
        self,
        camera: int,
        picture: Picture,
        exposures: Iterator[float],
        delays: Iterator[float],
        faults: tuple[StreamFault, ...],
    ) -> None:
        self.settings = {"exposure": 10.0, "gain": 0.0}
        self.stopping = threading.Event()
        self._is_cut = False
        self.number, self._picture, self._exposures = camera, picture, exposures
        self._delays, self._faults = delays, faults
        self._record: list[SentFrame] = []
        self._clients: list[queue.Queue[_Outgoing | None]] = []
        self._lock = threading.Lock()
        self._server = _Server(self)
        self.port = int(self._server.server_address[1])
        self._threads = [
            threading.Thread(target=self._server.serve_forever, args=(POLL_SECONDS,), name=f"virtual server {camera}"),
            threading.Thread(target=self._expose, name=f"virtual camera {camera}"),
        ]
        for thread in self._threads:
            thread.daemon = True  # a picture that never comes must not keep the program alive
            thread.start()

    def stop(self) -> None:
        self.stopping.set()
        self._cut(True)

    def join(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        for thread in self._threads:
            thread.join(CLIENT_SECONDS)

    def fail(self, faults: Sequence[StreamFault]) -> int:
        with self._lock:
            number = len(self._record)
            self._faults += tuple(replace(fault, first=fault.first + number) for fault in faults)
        return number

    def record(self) -> list[SentFrame]:
        with self._lock:
            return list(self._record)

    def attach(self) -> "queue.Queue[_Outgoing | None] | None":
        """Returns a new client's queue, in which None ends the connection; None while the camera is cut off."""
        client: queue.Queue[_Outgoing | None] = queue.Queue(CLIENT_FRAMES)
        with self._lock:
            if self._is_cut:
                return None
            self._clients.append(client)
        return client

    def detach(self, client: "queue.Queue[_Outgoing | None]") -> None:
        with self._lock:
            if client in self._clients:
                self._clients.remove(client)
        with suppress(queue.Empty):
            while True:
                if (frame := client.get_nowait()) is not None:
                    self.let_go(frame.number)

    def let_go(self, number: int) -> None:
        """The clock need not wait for the picture of an exposure any longer."""
        clock.release((self.number, number))

    def note_sent(self, number: int) -> None:
        with self._lock:
            was = self._record[number]
            self._record[number] = SentFrame(number, was.exposed, clock.seconds(), was.fault)

    def _expose(self) -> None:
        try:
            self._expose_on()
        finally:
            clock.release(self.number)

    def _expose_on(self) -> None:
        held: list[_Outgoing] = []
        before = b""
        for number, seconds in enumerate(self._exposures):
            clock.hold(self.number, seconds)
            if clock.wait_until(self.stopping, seconds):
                return
            due = max(seconds + next(self._delays), clock.seconds())
            clock.hold((self.number, number), due)
            clock.release(self.number)
            with self._lock:
                fault = fault_of(self._faults, number)
                kind = fault.kind if fault else None
                self._record.append(SentFrame(number, seconds, None, kind))
            jpeg = _marked(self._picture(self.number, seconds), number)
            if kind == "repeat":
                jpeg = before or jpeg
            before = jpeg
            if kind == "tear":
                jpeg = torn(jpeg, number)
            self._cut(kind == "cut")
            if kind in {"drop", "cut"}:
                self.let_go(number)
                continue
            held.append(_Outgoing(number, due, jpeg))
            if kind == "stall" and fault is not None and number + 1 < fault.first + fault.count:
                self.let_go(number)
                continue
            self._hand_out(held)
            held.clear()

    def _hand_out(self, frames: Sequence[_Outgoing]) -> None:
        waited_for = set()
        with self._lock:
            for client, frame in itertools.product(self._clients, frames):
                with suppress(queue.Full):  # a client that does not keep up: the record says so
                    client.put_nowait(frame)
                    waited_for.add(frame.number)
        for frame in frames:
            if frame.number not in waited_for:
                self.let_go(frame.number)

    def _cut(self, is_cut: bool) -> None:
        """Hangs up on all clients, and takes none until it is called again."""
        with self._lock:
            self._is_cut = is_cut
            clients = self._clients if is_cut else []
            self._clients = [] if is_cut else self._clients
        for client in clients:
            with suppress(queue.Full):  # it sees that it is no client any more when it has sent what waits
                client.put_nowait(None)

    def is_attached(self, client: "queue.Queue[_Outgoing | None]") -> bool:
        with self._lock:
            return client in self._clients


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, camera: _Camera) -> None:
        self.camera = camera
        super().__init__(("127.0.0.1", 0), _Handler)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = CLIENT_SECONDS

    def do_GET(self) -> None:
        camera = self.server.camera
        address = urlsplit(self.path)
        if address.path == "/stream":
            self._stream(camera)
        elif address.path == "/control":
            self._control(camera, dict(parse_qsl(address.query)))
        else:
            self.send_error(404)

    def log_message(self, format: str, *arguments: object) -> None:  # noqa: A002 - the name that http.server gives it
        """Nothing on standard error."""

    def _stream(self, camera: _Camera) -> None:
        self.close_connection = True
        client = camera.attach()
        if client is None:
            return
        try:
            self.send_response(200)
            self.send_header("Cache-Control", "no-store")
            self.send_header("Content-Type", f"multipart/x-mixed-replace;boundary={BOUNDARY}")
            self.end_headers()
            self.wfile.write(f"--{BOUNDARY}\r\n".encode())
            while not camera.stopping.is_set():
                try:
                    frame = client.get(timeout=POLL_SECONDS)
                except queue.Empty:
                    if camera.is_attached(client):
                        continue
                    return
                if frame is None:
                    return
                try:
                    if clock.wait_until(camera.stopping, frame.due):
                        return
                    head = f"Content-Type: image/jpeg\r\nContent-Length: {len(frame.jpeg)}\r\n\r\n"
                    before = clock.receipts(camera.number)
                    self.wfile.write(b"".join((head.encode(), frame.jpeg, f"\r\n--{BOUNDARY}\r\n".encode())))
                    clock.wait_for_receipt(camera.number, before)
                finally:
                    camera.let_go(frame.number)
                camera.note_sent(frame.number)
        except OSError:
            return  # the client has gone
        finally:
            camera.detach(client)

    def _control(self, camera: _Camera, asked: dict[str, str]) -> None:
        try:
            values = {name: float(value) for name, value in asked.items()}
        except ValueError:
            values = {"": 0.0}
        if not values.keys() <= camera.settings.keys():
            self.send_error(400, "expected exposure=MS and gain=SHARE")
            return
        camera.settings.update(values)
        answer = json.dumps(camera.settings).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)


def _marked(jpeg: bytes, number: int) -> bytes:
    """`jpeg` with a comment (COM, ITU-T T.81 B.2.4.5) behind its start that tells the number of the exposure."""
    text = f"exposure {number}".encode()
    return jpeg[:2] + b"\xff\xfe" + (len(text) + 2).to_bytes(2, "big") + text + jpeg[2:]

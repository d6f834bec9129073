"""Stop of a console, a process of its own with a virtual board, while others hold its connections."""

import re
import resource
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from live_command import Scanner, order, scanners
from waiting import LONG_SECONDS

sys.path.insert(0, str(Path(__file__).parents[1] / "pipelines" / "console"))

from stand_in import deliver_made_up

pytestmark = pytest.mark.real_time  # a server is to stop heads within 0.3 s

WITHIN_SECONDS = 0.3
PAGE = "b" * 16
Hold = Callable[[int], list[socket.socket]]


@pytest.fixture
def scanner(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-6.0, -6.0, -6.0))


@pytest.fixture
def many_files() -> Iterator[None]:
    """This process holds thousands of connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def get(path: str) -> bytes:
    accept = "text/event-stream" if path.startswith("/events") else "*/*"
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: {accept}\r\n\r\n".encode()


def post(name: str, port: int, length: int) -> bytes:
    head = f"POST /do/{name} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n"
    return f"{head}X-Footscan-Page: {PAGE}\r\nContent-Length: {length}\r\n\r\n".encode()


HELD: dict[str, tuple[int, Callable[[int, int], bytes]]] = {
    "nothing": (0, lambda _k, _port: b""),
    "idle": (1100, lambda _k, _port: b""),
    "half heads": (600, lambda _k, _port: b"GET / HTTP/1.1\r\nHost: 127"),
    "half bodies": (600, lambda _k, port: post("scan", port, 40) + b'{"patient"'),
    "half stops": (100, lambda _k, _port: b"POST /do/stop HTTP/1.1\r\nHost: 127.0.0.1\r\n"),
    "foot pages": (60, lambda _k, _port: get("/foot/P7/S1")),
    "downloads": (200, lambda _k, _port: get("/results/P7/S1/foot.ply")),
    "event streams": (200, lambda k, _port: get(f"/events?page={k:016d}")),
}
QUICK = {"nothing", "half bodies", "downloads", "event streams"}


@pytest.mark.parametrize(
    "held", [held if held in QUICK else pytest.param(held, marks=pytest.mark.slow) for held in HELD]
)
@pytest.mark.usefixtures("many_files")
def test_stop_is_behind_nothing(scanner: Scanner, held: str) -> None:
    folder = scanner.folder / "results" / "P7" / "S1"
    folder.mkdir(parents=True)
    deliver_made_up(folder, "right")
    (folder / "foot.ply").write_bytes(bytes(20_000_000))
    process = scanner.started("console")
    port = port_of(scanner.address)
    count, begun = HELD[held]
    with ExitStack() as stack:
        for k in range(count):
            connection = stack.enter_context(socket.create_connection(("127.0.0.1", port), LONG_SECONDS))
            connection.sendall(begun(k, port))
        pressed = time.monotonic()
        assert stop(port).startswith(b"HTTP/1.1 204")
        answered = time.monotonic() - pressed
        time.sleep(max(pressed + WITHIN_SECONDS - time.monotonic(), 0.0))
        time.sleep(0.5)
        scanner.assert_dark_and_standing(pressed + WITHIN_SECONDS)
    assert answered < WITHIN_SECONDS
    process.terminate()
    said = process.communicate(timeout=LONG_SECONDS)[1]
    assert "Traceback" not in said
    assert len(said) < 2000, said


@pytest.fixture
def far(tmp_path: Path) -> Iterator[Scanner]:
    """Its heads need two seconds to their home switches."""
    yield from scanners(tmp_path, (-200.0, -200.0, -200.0))


@pytest.mark.parametrize(("stage", "heads"), [("homing", "far"), ("travelling", "scanner")])
def test_stop_waits_for_nothing_that_the_heads_do(stage: str, heads: str, request: pytest.FixtureRequest) -> None:
    scanner: Scanner = request.getfixturevalue(heads)
    process = scanner.start("console")
    assert process.stdout is not None
    address = str(process.stdout.readline()).strip()
    port = port_of(address)
    order(address, "connect", when_idle=True)
    if stage == "homing":
        order(address, "home", when_idle=True)
        time.sleep(0.4)
    else:
        order(address, "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
        scanner.wait_until_busy("console", process)
    pressed = time.monotonic()
    assert stop(port).startswith(b"HTTP/1.1 204")
    assert time.monotonic() - pressed < WITHIN_SECONDS
    time.sleep(0.8)
    scanner.assert_dark_and_standing(pressed + WITHIN_SECONDS)


def test_many_stops_at_once_are_all_answered(scanner: Scanner) -> None:
    scanner.started("console")
    port = port_of(scanner.address)
    answers: list[bytes] = []
    threads = [threading.Thread(target=lambda: answers.append(stop(port))) for _ in range(40)]
    pressed = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 40
    assert all(answer.startswith((b"HTTP/1.1 204", b"HTTP/1.1 503")) for answer in answers)
    time.sleep(0.8)
    scanner.assert_dark_and_standing(pressed + WITHIN_SECONDS)


def test_what_does_not_come_whole_is_let_go(scanner: Scanner) -> None:
    process = scanner.start("console")
    assert process.stdout is not None
    port = port_of(str(process.stdout.readline()).strip())
    with socket.create_connection(("127.0.0.1", port), LONG_SECONDS) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n")
        begun = time.monotonic()
        assert connection.recv(4096).startswith(b"HTTP/1.1 408")
        assert 4.0 < time.monotonic() - begun < 10.0


def test_an_order_of_another_site_stops_nothing(scanner: Scanner) -> None:
    scanner.started("console")
    port = port_of(scanner.address)
    assert stop(port, origin="http://evil.example").startswith(b"HTTP/1.1 403")
    assert scanner.board.laser_at(time.monotonic()) > 0.0
    assert stop(port).startswith(b"HTTP/1.1 204")


def test_refused_stops_are_in_nobody_s_way(scanner: Scanner) -> None:
    scanner.started("console")
    port = port_of(scanner.address)
    refused: list[bytes] = []
    ended = threading.Event()

    def flood() -> None:
        while not ended.is_set():
            refused.append(stop(port, origin="http://evil.example"))

    threads = [threading.Thread(target=flood) for _ in range(30)]
    for thread in threads:
        thread.start()
    time.sleep(0.3)
    pressed = time.monotonic()
    answer = stop(port)
    ended.set()
    for thread in threads:
        thread.join()
    assert answer.startswith(b"HTTP/1.1 204")
    assert all(one.startswith(b"HTTP/1.1 403") for one in refused if one)
    time.sleep(0.8)
    scanner.assert_dark_and_standing(pressed + WITHIN_SECONDS)


def test_a_token_is_asked_for_on_loopback_too(scanner: Scanner) -> None:
    process = scanner.start("console", more=("--token",))
    assert process.stdout is not None
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)\n", str(process.stdout.readline()))
    assert found is not None
    port, token = int(found[1]), found[2]
    assert stop(port).startswith(b"HTTP/1.1 401")
    with socket.create_connection(("127.0.0.1", port), LONG_SECONDS) as connection:
        connection.sendall(get("/"))
        assert connection.recv(4096).startswith(b"HTTP/1.1 401")
    with socket.create_connection(("127.0.0.1", port), LONG_SECONDS) as connection:
        connection.sendall(get(f"/?token={token}"))
        answer = connection.recv(4096)
    assert answer.startswith(b"HTTP/1.1 303")
    assert b"set-cookie: footscan_console=" + token.encode() in answer


def stop(port: int, origin: str | None = None) -> bytes:
    own = f"http://127.0.0.1:{port}"
    with socket.create_connection(("127.0.0.1", port), LONG_SECONDS) as connection:
        connection.sendall(post("stop", port, 2).replace(own.encode(), (origin or own).encode()) + b"{}")
        return connection.recv(4096)


def port_of(address: str) -> int:
    """The port in an address that a console prints."""
    return int(address.rstrip("/").rsplit(":", maxsplit=1)[1])

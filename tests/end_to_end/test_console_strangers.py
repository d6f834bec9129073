"""Who may not use the console, a process of its own: another site's page, and another account of the same computer."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from chromium import Opened, needs_chromium
from playwright.sync_api import expect

pytestmark = [needs_chromium, pytest.mark.real_time]  # a server and its clients are processes and threads of their own

RIG = """\
format: footscan.rig/1
scanner: S1
port: no-board
cameras:
  - {id: 1, device: "http://127.0.0.1:9/stream"}
"""


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., str]]:
    """Starts the command over a rig of which nothing is plugged in, and tells the address that it prints."""
    (tmp_path / "rig.yaml").write_text(RIG)
    running = []

    def start(*options: str) -> str:
        line = [str(Path(sys.executable).with_name("footscan")), "console", "--port", "0", *options]
        pipe = subprocess.PIPE
        running.append(subprocess.Popen(line, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True))
        assert running[-1].stdout is not None
        return str(running[-1].stdout.readline()).strip()

    yield start
    for one in running:
        one.terminate()
        one.communicate(timeout=60)


class _Site(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        """A page without anything on it."""
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing is said."""


@pytest.fixture
def site() -> Iterator[str]:
    """Another site: its name is another one than the console's."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Site) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://localhost:{server.server_address[1]}/"
        server.shutdown()
        thread.join()


def test_another_site_leads_nobody_to_the_state(started: Callable[..., str], site: str, browser: Any) -> None:
    address = started().removesuffix("/")
    context = browser.new_context()
    operator = Opened(context.new_page(), address)
    expect(operator.page.locator("#state-name")).to_have_text("Failed")
    foreign = context.new_page()
    foreign.goto(site)
    events = f"{address}/events?page={'e' * 16}"
    with foreign.expect_navigation() as led:
        foreign.evaluate("address => { location.href = address }", events)
    assert led.value.status == 403
    expect(operator.page.locator("#told")).to_contain_text("asked this scanner for /events and was refused")
    expect(operator.page.locator("#others")).to_be_hidden()
    foreign.goto(site)
    heard = "address => new Promise(end => Object.assign(new EventSource(address), {onopen: () => end('open'),"
    assert foreign.evaluate(f"{heard} onerror: () => end('refused')}}))", events) == "refused"
    context.close()


def test_a_token_is_asked_for_on_loopback(started: Callable[..., str], browser: Any) -> None:
    printed = started("--token")
    address, _, token = printed.partition("?token=")
    assert address.startswith("http://127.0.0.1:")
    assert len(token) >= 40
    mine, other = browser.new_context(), browser.new_context()
    opened = Opened(mine.new_page(), printed, "")
    expect(opened.page.locator("#state-name")).to_have_text("Failed")
    assert opened.page.url == address, "the token stands in no address that is seen"
    page = other.new_page()
    assert page.goto(address).status == 401
    assert page.goto(f"{address}events?page={'e' * 16}").status in {401, 403}
    mine.close()
    other.close()

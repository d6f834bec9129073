"""Stop, pressed on a page of a real browser whose connections are all taken; the console is a process of its own."""

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from chromium import Opened, needs_chromium
from live_command import COMMANDS, WITHIN_SECONDS, Scanner, order, scanners
from playwright.sync_api import TimeoutError as NotLoadedError
from playwright.sync_api import expect

pytestmark = [needs_chromium, pytest.mark.real_time]  # a server is to stop heads within 0.3 s

TABS = 6
"""As many connections as a browser has for one port of a server; each page follows the state by one of them."""


@pytest.fixture
def scanner(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-6.0, -6.0, -6.0))


@pytest.fixture
def context(browser: Any) -> Iterator[Any]:
    one = browser.new_context()
    yield one
    one.close()


def test_stop_does_not_wait_for_connections_of_other_tabs(scanner: Scanner, context: Any) -> None:
    process = scanner.start("console")
    assert process.stdout is not None
    address = str(process.stdout.readline()).strip()
    tabs = [Opened(context.new_page(), address).page for _ in range(TABS - 1)]
    with suppress(NotLoadedError):  # it waits for a connection: none is left then
        tabs.append(Opened(context.new_page(), address).page)
    for tab in tabs:
        expect(tab.locator("#state-name")).not_to_have_text("Connecting to the server")
    order(address, "take-over")
    order(address, "connect", when_idle=True)
    order(address, "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
    scanner.wait_until_busy("console", process)
    pressed = time.monotonic()
    tabs[-1].keyboard.press("Escape")
    time.sleep(max(pressed + WITHIN_SECONDS - time.monotonic(), 0.0) + 0.5)
    scanner.assert_dark_and_standing(pressed + WITHIN_SECONDS)
    expect(tabs[-1].locator("#told")).to_be_hidden()
    expect(tabs[0].locator("#state-words")).to_have_text("stopped; nothing of this scan is kept")


def test_a_page_with_a_token_stops_by_the_port_of_stop(
    scanner: Scanner, context: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(COMMANDS, "console", (*COMMANDS["console"], "--token"))
    process = scanner.start("console")
    assert process.stdout is not None
    opened = Opened(context.new_page(), str(process.stdout.readline()).strip())
    page = opened.page
    expect(page.locator("#state-name")).to_have_text("Ready")
    page.fill("#patient", "P1")
    page.select_option("#posture", "half_weight")
    page.click("#start")
    scanner.wait_until_busy("console", process)
    with page.expect_response(lambda answer: answer.url.endswith("/do/stop")) as answered:
        page.keyboard.press("Escape")
    assert answered.value.status == 204
    assert not answered.value.url.startswith(page.url), "another port than the page's"
    expect(page.locator("#state-words")).to_have_text("stopped; nothing of this scan is kept")
    assert opened.complaints == []

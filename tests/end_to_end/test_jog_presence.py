"""A jog from the operator's page ends when the page that began it has gone for half a second."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from live_command import Scanner, order, scanners
from waiting import wait_until

pytestmark = pytest.mark.real_time  # heads move until half a second after a page is gone

GONE_SECONDS = 0.5
STOP_SECONDS = 0.3
FAR_MM = 300.0
"""15 s at the 20 mm/s of a jog from the page."""


@pytest.fixture
def scanner(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-6.0, -6.0, -6.0))


@pytest.fixture
def page(scanner: Scanner, browser: Any) -> Iterator[Any]:
    """The operator's page of a console, heads homed, whose button +50 mm moves them farther than that."""
    process = scanner.start("console")
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    context = browser.new_context()
    page = context.new_page()
    page.goto(address)
    page.get_by_text("Move heads by hand").click()
    page.locator("#home[aria-disabled=false]").click()
    page.locator("#home[aria-disabled=true]").wait_for()
    page.locator("#home[aria-disabled=false]").wait_for(timeout=60_000)
    page.evaluate(f"document.querySelector('[data-jog=\"50\"]').dataset.jog = {FAR_MM:g}")
    yield page
    context.close()


def close(page: Any) -> None:
    page.close()


def cut_off(page: Any) -> None:
    page.context.set_offline(True)


def leave(page: Any) -> None:
    page.goto("about:blank")


def hang(page: Any) -> None:
    page.evaluate("() => { setTimeout(() => { const end = Date.now() + 4000; while (Date.now() < end); }, 0); }")


@pytest.mark.parametrize("go", [close, *(pytest.param(way, marks=pytest.mark.slow) for way in (cut_off, leave, hang))])
def test_heads_stop_when_the_page_is_gone(go: Callable[[Any], None], scanner: Scanner, page: Any) -> None:
    begin = scanner.board.position_at(time.monotonic())[0]
    page.locator(f'[data-jog="{FAR_MM:g}"]').click()
    wait_until(lambda: scanner.board.position_at(time.monotonic())[0] > begin + 40.0)  # two seconds: it is present
    began = time.monotonic()
    go(page)
    gone = time.monotonic()
    time.sleep(GONE_SECONDS + STOP_SECONDS + 1.0)
    scanner.assert_dark_and_standing(gone + GONE_SECONDS + STOP_SECONDS)
    assert scanner.board.position_at(began)[0] < scanner.board.position_at(time.monotonic())[0] < FAR_MM


def test_heads_go_all_the_way_while_the_page_is_there(scanner: Scanner, page: Any) -> None:
    begin = scanner.board.position_at(time.monotonic())[0]
    page.locator('[data-jog="-50"]').evaluate("button => { button.dataset.jog = 100; button.click(); }")
    wait_until(lambda: scanner.board.position_at(time.monotonic())[0] > begin + 99.9)
    page.locator("#home[aria-disabled=false]").wait_for()
    assert page.locator("#told").is_hidden()


def test_an_order_without_a_page_moves_for_half_a_second(scanner: Scanner) -> None:
    process = scanner.start("console")
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    order(address, "connect", when_idle=True)
    order(address, "home", when_idle=True)
    order(address, "jog", b'{"mm": 300}', when_idle=True)
    time.sleep(2.0)
    scanner.assert_dark_and_standing(time.monotonic() - 0.8)
    assert 0.0 < scanner.board.position_at(time.monotonic())[0] + 18.0 < 20.0 * (GONE_SECONDS + STOP_SECONDS + 0.2)

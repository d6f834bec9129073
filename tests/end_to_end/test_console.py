"""The operator's page in a real browser: a whole session of two feet, by mouse and by keyboard, and what goes wrong."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import Opened as OpenedPage
from chromium import needs_chromium
from playwright.sync_api import expect
from served import console_stand_in, served

from pipelines.console.console import Console

pytestmark = [needs_chromium, pytest.mark.real_time]  # a browser waits for a server beside a stand-in that films

DESKTOP, UPRIGHT, ACROSS = (1280, 800), (768, 1024), (1024, 768)
HOSTILE = "<img src=x onerror=document.title='owned'>"
TARGETS_PX = 40
"""Least height of what is touched."""


class Opened(OpenedPage):
    """A page of the console."""

    def state(self, name: str) -> None:
        """Waits until the page tells this state."""
        expect(self.page.locator("#state-name")).to_have_text(name)

    def tab_to(self, what: str) -> None:
        """Goes on by the tabulator key until an element of a selector has the focus."""
        for _ in range(60):
            if self.page.evaluate("what => document.activeElement.matches(what)", what):
                return
            self.page.keyboard.press("Tab")
        raise AssertionError(f"no way to {what} by keyboard")


@pytest.fixture
def scanner(tmp_path: Path) -> Any:
    return console_stand_in(tmp_path / "results", step_seconds=0.02)


@pytest.fixture
def console(scanner: Any, tmp_path: Path) -> Iterator[Console]:
    with Console(scanner, tmp_path / "archive", tmp_path / "results") as one:
        yield one


@pytest.fixture
def address(console: Console) -> Iterator[str]:
    """Of a server that runs."""
    with served(console) as at:
        yield at


@pytest.fixture
def show(browser: Any, address: str) -> Iterator[Callable[..., Opened]]:
    contexts = []

    def opened(size: tuple[int, int] = DESKTOP, path: str = "", **options: Any) -> Opened:
        contexts.append(browser.new_context(viewport={"width": size[0], "height": size[1]}, **options))
        return Opened(contexts[-1].new_page(), address, path)

    yield opened
    for context in contexts:
        context.close()


def test_two_feet_by_mouse(show: Callable[..., Opened], scanner: Any) -> None:
    opened = show()
    page = opened.page
    opened.state("Not connected")
    page.click("#connect")
    opened.state("Ready")
    page.click("#home")
    expect(page.locator("#device-list")).to_contain_text("Head 3 at X = -18.0 mm")
    page.fill("#patient", "P0001")
    expect(page.locator("#start-told")).to_have_text("Choose the posture.")
    page.select_option("#posture", "standing")
    page.click("#start")
    page.wait_for_selector("#verdict.good")
    assert page.locator("h1").inner_text() == "Right foot P0001 2026-11-20-R"
    page.wait_for_selector("#canvas")
    page.click("#other")
    page.wait_for_url("**/foot/P0001/2026-11-20-L")
    page.click("#pair")
    page.wait_for_url("**/pair/P0001/2026-11-20-L/2026-11-20-R")
    assert "Sizes for both" in page.locator("main").inner_text()
    page.click("#new-person")
    page.wait_for_url(opened.address + "/")
    expect(page.locator("#who")).to_have_text("Nobody yet.")
    assert page.input_value("#patient") == ""
    assert scanner.calls == ["connect", "home", "film P0001 right standing False", "film P0001 left standing False"]
    opened.is_clean()


def test_two_feet_by_keyboard_on_a_tablet(show: Callable[..., Opened], scanner: Any) -> None:
    opened = show(UPRIGHT)
    page, keyboard = opened.page, opened.page.keyboard
    opened.state("Not connected")
    opened.tab_to("#connect")
    keyboard.press("Enter")
    opened.state("Ready")
    opened.tab_to("#patient")
    keyboard.type("P-2_b")
    opened.tab_to("input[name=side]")
    keyboard.press("ArrowLeft")
    expect(page.locator("#start")).to_have_text("Scan the left foot")
    opened.tab_to("#posture")
    keyboard.press("ArrowDown")
    opened.tab_to("#start")
    keyboard.press("Enter")
    page.wait_for_url("**/foot/P-2_b/2026-11-20-L")
    page.wait_for_selector("#verdict")
    expect(page.locator("#other")).to_have_attribute("aria-disabled", "false")
    assert page.evaluate("document.activeElement.id") == "result", "what is new is read first"
    opened.tab_to("#other")
    keyboard.press("Enter")
    page.wait_for_url("**/foot/P-2_b/2026-11-20-R")
    page.wait_for_selector("#pair:not([hidden])")
    opened.tab_to("#pair")
    keyboard.press("Enter")
    page.wait_for_url("**/pair/P-2_b/2026-11-20-L/2026-11-20-R")
    assert scanner.calls == ["connect", "film P-2_b left half_weight False", "film P-2_b right half_weight False"]
    opened.is_clean()


def test_a_pseudonym_is_checked_as_typed(show: Callable[..., Opened], scanner: Any) -> None:
    opened = show()
    page = opened.page
    scanner.connect()
    scanner.tell_again()
    opened.state("Ready")
    told, start = page.locator("#patient-told"), page.locator("#start")
    expect(page.locator("#start-told")).to_have_text("A pseudonym is missing.")
    page.locator("#patient").press_sequentially("P 1/ä")
    expect(told).to_have_text("Only letters, digits, - and _ are allowed, no space, “/”, “ä”.")
    assert page.get_attribute("#patient", "aria-invalid") == "true"
    assert start.get_attribute("aria-disabled") == "true"
    page.keyboard.press("Enter")
    page.fill("#patient", HOSTILE)
    expect(told).to_contain_text("“<”")
    assert page.title() == "footscan"
    page.fill("#patient", "P1")
    page.select_option("#posture", "unknown")
    expect(start).to_have_attribute("aria-disabled", "false")
    assert scanner.calls == ["connect"]
    opened.is_clean()


@pytest.mark.parametrize("way", ["key", "button", "key on a result"])
def test_a_scan_is_stopped(way: str, show: Callable[..., Opened], scanner: Any, console: Console) -> None:
    scanner.connect()
    if way == "key on a result":
        scanner.film("P1", "right", keep_partial=False)
    opened = show()
    page = opened.page
    opened.state("Done" if way == "key on a result" else "Ready")
    scanner.pause = {"filming"}
    page.select_option("#posture", "half_weight")
    page.fill("#patient", "P1")
    page.locator("#patient").press("Enter")
    opened.state("Filming")
    assert scanner.reached.wait(60)
    if way == "key on a result":
        page.goto(f"{opened.address}/foot/P1/2026-11-20-R")
        page.locator("#canvas").focus()
    assert scanner.lit
    if way == "button":
        page.click("#stop")
    else:
        page.keyboard.press("Escape")
    opened.state("Failed")
    assert not scanner.lit
    assert "stop" in scanner.calls
    expect(page.locator("#state-words")).to_have_text("stopped; nothing of this scan is kept")
    assert console.seen_by("x")["sitting"]["feet"] == []
    opened.is_clean()


def test_door_alarm_lost_camera_and_the_way_back(show: Callable[..., Opened], scanner: Any) -> None:
    opened = show(ACROSS)
    page = opened.page
    scanner.words_of_camera = HOSTILE
    scanner.connect()
    scanner.pause = {"filming"}
    opened.state("Ready")
    expect(page.locator("#device-list")).to_contain_text(HOSTILE)
    page.fill("#patient", "P1")
    page.select_option("#posture", "sitting")
    page.click("#start")
    opened.state("Filming")
    assert scanner.reached.wait(60)
    expect(page.locator("#progress")).to_be_visible()
    expect(page.locator("#count")).to_contain_text("frames of 8 cameras")
    expect(page.locator("#camera-8 img")).to_have_attribute("alt", "Camera 8 now, with the stripe found")
    scanner.door_open = True
    scanner.tell_again()
    opened.state("Door open")
    scanner.lost_camera, scanner.next_problem = 3, f"camera 3: the connection was lost {HOSTILE}"
    scanner.go.set()
    page.click("#resume")
    opened.state("Failed")
    expect(page.locator("#do")).to_contain_text("Camera 3: check its cable and hub, then connect.")
    expect(page.locator("#camera-3 .dark")).to_be_visible()
    page.click("#connect")
    opened.state("Ready")
    scanner.alarm = True
    scanner.tell_again()
    opened.state("Alarm")
    expect(page.locator("#start-told")).to_have_text("Home the heads first.")
    page.click("#home")
    opened.state("Ready")
    scanner.pause = set()
    page.click("#start")
    page.wait_for_url("**/foot/P1/2026-11-20-R")
    assert page.title() != "owned"
    opened.is_clean()


def test_a_second_page_looks_on_and_takes_over(show: Callable[..., Opened], scanner: Any) -> None:
    scanner.connect()
    first = show()
    first.state("Ready")
    second = show(UPRIGHT)
    second.state("Ready")
    expect(first.page.locator("#others")).to_be_hidden()
    expect(second.page.locator("#others")).to_be_visible()
    expect(second.page.locator("#home")).to_have_attribute("aria-disabled", "true")
    second.page.click("#take-over")
    expect(first.page.locator("#others")).to_be_visible()
    expect(second.page.locator("#others")).to_be_hidden()
    second.page.click("#home")
    expect(second.page.locator("#device-list")).to_contain_text("Head 1 at X = -18.0 mm")
    first.page.keyboard.press("Escape")
    expect(first.page.locator("#stop")).not_to_have_class("pressed")
    assert scanner.calls == ["connect", "home", "stop"]
    first.is_clean()
    second.is_clean()


@pytest.mark.parametrize("size", [DESKTOP, UPRIGHT, ACROSS])
def test_pages_fit_and_can_be_touched(size: tuple[int, int], show: Callable[..., Opened], scanner: Any) -> None:
    scanner.connect()
    scanner.film("P1", "right", keep_partial=False)
    scanner.film("P1", "left", keep_partial=False)
    for path in ("/", "/foot/P1/2026-11-20-R", "/pair/P1/2026-11-20-L/2026-11-20-R"):
        opened = show(size, path)
        opened.state("Done")
        page = opened.page
        assert page.evaluate("document.documentElement.scrollWidth") == size[0]
        stop = page.locator("#stop").bounding_box()
        page.mouse.wheel(0, 4000)
        assert page.locator("#stop").bounding_box() == stop, "it stays where it is"
        assert min(stop["height"], stop["width"]) >= 60
        for button in page.locator("button, a.button, #patient, select").all():
            if button.is_visible() and not button.get_attribute("data-shows"):
                assert button.bounding_box()["height"] >= TARGETS_PX, button.inner_text()
        opened.tab_to("button")
        outline = page.evaluate("parseFloat(getComputedStyle(document.activeElement).outlineWidth)")
        assert outline >= 2, "one sees where the focus is"
        opened.is_clean()


RIG = """\
format: footscan.rig/1
scanner: S1
port: no-board
cameras:
  - {id: 1, device: "http://127.0.0.1:9/stream"}
"""


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """The command, over a rig of which nothing is plugged in."""
    (tmp_path / "rig.yaml").write_text(RIG)
    running = []

    def start(*options: str) -> subprocess.Popen[str]:
        line = [str(Path(sys.executable).with_name("footscan")), "console", "--port", "0", *options]
        pipe = subprocess.PIPE
        running.append(subprocess.Popen(line, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True))
        return running[-1]

    yield start
    for one in running:
        one.kill()
        one.communicate()


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_the_command_prints_its_address_and_ends_dark(started: Callable[..., Any], end: int, browser: Any) -> None:
    command = started()
    address = command.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    context = browser.new_context()
    opened = Opened(context.new_page(), address.removesuffix("/"))
    opened.state("Failed")
    expect(opened.page.locator("#do")).to_contain_text("Controller: check its USB cable and its power")
    command.send_signal(end)
    said = command.communicate(timeout=60)[1]
    context.close()
    assert (command.returncode, said.splitlines()[-1]) == (0, "the lasers are off, the console has ended")


def test_beyond_loopback_the_command_prints_a_token(started: Callable[..., Any], browser: Any) -> None:
    command = started("--host", "0.0.0.0")
    printed = command.stdout.readline().strip()
    assert "ADDRESS-OF-THIS-COMPUTER" in printed
    address, _, token = printed.replace("ADDRESS-OF-THIS-COMPUTER", "127.0.0.1").partition("?token=")
    assert len(token) >= 40
    context = browser.new_context()
    page = context.new_page()
    assert page.goto(address).status == 401
    page.goto(f"{address}?token={token}")
    assert page.url == address, "the token stands in no address that is seen"
    assert page.locator("#stop").is_visible()
    assert page.goto(address).status == 200
    context.close()


def test_the_page_tells_when_the_server_is_gone(show: Callable[..., Opened], console: Console, scanner: Any) -> None:
    scanner.connect()
    opened = show()
    opened.state("Ready")
    console.closing.set()
    console.take_over("c" * 16)  # wakes the streams
    opened.state("No connection to the server")

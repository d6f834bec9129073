"""The page that calibrates, in a real browser: a session by mouse and by keyboard, and what goes wrong on the way."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import Opened, needs_chromium
from playwright.sync_api import expect
from served import console_stand_in, served
from standing_scanner import StandingStandIn

from pipelines.console.console import Console
from pipelines.live.calibrating.guide import Guide
from pipelines.live.calibrating.settings import GuideSettings
from pipelines.live.rig_file import read_rig, write_rig

pytestmark = [needs_chromium, pytest.mark.real_time]  # a browser waits for a server beside a stand-in that films


@pytest.fixture
def glass(recorded: Path) -> StandingStandIn:
    return StandingStandIn(recorded / "capture")


@pytest.fixture
def address(glass: StandingStandIn, tmp_path: Path) -> Iterator[str]:
    write_rig(tmp_path / "rig.yaml", glass.rig)
    settings = GuideSettings(tmp_path / "captures", tmp_path / "rig.yaml", glass.capture.reference)
    guide = Guide(glass, settings, glass.put)
    scanner = console_stand_in(tmp_path / "results")
    scanner.connect()
    with Console(scanner, tmp_path / "archive", tmp_path / "results", guide) as console, served(console) as at:
        yield at


def test_a_scanner_is_calibrated_and_checked(
    browser: Any, address: str, glass: StandingStandIn, tmp_path: Path
) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    opened = Opened(context.new_page(), address)
    page = opened.page
    page.click("text=Calibrate or check")
    name, words, usual = (page.locator(f"#{part}") for part in ("step-name", "step-words", "usual"))

    def press(next_step: str) -> None:
        usual.click()
        expect(name).to_have_text(next_step)
        expect(usual).not_to_have_attribute("aria-disabled", "true")

    press("Place the object")
    expect(page.locator("#placement")).to_have_attribute("alt", re.compile("^The object at Y = 0 mm, 0 mm above"))
    assert page.evaluate("placement.decode().then(() => placement.naturalWidth)") > 0
    usual.click()
    expect(words).to_contain_text(": a virtual object stands there now. Film it.")
    press("Placement 1: good")
    expect(words).to_have_text("Placement 1 is good.")
    expect(page.locator("#stripes")).to_have_attribute("alt", re.compile(r"^camera 1: \d %, .*, camera 8: \d %$"))
    press("Place the object")
    expect(page.locator("#numbers button[aria-label*='= -']")).to_have_count(0)  # a minus, no hyphen
    page.click("[data-action=take]")  # the object was not moved
    expect(name).to_have_text("Placement 2: film again")
    expect(page.locator("#complaints")).to_contain_text("move it 40.0 mm towards +Y and move it 14.0 mm up")

    # From here by the keyboard: the button that had the focus keeps it, whatever it is called.
    usual.focus()
    for says in (
        "Film this placement",
        "Next placement",
        "Put the virtual object there",
        "Film this placement",
        "Next placement",
    ):
        page.keyboard.press("Enter")
        expect(usual).to_have_text(says)
        expect(usual).not_to_have_attribute("aria-disabled", "true")
    page.click("[data-action=finish]")
    expect(name).to_have_text("The scanner is calibrated")
    assert page.locator("#outcome-rows tr").count() == 8
    expect(page.locator("#outcome-picture")).to_be_visible()
    press("The calibration is in use")
    assert read_rig(tmp_path / "rig.yaml").calibration == glass.rig.calibration

    expect(usual).to_have_text("Scan a foot")
    usual.click()
    expect(page.locator("#start")).to_have_text("Scan the right foot")
    page.click("text=Calibrate or check")
    expect(name).to_have_text("Calibrate or check")
    assert usual.inner_text() == "Check the calibration"
    press("Place the object")
    usual.click()
    expect(words).to_contain_text(": a virtual object stands there now. Film it.")
    press("Placement 1: good")
    press("The calibration is checked")
    expect(words).to_contain_text("The calibration holds: every camera is within 0.0")
    expect(page.locator("#outcome-picture")).to_be_hidden()
    opened.is_clean()
    context.close()


def test_what_is_filmed_outlives_the_page_and_can_be_discarded(
    browser: Any, address: str, glass: StandingStandIn, tmp_path: Path
) -> None:
    context = browser.new_context(viewport={"width": 768, "height": 1024})
    page = Opened(context.new_page(), address, "/calibrating").page
    name, usual = page.locator("#step-name"), page.locator("#usual")
    usual.click()
    expect(name).to_have_text("Place the object")
    glass.standing = 0
    page.click("[data-action=take]")
    expect(usual).to_have_text("Next placement")
    page.reload()
    expect(usual).to_have_text("Next placement")
    page.click("[data-action=discard]")
    expect(page.locator("[data-action=discard]")).to_have_text("Remove all frames of this session?")
    assert list((tmp_path / "captures").iterdir()) != []
    page.click("[data-action=discard]")
    expect(name).to_have_text("Calibrate or check")
    assert list((tmp_path / "captures").iterdir()) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    context.close()

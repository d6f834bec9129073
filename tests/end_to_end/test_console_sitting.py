"""Calibrating, and both feet of a person, from the page alone, over the whole virtual scanner: board, cameras, all.

    FOOTSCAN_SITTING=folder pytest tests/end_to_end/test_console_sitting.py -s

It takes about twenty minutes on two cores with nothing beside it, most of them for the pictures of the virtual feet.
The folder keeps them, what was scanned, and pictures of the page in each state: desktop for the right foot, tablet for
the left one.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import pytest
from chromium import Opened, needs_chromium
from playwright.sync_api import expect
from waiting import wait_until

from footscan.virtual.foot.foot import make_foot
from pipelines.console.pages.results import read_measures, read_quality

FOLDER = os.environ.get("FOOTSCAN_SITTING")
pytestmark = [
    needs_chromium,
    pytest.mark.real_time,  # a browser films with the virtual scanner
    pytest.mark.skipif(FOLDER is None, reason="FOOTSCAN_SITTING names no folder for its pictures"),
]

FOOTSCAN = Path(sys.executable).with_name("footscan")
DESKTOP, TABLET = {"width": 1280, "height": 800}, {"width": 768, "height": 1024}
FOOT_SECONDS = 1500.0
"""The longest a foot may take from its start to its page."""
TRIES = 3
"""A host that stands still while it films loses places of frames, and the page says so: one tries again."""
PLACEMENTS = 4
"""Placements of the reference object that are filmed."""
WORK_MS = 300_000
"""The longest that a placement may take to be rendered, filmed and judged, or a scanner to be calibrated."""
LENGTH_MM = 0.5
"""How far the length of a virtual foot may be off."""


class Sitting:
    """The console's page, and what was seen there."""

    def __init__(self, browser: Any, address: str, folder: Path) -> None:
        self.folder = folder
        self.opened = Opened(browser.new_context(viewport=DESKTOP).new_page(), address)
        self.page = self.opened.page

    @property
    def state(self) -> str:
        """What the page tells."""
        return str(self.page.locator("#state-name").inner_text())

    def picture(self, name: str) -> None:
        """As it looks now."""
        self.page.screenshot(path=self.folder / f"{name}.png")

    def scan(self, foot: str) -> None:
        """Follows a scan that was started to its foot's page, with a picture of each state on the way."""
        for number in range(1, TRIES + 1):
            told = self._follow(foot)
            print(foot, "try", number, told)
            if told == "measured":
                expect(self.page.locator("#canvas")).to_be_visible()
                time.sleep(2.0)  # the foot is drawn
                self.page.screenshot(path=self.folder / f"{foot}-measured.png", full_page=True)
                return
            if number < TRIES:
                self.page.click("#start")
        raise AssertionError(told)

    def _follow(self, foot: str) -> str:
        began, before = time.monotonic(), ""
        while not self.page.locator("#verdict").count():
            assert time.monotonic() - began < FOOT_SECONDS, f"{foot}: no page in time, last {before}"
            time.sleep(0.5)
            if not self.page.locator("#state-name").count():
                continue  # the foot's page is on its way
            if (now := self.state) != before:
                before = now
                self.picture(f"{foot}-{now.lower().replace(' ', '-')}")
            if now == "Failed" and time.monotonic() - began > 2.0:
                return str(self.page.locator("#state-words").inner_text())
        return "measured"

    def check_measured(self, side: Literal["right", "left"]) -> None:
        """The page is that of this side, and what was measured is as long as the foot on the glass."""
        patient, scan = self.page.url.split("/")[-2:]
        measured = read_measures(self.folder / "results", patient, scan)
        length_mm = measured.measures["foot_length"].value
        assert measured.side == side
        assert length_mm == pytest.approx(make_foot(side=side).measures["foot_length"], abs=LENGTH_MM)
        print(side, f"{length_mm:.2f} mm", self.page.locator("#verdict h2").inner_text())


@contextmanager
def console(folder: Path) -> Iterator[str]:
    """The address of a console that runs over the virtual scanner."""
    said = folder / "console.txt"
    line = [FOOTSCAN, "console", "--virtual", "--port", "0"]
    with (
        said.open("w") as log,
        subprocess.Popen(line, cwd=folder, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            address = process.stdout.readline().strip().rstrip("/")
            assert address, said.read_text()
            yield address
            process.send_signal(signal.SIGINT)
            assert process.wait(120) == 0
        finally:
            process.kill()


def test_a_scanner_is_calibrated_and_measures_a_foot(browser: Any) -> None:
    folder = Path(str(FOLDER)).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with console(folder) as address:
        sitting = Sitting(browser, address, folder)
        page = sitting.page
        wait_until(lambda: sitting.state == "Ready")
        page.click("text=Calibrate or check")
        name, usual = page.locator("#step-name"), page.locator("#usual")
        expect(usual).to_be_visible()
        if usual.inner_text() != "Calibrate the scanner":
            page.click("[data-action=calibrate]")
        for number in range(1, PLACEMENTS + 1):
            expect(page.locator("#step-words")).to_contain_text(f"Placement {number} of 10")
            for says, then in (("Put the virtual object there", "Film this placement"), (None, "Next placement")):
                if says:
                    expect(usual).to_have_text(says)
                usual.click()
                expect(usual).to_have_text(then, timeout=WORK_MS)
            sitting.picture(f"placement-{number}")
            if number < PLACEMENTS:
                usual.click()
        expect(page.locator("#price")).to_contain_text(f"{PLACEMENTS} of 10 placements: ")
        page.click("[data-action=finish]")
        expect(name).to_have_text("The scanner is calibrated", timeout=WORK_MS)
        sitting.picture("calibrated")
        made = Path(page.locator("#outcome-file").inner_text()).name
        usual.click()
        expect(name).to_have_text("The calibration is in use")
        page.click("text=Scan feet")
        page.fill("#patient", time.strftime("C%Y%m%d-%H%M%S"))
        page.select_option("#posture", "half_weight")
        page.click("#start")
        sitting.scan("right")
        sitting.check_measured("right")
        patient, scan = page.url.split("/")[-2:]
        assert read_quality(folder / "results", patient, scan).calibration.name == made
        sitting.opened.is_clean()


def test_both_feet_in_one_sitting(browser: Any) -> None:
    folder = Path(str(FOLDER)).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with console(folder) as address:
        sitting = Sitting(browser, address, folder)
        page = sitting.page
        wait_until(lambda: sitting.state in ("Ready", "Not connected"))
        sitting.picture("first")
        if sitting.state == "Not connected":
            page.click("#connect")
            wait_until(lambda: sitting.state == "Ready")
        page.fill("#patient", time.strftime("T%Y%m%d-%H%M%S"))
        sitting.picture("ready")
        page.select_option("#posture", "half_weight")
        page.click("#start")
        sitting.scan("right")
        sitting.check_measured("right")
        page.set_viewport_size(TABLET)
        page.click("#other")
        wait_until(lambda: page.locator("#verdict").count() == 0)
        sitting.scan("left")
        sitting.check_measured("left")
        page.click("#pair")
        page.wait_for_url("**/pair/**")
        expect(page.locator("main")).to_contain_text("Sizes for both")
        sitting.picture("pair")
        sitting.opened.is_clean()

"""Every page in a real browser: what it shows, what a hand changes, and that it asks nobody for anything."""

import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote, urlparse

import numpy as np
import pytest
import trimesh
from chromium import Opened as OpenedPage
from chromium import needs_chromium

from footscan.report.comparison.page import comparison_page
from footscan.report.deviation import Deviation
from pipelines.archive.page import FILES, PAGE, write_archive_page
from pipelines.archive.running import ScanEnd
from pipelines.cli.main import run_command
from pipelines.regression.report.page import regress_page
from pipelines.regression.report.result import Accepted, JudgedFigure, JudgedSet, NightResult
from pipelines.tuning.report.page import tune_page
from pipelines.tuning.report.result import Gain, Goal, Trial, TuneResult
from schemas.quality import Comparison

pytestmark = needs_chromium

PHONE, DESKTOP = 375, 1200
HOSTILE = "<img src=x onerror=document.title='owned'>"
"""No slash in it: a file may have this name."""
INK = """canvas => {
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let drawn = 0, red = 0, sum = 0;
  for (let k = 0; k < pixels.length; k += 4) {
    drawn += pixels[k + 3] > 0;
    red += pixels[k] === 179 && pixels[k + 1] === 32 && pixels[k + 2] === 44;
    sum = (sum * 31 + pixels[k] + 3 * pixels[k + 1] + 7 * pixels[k + 2]) % 4294967296;
  }
  return {share: drawn * 4 / pixels.length, red, sum};
}"""
"""Of a canvas: the share that is drawn, the pixels in the red of sections, and a sum over all."""


class Ink(NamedTuple):
    share: float
    red: int
    sum: int


class Opened(OpenedPage):
    """A page that is a file."""

    def __init__(self, page: Any, file: Path) -> None:
        super().__init__(page, file.as_uri())

    def ink(self) -> Ink:
        """What is on the canvas, after the next frame has been drawn."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return Ink(**self.page.locator("#canvas").evaluate(INK))

    def seen(self, what: str) -> list[str]:
        """Texts of the elements of a selector that are seen."""
        return [one.inner_text() for one in self.page.locator(what).all() if one.is_visible()]

    def drag(self, across: int, down: int) -> None:
        box = self.page.locator("#canvas").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + across, y + down, steps=3)
        self.page.mouse.up()


@pytest.fixture
def show(browser: Any) -> Iterator[Callable[..., Opened]]:
    """Opens a file, at the width of a desktop unless told otherwise."""
    contexts = []

    def opened(file: Path, width: int = DESKTOP, **options: Any) -> Opened:
        contexts.append(browser.new_context(viewport={"width": width, "height": 800}, **options))
        return Opened(contexts[-1].new_page(), file)

    yield opened
    for context in contexts:
        context.close()


@pytest.fixture(scope="module")
def pages(measured: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Each page of the product, by its name; file names and notes are as hostile as they can be."""
    bench = tmp_path_factory.mktemp("pages") / "bench"
    shutil.copytree(measured, bench)
    (bench / "calibration.json").rename(bench / f"{HOSTILE}.json")
    workflow = bench / "workflow.yaml"
    workflow.write_text(workflow.read_text().replace("calibration.json", f'"{HOSTILE}.json"'))
    refused = bench / "archive" / HOSTILE / "scan"
    refused.mkdir(parents=True)
    (refused / "scan.yaml").write_text("format: footscan.scan/1\nside: upside down\n")
    assert run_command(["run", str(workflow)]) == 1
    made = {"tune": tune_page(tuned()), "regress": regress_page(a_night()), "compare": compared()}
    for name, page in made.items():
        (bench / f"{name}.html").write_text(page, encoding="utf-8")
    found = {"report": bench / "results/P0001/small/report.html", "index": bench / "results" / PAGE}
    return found | {name: bench / f"{name}.html" for name in made}


def tuned() -> TuneResult:
    goals = [Goal("accuracy", "mm", HOSTILE), Goal("completeness", "%", "share of the truth", larger_is_better=True)]
    trials = [
        Trial(
            number,
            {"extraction.largest_width_px": number, "extraction.centre_method": HOSTILE},
            {"accuracy": 0.1 / (1 + number), "completeness": 90.0 + number},
            {},
            {HOSTILE: HOSTILE} if number == 9 else {},
            number == 8,
        )
        for number in range(10)
    ]
    gains = [Gain(goal, {HOSTILE: (0.1, 0.09), "P1/a": (0.2, 0.1)}) for goal in goals]
    return TuneResult(goals, "tpe", [HOSTILE], trials, trials[8], gains, [], [])


def a_night() -> NightResult:
    now = datetime(2026, 11, 20, 3, tzinfo=UTC)
    figures = [
        JudgedFigure(
            f"measures.some_long_name_of_a_figure_{verdict}_mm", 2.5, 2.0, 0.1, "less", None, verdict, [2.0, 2.5]
        )
        for verdict in ("worse", "better", "same")
    ]
    sets = (JudgedSet(HOSTILE, HOSTILE, figures), JudgedSet("good", None, figures[2:]))
    accepted = [Accepted(HOSTILE, now, "ann", "footscan 0")]
    return NightResult(
        suite=HOSTILE, time=now, software="footscan 1", sets=sets, accepted=accepted, nights=[now], host=HOSTILE
    )


def compared() -> str:
    mesh = trimesh.creation.box(extents=(100, 60, 40))
    figures: dict[str, Any] = dict.fromkeys(("mean", "std", "min", "max", "p50", "p90", "p95", "p99", "rms"), 0.2)
    shown = Deviation(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.linspace(-1, 1, 8), True, "left")
    return comparison_page(HOSTILE, f"{HOSTILE}.stl", Comparison(**figures, signed_mean=0.1), shown, None)


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
@pytest.mark.parametrize("name", ["report", "index", "tune", "regress", "compare"])
def test_a_page_stands_alone_fits_and_takes_names_as_data(
    name: str, width: int, pages: dict[str, Path], show: Callable[..., Opened], tmp_path: Path
) -> None:
    opened = show(pages[name], width)
    page = opened.page
    page.screenshot(path=tmp_path / f"{name}-{width}.png", full_page=True)  # to be looked at, in pytest's folder
    assert opened.complaints == []
    beside = {unquote(urlparse(url).path) for url in opened.requests if not url.startswith("data:")}
    pictures = set((pages[name].parent / FILES).glob("*.png")) if name == "index" else set()
    assert beside == {str(pages[name]), *map(str, pictures)}
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.title() != "owned"
    assert page.locator("[onerror]").count() == 0
    assert HOSTILE in page.locator("body").inner_text()
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(28, 37, 48)"
    assert (
        page.locator("section").first.evaluate("one => getComputedStyle(one).backgroundColor") == "rgb(255, 255, 255)"
    )


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
@pytest.mark.parametrize("name", ["report", "compare"])
def test_a_surface_is_turned_by_mouse_and_keyboard(
    name: str, width: int, pages: dict[str, Path], show: Callable[..., Opened]
) -> None:
    opened = show(pages[name], width)
    canvas = opened.page.locator("#canvas")
    canvas.scroll_into_view_if_needed()
    first = opened.ink()
    assert 0.05 < first.share < 0.8
    opened.drag(60, 20)
    dragged = opened.ink()
    assert dragged.sum != first.sum
    assert 0.05 < dragged.share < 0.8
    canvas.focus()
    opened.page.keyboard.press("ArrowLeft")
    turned = opened.ink()
    assert turned.sum != dragged.sum
    opened.page.keyboard.press("+")
    assert opened.ink().share > turned.share
    opened.page.keyboard.press("Home")
    assert opened.ink() == first
    opened.page.locator("[data-view=above]").click()
    assert opened.ink().sum != first.sum


def test_a_surface_is_turned_by_a_finger_and_enlarged_by_two(
    pages: dict[str, Path], show: Callable[..., Opened]
) -> None:
    opened = show(pages["report"], PHONE, has_touch=True, is_mobile=True)
    opened.page.locator("#canvas").scroll_into_view_if_needed()
    box = opened.page.locator("#canvas").bounding_box()
    touch = opened.page.context.new_cdp_session(opened.page)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def fingers(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x + right, "y": y + down, "id": number} for number, (right, down) in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    first, scrolled = opened.ink(), opened.page.evaluate("scrollY")
    fingers("touchStart", (0, 0))
    fingers("touchMove", (20, 30))
    fingers("touchMove", (40, 60))
    fingers("touchEnd")
    turned = opened.ink()
    assert turned.sum != first.sum
    assert opened.page.evaluate("scrollY") == scrolled
    fingers("touchStart", (-20, 0), (20, 0))
    fingers("touchMove", (-30, 0), (30, 0))
    fingers("touchMove", (-40, 0), (40, 0))
    fingers("touchEnd")
    assert opened.ink().share > 1.5 * turned.share


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_a_click_on_a_measure_shows_its_section(
    width: int, pages: dict[str, Path], show: Callable[..., Opened]
) -> None:
    opened = show(pages["report"], width)
    assert opened.ink().red == 0
    girth = opened.page.locator("[data-shows=ball_girth]")
    girth.click()
    with_girth = opened.ink()
    assert with_girth.red > 200
    assert opened.seen("#shown")[0].startswith("Ball girth 2")
    assert girth.get_attribute("aria-pressed") == "true"
    box = opened.page.locator("#canvas").bounding_box()
    assert 0 <= box["y"] < 800 - box["height"] / 2, "the foot is seen beside the row that was clicked"
    opened.page.locator("tr:has([data-shows=foot_length]) td").last.click()
    assert opened.ink().red not in {0, with_girth.red}
    assert girth.get_attribute("aria-pressed") == "false"
    opened.page.locator("[data-shows=foot_length]").click()
    assert opened.ink().red == 0
    opened.page.locator("#landmarks").check()
    assert opened.ink().red > 200


def test_colours_are_chosen_and_explained(pages: dict[str, Path], show: Callable[..., Opened]) -> None:
    opened = show(pages["report"])
    sums = []
    for choice, said in enumerate(("blue lies inside", "Measured, ", "Camera 6", "Standard deviation")):
        opened.page.locator("input[name=colouring]").nth(choice).check(force=True)
        sums.append(opened.ink().sum)
        [meaning] = opened.seen("[data-meaning]")
        assert said in meaning
    assert len(set(sums)) == 4


def test_the_stripe_is_followed_by_a_slider(pages: dict[str, Path], show: Callable[..., Opened]) -> None:
    opened = show(pages["report"])
    groups = opened.page.locator("[data-frame]")
    shown = [group for group in groups.all() if group.is_visible()]
    assert len(shown) == 1
    assert groups.count() == 12
    assert shown[0].locator("figure").count() == 8
    opened.page.locator("#moment").fill("3")
    assert [group.is_visible() for group in groups.all()] == [number == 3 for number in range(12)]
    assert opened.page.locator("#frame").inner_text() == groups.nth(3).get_attribute("data-frame")


@pytest.fixture(scope="module")
def archive(measured: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of four scans of two patients, one of which was refused."""
    folder = tmp_path_factory.mktemp("archive")
    shutil.copytree(measured / "results/P0001/small", folder / "P1/R")
    from footscan.recordings.scans import read_scan

    scan = read_scan(measured / "archive/P0001/small").document
    ends = [
        ScanEnd(
            f"{patient}/{name}", measured, folder / "P1/R" if problem is None else None, problem,
            None if problem is None else "refused", {"foot.ply": patient + name},
            document=scan.model_copy(update={"patient": patient, "scan": name, "side": side}),
        )
        for patient, name, side, problem in (
            ("P1", "2026-01-02-R", "right", None), ("P1", "2026-01-02-L", "left", None),
            ("P2", "2026-03-01-L", "left", "cam3.avi: no film"), ("P2", "2025-03-01-R", "right", None),
        )
    ]  # fmt: skip
    write_archive_page(ends, folder)
    return folder / PAGE


def test_an_archive_is_searched_and_sorted(archive: Path, show: Callable[..., Opened]) -> None:
    opened = show(archive)
    scans = "tbody th"
    assert opened.seen(scans) == ["2026-01-02-L", "2026-01-02-R", "2025-03-01-R", "2026-03-01-L"]
    opened.page.locator("[data-sort=date]").click()
    assert opened.seen(scans)[0] == "2025-03-01-R"
    opened.page.locator("[data-sort=date]").click()
    assert opened.seen(scans)[0] == "2026-03-01-L"
    opened.page.locator("#search").fill("p2 right")
    assert opened.seen(scans) == ["2025-03-01-R"]
    assert opened.seen("#count") == ["1 of 4 shown"]
    opened.page.locator("#search").fill("")
    opened.page.locator("#status").select_option("failed")
    assert opened.seen(scans) == ["2026-03-01-L"]
    assert opened.seen(".problem") == ["cam3.avi: no film"]
    opened.page.locator("#status").select_option("")
    link = opened.page.locator("tbody a").first
    assert link.get_attribute("href") == "P1/R/report.html"
    link.click()
    opened.page.wait_for_selector("#canvas")
    assert opened.page.title() == "P0001 small"
    assert opened.complaints == []


@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_both_feet_of_a_patient_stand_beside_each_other(width: int, archive: Path, show: Callable[..., Opened]) -> None:
    opened = show(archive, width)
    opened.page.locator("#pairs").check()
    rows = {row.get_attribute("data-scan"): row.bounding_box() for row in opened.page.locator("tbody tr").all()}
    left, right = rows["2026-01-02-L"], rows["2026-01-02-R"]
    assert left["x"] + left["width"] <= right["x"]
    assert abs(left["y"] - right["y"]) < 2
    assert rows["2026-03-01-L"]["y"] >= left["y"] + left["height"]
    assert opened.page.evaluate("document.documentElement.scrollWidth") == width

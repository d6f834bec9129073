"""The page of a night: its text, its history lines, and escaped names."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser

import pytest

from pipelines.regression.report.lines import HEIGHT, MARGIN, WIDTH, history_line
from pipelines.regression.report.page import regress_page, with_notice
from pipelines.regression.report.result import (
    Accepted,
    Change,
    FirstStep,
    JudgedFigure,
    JudgedSet,
    NightResult,
    Verdict,
)

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
HOSTILE = "<script>alert(1)</script>\"'&"
PNG = b"\x89PNG\r\n\x1a\n"


def figure(
    name: str, value: float | None, verdict: Verdict, accepted: float | None = 0.2, history: Sequence[float | None] = ()
) -> JudgedFigure:
    return JudgedFigure(name, value, accepted, 0.1, "less", None, verdict, [*history, value])


def night(*sets: JudgedSet) -> NightResult:
    return NightResult(
        suite="nightly",
        time=NOON,
        software="footscan 1",
        sets=sets,
        accepted=[Accepted("as filmed", NOON - timedelta(days=3), "ann", "footscan 0")],
        nights=[NOON - timedelta(days=1), NOON],
        host="here",
    )


GOOD = JudgedSet("good", None, [figure("accuracy.mean_mm", 0.21, "same", history=[0.2])])
BAD = JudgedSet(
    "bad",
    None,
    [figure("accuracy.mean_mm", 0.41, "worse", history=[0.2]), figure("points.cloud", None, "missing")],
    [FirstStep(["extract-1", "extract-2"], "its result differs", [Change("code of a changed", [("x = 1", "x = 2")])])],
    changed_steps=7,
    pictures={"surface: distance to the accepted one": PNG},
)


class Text(HTMLParser):
    """The words of a page, and the elements that hold them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in {"src", "href"}]

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_what_needs_a_look_comes_first() -> None:
    page = regress_page(night(GOOD, BAD))
    assert "<title>nightly: something is worse</title>" in page
    assert page.index("<h2>bad</h2>") < page.index("<h2>good</h2>")
    text = " ".join(Text(page).words)
    assert "Steps whose result differs from the accepted one: 7." in text
    assert "extract-1, extract-2 : its result differs" in text
    assert "All 1 figures are the same" in text
    assert "as filmed" in text
    assert "<title>nightly: all is the same or better</title>" in regress_page(night(GOOD))
    assert "something is worse" in regress_page(night(replace(GOOD, problem="disk full")))


def test_figures_stand_beside_the_accepted_ones() -> None:
    page = regress_page(night(BAD))
    row = page[page.index("accuracy.<wbr>mean_<wbr>mm</th>") :].partition("</tr>")[0]
    assert re.findall(r">(0\.\d+)<", row) == ["0.4100", "0.2000"]
    assert "+0.2100<small>±0.1000</small>" in row
    assert '<span class="status incomplete">worse</span>' in row


def test_it_stands_alone_and_names_are_data() -> None:
    hostile = JudgedSet(
        HOSTILE, HOSTILE, [replace(figure("a", 0.41, "worse"), name=HOSTILE)],
        [FirstStep([HOSTILE], HOSTILE, [Change(HOSTILE, [(HOSTILE, HOSTILE)])])], 1, {HOSTILE: PNG}, HOSTILE,
    )  # fmt: skip
    whole = replace(
        night(hostile), suite=HOSTILE, host=HOSTILE, software=HOSTILE, notes=[HOSTILE],
        accepted=[Accepted(HOSTILE, NOON, HOSTILE, HOSTILE)],
    )  # fmt: skip
    found = Text(with_notice(regress_page(whole), HOSTILE))
    assert "script" not in found.tags
    assert all(address.startswith("data:image/png;base64,") for address in found.addresses)
    assert "default-src 'none'" in regress_page(whole)
    assert sum(HOSTILE in words for words in found.words) >= 10


def test_a_notice_takes_the_place_of_the_one_before() -> None:
    page = regress_page(night(GOOD))
    noticed = with_notice(page, "no night")
    assert noticed.count("no night") == 1
    again = with_notice(noticed, "none <still>")
    assert ("no night" in again, again.count("none &lt;still&gt;")) == (False, 1)


def places(figure: JudgedFigure) -> list[list[tuple[float, float]]]:
    """The points of each unbroken piece of the line."""
    root = ET.fromstring(history_line(figure))
    path = next(element.get("d", "") for element in root.iter() if element.get("class") == "line")
    pieces = [piece.replace("h0", "").split("L") for piece in path.split("M")[1:]]
    return [[(float(x), float(y)) for x, y in (point.split() for point in piece)] for piece in pieces]


def test_the_line_runs_from_night_to_night() -> None:
    [line] = places(figure("a", 0.5, "worse", history=[0.1] * 4 + [0.3] * 4))  # nine nights: the whole width
    assert line[0] == (MARGIN, HEIGHT - MARGIN)  # 0.1 is the least, where the band ends, too
    assert line[-1] == (WIDTH - MARGIN, MARGIN)
    assert line[4][1] == pytest.approx(HEIGHT / 2, abs=0.06)  # 0.3 lies in the middle
    assert [x for x, _ in line] == sorted(x for x, _ in line)


def test_a_night_without_the_figure_breaks_the_line() -> None:
    assert [len(piece) for piece in places(figure("a", 0.2, "same", history=[0.2, None, 0.3, 0.2]))] == [1, 3]
    missing = figure("a", None, "missing", history=[0.2, 0.2])
    assert [len(piece) for piece in places(missing)] == [2]
    assert "<circle" not in history_line(missing)
    assert history_line(figure("a", None, "missing")) == ""


@pytest.mark.parametrize("value", [0.0, -3.5, 1e9])
def test_a_figure_that_is_always_the_same(value: float) -> None:
    always = replace(figure("a", value, "same", accepted=value, history=[value, value]), allowed=0.0)
    [line] = places(always)
    assert {y for _, y in line} == {HEIGHT / 2}

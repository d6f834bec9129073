"""The page of an archive: order of its rows, escaped names, relative addresses of pictures."""

import re
from html.parser import HTMLParser
from typing import Any

import pytest

from footscan.report.archive.page import ScanRow, archive_page
from footscan.report.archive.script import SCRIPT
from footscan.report.quality_lights import TrafficLight

HOSTILE = "<script>alert('1')</script>\"&"


class Rows(HTMLParser):
    """Words of each row of the table; fails at a wrong end tag."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open, self.rows, self.tags = list[str](), list[list[str]](), list[str]()
        self.pictures, self.links = list[dict[str, Any]](), list[str]()
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in {"meta", "input", "img"}:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag == "img":
            self.pictures.append(dict(attributes))
        if tag == "a":
            self.links.append(dict(attributes)["href"] or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "tr" in self.open and data.strip():
            self.rows[-1].append(data)


def row(patient: str, scan: str, **known: Any) -> ScanRow:
    return ScanRow(patient, scan, **{"status": "done"} | known)


def test_both_feet_of_a_day_follow_each_other_the_left_one_first() -> None:
    rows = [
        row("P2", "a", side="right", date="2026-01-01"),
        row("P1", "late", side="left", date="2026-02-01"),
        row("P1", "R", side="right", date="2026-01-01"),
        row("P1", "L", side="left", date="2026-01-01"),
    ]
    page = archive_page(rows, "m")
    assert re.findall(r'data-scan="(\w+)"', page) == ["L", "R", "late", "a"]
    assert page.count("<tbody>") == 2
    assert Rows(page).rows[1] == ["P1", "L", "left", "2026-01-01", "done"]


def test_a_row_tells_length_size_lights_and_links() -> None:
    lights = [TrafficLight("Frames", "good", "0 of 9 frames lost"), TrafficLight("Surface", "poor", "open")]
    known: dict[str, Any] = {"length_mm": 261.94, "size": "41.5", "report": "P1/R/report.html", "picture": "f/x.png"}
    page = archive_page([row("P1", "R", lights=lights, **known)], "m")
    parsed = Rows(page)
    assert parsed.rows[1] == ["P1", "R", "unknown", "261.9 mm", "EU 41.5", "Frames", "Surface", "done"]
    assert parsed.links == ["P1/R/report.html"]
    assert parsed.pictures[0]["src"] == "f/x.png"
    assert parsed.pictures[0]["loading"] == "lazy"
    assert 'data-quality="3"' in page
    assert 'title="Surface: poor, open"' in page


def test_failures_are_counted_and_told_with_their_reasons() -> None:
    rows = [
        row("P1", "a", status="finding", problem="no foot"),
        *(row("P2", f"b{kind}", status=kind, problem=f"{kind} reason") for kind in ("refused", "fault", "damaged")),
    ]
    page = archive_page(rows, "m")
    assert "<span>With a finding</span><b>1</b>" in page
    assert "<span>Failed</span><b>3</b>" in page
    assert {words[-1] for words in Rows(page).rows[1:]} == {
        "no foot",
        "refused reason",
        "fault reason",
        "damaged reason",
    }


def test_names_and_reasons_are_data() -> None:
    hostile = ScanRow(
        HOSTILE, HOSTILE, HOSTILE, HOSTILE, HOSTILE, HOSTILE, 1.0, HOSTILE,
        [TrafficLight(HOSTILE, "good", HOSTILE)], HOSTILE, HOSTILE,
    )  # fmt: skip
    page = archive_page([hostile], "m")
    assert Rows(page).tags.count("script") == 1
    assert Rows(page).rows[1].count(HOSTILE) >= 6
    assert "</" not in SCRIPT


@pytest.mark.parametrize("count", [0, 3000])
def test_an_archive_of_any_size_holds_no_picture_itself(count: int) -> None:
    rows = [row(f"P{k // 2}", f"s{k}", picture=f"index.files/{k}.png", problem="why" * 20) for k in range(count)]
    page = archive_page(rows, "mark0")
    assert "data:" not in page.replace("img-src", "")
    assert len(page) < 20_000 + 1000 * count
    assert page.count("<tr ") == count
    assert "<!-- mark0 -->" in page

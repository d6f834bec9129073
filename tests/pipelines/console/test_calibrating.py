"""Orders of the page that calibrates, to a console whose scanner shows the frames of a recorded capture."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from stand_in import StandIn
from standing_scanner import StandingStandIn
from starlette.testclient import TestClient

from pipelines.console.console import Console
from pipelines.console.server import application
from pipelines.live.calibrating.guide import Guide
from pipelines.live.calibrating.settings import GuideSettings

ADDRESS, PAGE = "http://127.0.0.1:8760", "a" * 16
Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


@pytest.fixture
def glass(filmed_capture: Path) -> StandingStandIn:
    return StandingStandIn(filmed_capture)


@pytest.fixture
def console(scanner: StandIn, glass: StandingStandIn, results: Path) -> Iterator[Console]:
    home = results.parent
    guide = Guide(glass, GuideSettings(home / "captures", home / "rig.yaml", glass.capture.reference), glass.put)
    with Console(scanner, home / "archive", results, guide) as one:
        yield one


def give(web: TestClient, until: Until, action: str, step: str, number: int | None = None) -> dict[str, Any]:
    """Give an order, and wait until the page shows this step and placement."""
    assert web.post("/do/calibrate", json={"action": action, "number": number or 0}).status_code == 204
    seen = until(
        lambda seen: (
            seen["action"] is None
            and seen["guide"]["step"] == step
            and number in {None, seen["guide"]["number"]}
            and (action != "put" or "put" not in seen["guide"]["actions"])
        )
    )
    assert seen["problem"] is None
    return dict(seen["guide"])


def test_a_session_from_the_page(web: TestClient, until: Until, results: Path) -> None:
    assert web.get("/calibrating").status_code == 200
    assert web.get("/calibrating/placement.svg").status_code == 204
    give(web, until, "calibrate", "place")
    give(web, until, "go", "place", 1)
    assert give(web, until, "put", "place")["words"] == (
        "Placement 2 of 3: a virtual object stands there now. Film it."
    )
    view = give(web, until, "take", "look")
    assert (view["taken"], view["complaints"]) == ((1,), ())
    assert set(view["coverage"]) == {"1", "2", "5"}
    picture = web.get("/calibrating/stripes.svg")
    assert picture.headers["content-type"].startswith("image/svg+xml")
    assert "Camera 5" in picture.text
    assert web.get("/calibrating/result.png").status_code == 204
    placement = web.get("/calibrating/placement.svg")
    assert placement.headers["content-type"].startswith("image/svg+xml")
    assert "Y = +40 mm, raised by 14 mm" in placement.text
    give(web, until, "discard", "begin")
    assert list((results.parent / "captures").iterdir()) == []


def test_what_is_refused_is_told(web: TestClient, until: Until) -> None:
    assert web.post("/do/calibrate", json={"action": "take"}).status_code == 204
    seen = until(lambda seen: seen["problem"] is not None)
    assert seen["problem"] == "calibration: cannot take now, expected one of calibrate"
    for body in ({"action": "explode"}, {"action": "go", "number": -1}, {}, {"action": "take", "also": 1}):
        assert web.post("/do/calibrate", json=body).status_code == 400


def test_only_the_page_in_charge_calibrates(web: TestClient, until: Until) -> None:
    give(web, until, "calibrate", "place")
    other = {"x-footscan-page": "b" * 16}
    answer = web.post("/do/calibrate", json={"action": "take"}, headers=other)
    assert (answer.status_code, answer.json()["problem"]) == (
        409, "page: another page is in charge of the scanner, expected to take over first"
    )  # fmt: skip
    assert web.post("/do/calibrate", json={"action": "take"}, headers={"origin": "http://evil"}).status_code == 403


def test_a_scanner_without_a_reference_object_says_so(scanner: StandIn, results: Path) -> None:
    headers = {"origin": ADDRESS, "x-footscan-page": PAGE}
    with (
        Console(scanner, results.parent / "archive", results) as console,
        TestClient(application(console, "127.0.0.1", None), base_url=ADDRESS, headers=headers) as web,
    ):
        assert console.seen_by(PAGE)["guide"] is None
        answer = web.post("/do/calibrate", json={"action": "calibrate"})
        assert answer.json()["problem"] == "reference object: is missing, expected reference.yaml beside rig.yaml"
        assert web.get("/calibrating/stripes.svg").status_code == 404

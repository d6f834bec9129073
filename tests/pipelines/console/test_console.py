"""The console: one operator, one action at a time, and a Stop that is always available."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stand_in import GENEROUS_SECONDS, StandIn
from starlette.testclient import TestClient

from pipelines.console.console import Console
from pipelines.live.state import ScannerState
from schemas.base.errors import Fault, RefusedInput

PAGE, OTHER = "a" * 16, "b" * 16
RIGHT = {"patient": "P1", "side": "right", "posture": "half_weight"}
Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


def idle(seen: dict[str, Any]) -> bool:
    return seen["action"] is None and seen["state"]["name"] != "disconnected"


def test_two_feet_of_a_person_make_a_pair(web: TestClient, scanner: StandIn, until: Until) -> None:
    assert web.post("/do/connect", json={}).status_code == 204
    until(idle)
    assert web.post("/do/scan", json=RIGHT).status_code == 204
    sitting = until(lambda seen: bool(seen["sitting"]["feet"]) and idle(seen))["sitting"]
    assert sitting == {
        "patient": "P1",
        "feet": [
            {
                "side": "right", "scan": "2026-11-20-R", "href": "/foot/P1/2026-11-20-R", "problem": None,
                "level": "good", "length_mm": 262.0, "left_out": [],
            }
        ],
        "pair": None,
    }  # fmt: skip
    assert web.post("/do/scan", json={"patient": "P1", "side": "left"}).status_code == 204
    both = until(lambda seen: len(seen["sitting"]["feet"]) == 2 and idle(seen))["sitting"]
    assert both["pair"] == "/pair/P1/2026-11-20-L/2026-11-20-R"
    assert web.post("/do/scan", json=RIGHT).status_code == 204
    again = until(lambda seen: len(seen["sitting"]["feet"]) == 3 and idle(seen))["sitting"]
    assert again["pair"] == "/pair/P1/2026-11-20-L/2026-11-20-R-2", "the second try counts"
    page = web.get(again["pair"]).text
    assert "Both feet" in page
    assert "<b>265/98</b>" not in page
    assert web.post("/do/scan", json={"patient": "P2", "side": "left"}).status_code == 204
    assert until(lambda seen: seen["sitting"]["patient"] == "P2" and idle(seen))["sitting"]["pair"] is None
    assert scanner.calls == [
        "connect", "film P1 right half_weight False", "film P1 left unknown False", "film P1 right half_weight False",
        "film P2 left unknown False",
    ]  # fmt: skip


def test_a_foot_is_shown_before_its_report_is_written(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.pause = {"reporting"}
    web.post("/do/connect", json={})
    until(idle)
    assert web.post("/do/scan", json=RIGHT).status_code == 204
    (foot,) = until(lambda seen: bool(seen["sitting"]["feet"]))["sitting"]["feet"]
    assert foot["length_mm"] is not None
    assert "Right foot" in web.get(foot["href"]).text
    scanner.go.set()
    assert until(idle)["sitting"]["feet"] == [foot]


def test_only_one_thing_is_done_at_a_time(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.connect()
    scanner.pause = {"filming"}
    assert web.post("/do/scan", json=RIGHT).status_code == 204
    assert scanner.reached.wait(GENEROUS_SECONDS)
    for order in ("connect", "home", "shine", "scan", "jog", "new-person"):
        body = RIGHT if order == "scan" else {"mm": 5} if order == "jog" else {}
        answer = web.post(f"/do/{order}", json=body)
        assert (answer.status_code, answer.json()) == (
            409, {"problem": "scanner: is busy, expected to wait or to stop it"},
        ), order  # fmt: skip
    scanner.go.set()
    assert until(lambda seen: bool(seen["sitting"]["feet"]))["problem"] is None
    assert scanner.calls == ["connect", "film P1 right half_weight False"]


def test_a_second_page_looks_on_may_stop_and_may_take_over(
    web: TestClient, console: Console, scanner: StandIn, until: Until
) -> None:
    scanner.connect()
    console.enter(PAGE)
    console.enter(OTHER)
    assert (console.seen_by(PAGE)["in_charge"], console.seen_by(PAGE)["others"]) == (True, False)
    assert (console.seen_by(OTHER)["in_charge"], console.seen_by(OTHER)["others"]) == (False, True)
    second = {"x-footscan-page": OTHER}
    for order in ("home", "connect", "shine", "resume", "new-person"):
        answer = web.post(f"/do/{order}", json={}, headers=second)
        assert answer.status_code == 409
        assert "another page is in charge" in answer.json()["problem"]
    assert scanner.calls == ["connect"]
    assert web.post("/do/stop", json={}, headers=second).status_code == 204
    assert scanner.calls == ["connect", "stop"]
    assert web.post("/do/take-over", json={}, headers=second).status_code == 204
    assert web.post("/do/home", json={}, headers=second).status_code == 204
    until(idle)
    assert web.post("/do/home", json={}).status_code == 409, "the first one looks on now"


def test_a_stop_ends_the_scan_and_the_next_one_works(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.connect()
    scanner.pause = {"filming"}
    web.post("/do/scan", json=RIGHT)
    assert scanner.reached.wait(GENEROUS_SECONDS)
    assert scanner.lit
    assert web.post("/do/stop", json={}).status_code == 204
    assert not scanner.lit
    seen = until(lambda seen: seen["problem"] is not None)
    assert (seen["state"]["name"], seen["state"]["progress"]) == ("failed", None)
    assert seen["state"]["words"] == "stopped; nothing of this scan is kept"
    assert seen["sitting"]["feet"] == []
    scanner.pause = set()
    web.post("/do/scan", json=RIGHT)
    assert until(lambda seen: bool(seen["sitting"]["feet"]))["problem"] is None


def test_what_fails_is_told_with_what_to_do(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.connect()
    scanner.lost_camera, scanner.next_problem = 3, "camera 3: the connection was lost for a while"
    web.post("/do/scan", json=RIGHT)
    seen = until(lambda seen: seen["problem"] is not None)
    assert seen["problem"] == "camera 3: the connection was lost for a while"
    assert seen["do"].startswith("Camera 3: check its cable and hub, then connect. The lasers are off")
    web.post("/do/connect", json={})
    assert until(lambda seen: seen["problem"] is None and idle(seen))["do"] == ""


def test_an_open_door_is_closed_and_the_scan_goes_on(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.connect()
    scanner.pause = {"filming"}
    web.post("/do/scan", json=RIGHT)
    assert scanner.reached.wait(GENEROUS_SECONDS)
    scanner.door_open = True
    scanner.tell_again()
    seen = until(lambda seen: seen["state"]["name"] == "door open")
    assert "press “Go on”" in seen["do"]
    assert seen["resumable"]
    scanner.go.set()
    assert web.post("/do/resume", json={}).status_code == 204
    until(lambda seen: bool(seen["sitting"]["feet"]))


def test_an_alarm_asks_for_homing(web: TestClient, scanner: StandIn, until: Until) -> None:
    scanner.connect()
    scanner.alarm = True
    scanner.tell_again()
    assert "“Home heads”" in until(lambda seen: seen["state"]["name"] == "alarm")["do"]
    web.post("/do/home", json={})
    assert until(lambda seen: seen["state"]["name"] == "idle" and idle(seen))["do"] == ""


def test_a_fault_of_stop_is_told(web: TestClient, scanner: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise Fault("the board does not answer; switch its power off")

    monkeypatch.setattr(scanner, "stop", fails)
    answer = web.post("/do/stop", json={})
    assert answer.status_code == 502
    assert answer.json() == {"problem": "the board does not answer; switch its power off"}


def test_a_mistake_of_the_program_leaves_the_console_usable(
    web: TestClient, scanner: StandIn, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks() -> None:
        raise ZeroDivisionError("oh")

    scanner.connect()
    monkeypatch.setattr(scanner, "home", breaks)
    web.post("/do/home", json={})
    assert until(lambda seen: seen["problem"] is not None)["problem"] == "ZeroDivisionError: oh"
    web.post("/do/jog", json={"mm": -5, "head": 2})
    until(lambda seen: seen["problem"] is None and idle(seen))
    assert scanner.calls[-1] == "jog -5 2"


def test_the_end_of_the_console_stops_the_scan_and_lets_the_scanner_go(results: Path) -> None:
    scanner = StandIn(results)
    scanner.connect()
    scanner.pause = {"filming"}
    with Console(scanner, results.parent / "archive", results) as console:
        console.scan(PAGE, "P1", "right", "half_weight", keep_partial=False)
        assert scanner.reached.wait(GENEROUS_SECONDS)
    assert scanner.calls == ["connect", "film P1 right half_weight False", "stop", "close"]
    assert not scanner.lit
    assert list(results.iterdir()) == []
    with pytest.raises(RefusedInput, match="is busy"):
        console.home(PAGE)


def test_listeners_hear_each_change(console: Console, scanner: StandIn) -> None:
    heard: list[ScannerState] = []
    told = []
    unhear = console.hear(lambda: told.append(1))
    scanner.listen(heard.append)
    console.enter(PAGE)
    assert told
    unhear()
    before = len(told)
    console.take_over(OTHER)
    assert len(told) == before

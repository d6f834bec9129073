"""Presence of the page that moves heads: its reports, and the stop without them."""

import threading
import time

import pytest
from stand_in import StandIn
from starlette.testclient import TestClient

from pipelines.console.presence import GONE_SECONDS, Presence
from schemas.base.errors import Fault

pytestmark = pytest.mark.real_time  # a connection counts as gone after half a second

PAGE, OTHER = "a" * 16, "b" * 16


def moved(presence: Presence, speaks: str | None, seconds: float) -> tuple[float, str]:
    """Move heads while a page reports its presence; returns the time of the move, and the message of its failure."""
    stopped, ended = threading.Event(), threading.Event()

    def speak() -> None:
        while speaks is not None and not ended.wait(0.1):
            presence.here(speaks)

    thread = threading.Thread(target=speak)
    thread.start()
    began, said = time.monotonic(), ""
    try:
        with presence.needed(PAGE, stopped.set):
            stopped.wait(seconds)
            took = time.monotonic() - began
    except Fault as fault:
        said = str(fault)
    finally:
        ended.set()
        thread.join()
    return took, said


def test_a_page_that_speaks_moves_heads_to_the_end() -> None:
    took, said = moved(Presence(), PAGE, 1.5)
    assert took > 1.4
    assert said == ""


@pytest.mark.parametrize("speaks", [None, OTHER])
def test_heads_stop_where_their_page_is_silent(speaks: str | None) -> None:
    took, said = moved(Presence(), speaks, 10.0)
    assert GONE_SECONDS <= took < GONE_SECONDS + 1.0
    assert said == "the page that moved the heads was gone for 0.5 s: they were stopped"


def test_a_motion_that_ended_well_is_no_fault_of_a_page_that_leaves_later() -> None:
    presence = Presence()
    for _ in range(2):
        took, said = moved(presence, None, 0.2)
        assert took < GONE_SECONDS
        assert said == ""


def test_a_page_says_that_it_is_there(web: TestClient) -> None:
    assert web.post("/here").status_code == 204
    assert web.post("/here", headers={"origin": "http://evil.example"}).status_code == 403
    assert web.get("/here").status_code == 405


def test_a_jog_of_a_silent_page_is_stopped(web: TestClient, scanner: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = threading.Event()
    monkeypatch.setattr(scanner, "jog", lambda *_: stopped.wait(10.0))
    monkeypatch.setattr(scanner, "stop", stopped.set)
    scanner.connect()
    began = time.monotonic()
    assert web.post("/do/jog", json={"mm": 5}).status_code == 204
    assert stopped.wait(5.0)
    assert time.monotonic() - began >= GONE_SECONDS

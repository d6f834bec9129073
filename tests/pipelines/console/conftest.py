"""A console over a stand-in of the scanner, and a client that acts as a page."""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

sys.path.insert(0, str(Path(__file__).parent))

from stand_in import GENEROUS_SECONDS, StandIn

from pipelines.console.console import Console
from pipelines.console.server import application

ADDRESS = "http://127.0.0.1:8760"
PAGE = "a" * 16
Until = Callable[[Callable[[dict[str, Any]], bool]], dict[str, Any]]


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "results"
    folder.mkdir()
    return folder


@pytest.fixture
def scanner(results: Path) -> StandIn:
    return StandIn(results)


@pytest.fixture
def console(scanner: StandIn, results: Path) -> Iterator[Console]:
    with Console(scanner, results.parent / "archive", results) as one:
        yield one


@pytest.fixture
def until(console: Console) -> Until:
    """Wait until the state that a page sees is as expected."""

    def wait(is_so: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        end = time.monotonic() + GENEROUS_SECONDS
        while not is_so(seen := console.seen_by(PAGE)):
            assert time.monotonic() < end, seen
            time.sleep(0.01)
        return seen

    return wait


@pytest.fixture
def web(console: Console) -> Iterator[TestClient]:
    """A client that sends the headers of a page of this server."""
    headers = {"origin": ADDRESS, "x-footscan-page": PAGE}
    app = application(console, "127.0.0.1", None)
    with TestClient(app, base_url=ADDRESS, headers=headers, follow_redirects=False) as client:
        yield client

"""Hostile requests to the operator's page: a documented status, no error, nothing from outside of the results.

FOOTSCAN_FUZZ=4000 pytest tests/fuzz/test_fuzz_page.py      1,000 requests; FOOTSCAN_FUZZ_FIRST=417 begins with that one
"""

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from damage_documents import HOSTILE
from damage_text import damage_text
from starlette.testclient import TestClient

sys.path.insert(0, str(Path(__file__).parents[1] / "pipelines" / "console"))

from stand_in import StandIn, deliver_made_up

from pipelines.console.console import Console
from pipelines.console.server import application

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
CASES = range(FIRST, FIRST + (30 if ASKED is None else int(ASKED) // 4))
ADDRESS = "http://127.0.0.1:8760"
STATUSES = {200, 204, 400, 403, 404, 405, 409, 413, 421, 429, 502}
SECRET = "a secret outside of the results"
PARTS = (
    *("P1", "S1", "foot", "pair", "results", "static", "cameras", "1.jpg", "do", "stop", "scan", "jog", "home"),
    *("..", ".", "%2e%2e", "%2f", "..%2f..%2fsecret", "secret", "%00", "a%00b", "%ff", "%", "~", "x" * 3000, "", "*"),
    *("measures.json", "quality.json", "foot.stl", "cloud.ply", "report.html", "console.css", "link.js", "viewer.js"),
    *("99999999999999999999.jpg", "-1.jpg", "0x1.jpg", "1.jpg/", "<script>", "%0d%0aSet-Cookie:x", "\u202e", "é"),
)  # fmt: skip
METHODS = ("GET", "GET", "GET", "POST", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE", "NONSENSE")
HEADERS = (
    "origin",
    "host",
    "x-footscan-page",
    "content-length",
    "content-type",
    "range",
    "cookie",
    "sec-fetch-site",
    "accept",
)
VALUES = (
    "",
    "null",
    "a" * 16,
    "b" * 16,
    "0",
    "-1",
    "9" * 30,
    "bytes=0-",
    "bytes=9-1",
    "cross-site",
    "x" * 5000,
    "127.0.0.1",
)


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The page over a scanner that is none, with one foot among its results and a secret beside them."""
    root = tmp_path_factory.mktemp("console")
    results = root / "results"
    (results / "P1" / "S1").mkdir(parents=True)
    deliver_made_up(results / "P1" / "S1", "right")
    (root / "secret").write_text(SECRET)
    (results / "P1" / "S1" / "link.ply").symlink_to(root / "secret")
    headers = {"origin": ADDRESS, "x-footscan-page": "a" * 16}
    with Console(StandIn(results), root / "archive", results) as console:
        app = application(console, "127.0.0.1", None)
        with TestClient(app, base_url=ADDRESS, headers=headers, follow_redirects=False) as client:
            yield client


@pytest.mark.parametrize("number", CASES)
def test_hostile_requests(number: int, web: TestClient) -> None:
    random = Random(f"page {number}")
    path = "/" + "/".join(random.choice(PARTS) for _ in range(random.choice((1, 2, 2, 3, 3, 4))))
    if random.random() < 0.4:
        path = f"/do/{random.choice(('stop', 'scan', 'jog', 'home', 'connect', 'take', 'nonsense'))}"
    method = "POST" if path.startswith("/do/") and random.random() < 0.8 else random.choice(METHODS)
    headers = {random.choice(HEADERS): random.choice(VALUES) for _ in range(random.choice((0, 0, 1, 2)))}
    body = _body(random) if method not in {"GET", "HEAD"} else b""
    case = f"page {number}: {method} {path[:200]} {headers} {body[:100]!r}"
    answer = web.request(method, path, headers=headers, content=body)  # an error of the server would be raised here
    assert answer.status_code in STATUSES, f"{case}: {answer.status_code}"
    assert SECRET not in answer.text, case
    assert "Traceback" not in answer.text, case


def _body(random: Random) -> bytes:
    asked = {"patient": "P1", "side": "right", "mm": 5.0, "head": "above", "keep_partial": True}
    for _ in range(random.choice((0, 1, 2))):
        asked[random.choice(tuple(asked))] = random.choice(HOSTILE)
    content = json.dumps(asked).encode()
    return damage_text(random, content)[0] if random.random() < 0.4 else content

"""The server: admitted requests, answers, and files that it never sends."""

import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
from stand_in import StandIn, deliver_made_up
from starlette.testclient import TestClient

from pipelines.console.console import Console
from pipelines.console.guard import is_loopback
from pipelines.console.server import application
from pipelines.console.web import listen
from schemas.base.errors import RefusedInput

ADDRESS = "http://127.0.0.1:8760"
OTHER_PAGE = "b" * 16
TOKEN = "t0ken-that-nobody-guesses"
SECRET = "a secret outside the results"
SCAN = {"patient": "P1", "side": "right"}


@pytest.fixture
def foot(results: Path) -> str:
    """A scan with results; its address within the results."""
    folder = results / "P1" / "S1"
    folder.mkdir(parents=True)
    deliver_made_up(folder, "right")
    return "P1/S1"


@pytest.mark.parametrize("host", ["127.0.0.1:8760", "localhost:8760", "LOCALHOST", "[::1]:8760"])
def test_its_own_names_are_answered(web: TestClient, host: str) -> None:
    assert web.get("/", headers={"host": host}).status_code == 200


@pytest.mark.parametrize("host", ["evil.example:8760", "127.0.0.1.evil.example", "10.0.0.7:8760", "", "localhost."])
@pytest.mark.parametrize("path", ["/", "/events?page=aaaaaaaaaaaaaaaa", "/cameras/1.jpg", "/static/link.js"])
def test_a_name_that_was_rebound_is_not(web: TestClient, host: str, path: str) -> None:
    assert web.get(path, headers={"host": host}).status_code == 421


@pytest.mark.parametrize(
    "wrong",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "https://127.0.0.1:8760"},
        {"origin": "http://127.0.0.1:8761"},
        {"origin": ""},
        {"x-footscan-page": ""},
        {"x-footscan-page": "short"},
        {"x-footscan-page": "a" * 15 + "<"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_no_other_site_gives_orders(web: TestClient, scanner: StandIn, wrong: dict[str, str]) -> None:
    assert web.post("/do/connect", json={}, headers=wrong).status_code == 403
    assert web.post("/do/stop", json={}, headers=wrong).status_code == 403
    assert scanner.calls == []


def test_an_order_without_origin_is_refused(console: Console, scanner: StandIn) -> None:
    with TestClient(application(console, "127.0.0.1", None), base_url=ADDRESS) as bare:
        assert bare.post("/do/home", json={}, headers={"x-footscan-page": OTHER_PAGE}).status_code == 403
    assert scanner.calls == []


def test_orders_are_no_links(web: TestClient, scanner: StandIn) -> None:
    assert web.get("/do/stop").status_code == 405
    assert web.put("/do/stop").status_code == 405
    assert web.delete("/do/stop").status_code == 405
    assert scanner.calls == []


def test_another_site_sees_no_pictures_but_may_link_here(web: TestClient) -> None:
    embedded = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors"}
    assert web.get("/cameras/1.jpg", headers=embedded | {"sec-fetch-site": "same-site"}).status_code == 403
    assert web.get("/cameras/1.jpg", headers=embedded).status_code == 403
    assert web.get("/", headers={"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}).status_code == 200


@pytest.mark.parametrize("path", ["/events?page=cccccccccccccccc", "/cameras/1.jpg", "/results/P1/S1/foot.stl"])
def test_another_site_links_to_pages_alone(web: TestClient, console: Console, path: str) -> None:
    link = {
        "sec-fetch-site": "cross-site",
        "sec-fetch-mode": "navigate",
        "referer": "http://evil.example/x",
        "accept": "text/html",
    }
    assert web.get(path, headers=link).status_code == 403
    assert not console.seen_by("c" * 16)["in_charge"]


def test_a_link_to_the_events_is_refused_whatever_the_browser_tells(web: TestClient, console: Console) -> None:
    """Browsers send the origin of a request only on loopback and with TLS."""
    assert web.get("/events?page=cccccccccccccccc", headers={"accept": "text/html,*/*"}).status_code == 403
    assert not console.seen_by("c" * 16)["in_charge"]


def test_who_is_in_charge_hears_of_another_site(web: TestClient, until: Any) -> None:
    web.post("/do/stop", json={}, headers={"origin": "http://evil.example"})
    seen = until(lambda seen: seen["warning"] is not None)
    assert seen["warning"] == "http://evil.example asked this scanner for /do/stop and was refused"


def test_large_requests_are_refused_unread(web: TestClient, scanner: StandIn) -> None:
    assert web.post("/do/scan", content=b"{" + b" " * 5000 + b"}").status_code == 413
    assert web.post("/do/scan", content=(b"x" for _ in range(3))).status_code == 413, "a body of untold length"
    assert web.post("/do/stop", content=b"x" * 9, headers={"content-length": "9" * 30}).status_code == 413
    assert scanner.calls == []


@pytest.mark.parametrize(
    "body",
    [
        {"patient": "../../etc", "side": "right"},
        {"patient": "P 1", "side": "right"},
        {"patient": "P1\n", "side": "right"},
        {"patient": "<b>", "side": "right"},
        {"patient": "", "side": "right"},
        {"patient": "x" * 65, "side": "right"},
        {"patient": "P1", "side": "both"},
        {"patient": "P1"},
        {"patient": "P1", "side": "right", "posture": "lying"},
        {"patient": "P1", "side": "right", "archive": "/tmp"},
        [],
        None,
    ],
)
def test_a_scan_of_an_impossible_name_is_not_begun(web: TestClient, scanner: StandIn, body: Any) -> None:
    assert web.post("/do/scan", json=body).status_code == 400
    assert scanner.calls == []


@pytest.mark.parametrize("body", [{"mm": 501}, {"mm": "x"}, {"mm": 5, "head": 5}, {"mm": 1e999}, {}])
def test_heads_are_jogged_within_reason(web: TestClient, scanner: StandIn, body: dict[str, Any]) -> None:
    content = str(body).replace("'", '"').replace("inf", "Infinity")
    assert web.post("/do/jog", content=content).status_code == 400
    assert scanner.calls == []


def test_results_are_given_by_name(web: TestClient, foot: str, results: Path) -> None:
    stored = (results / foot / "measures.json").read_bytes()
    given = web.get(f"/results/{foot}/measures.json")
    assert given.content == stored
    assert given.headers["content-disposition"] == 'attachment; filename="P1-S1-measures.json"'
    report = web.get(f"/results/{foot}/report.html")
    assert "whole report" in report.text
    assert report.headers["content-security-policy"].startswith("sandbox allow-scripts;")


@pytest.mark.parametrize(
    "path",
    [
        "P1/S1/secret.txt",
        "P1/S1/../../../secret.txt",
        "P1/S1/..%2f..%2f..%2fsecret.txt",
        "P1/S1/%2e%2e/%2e%2e/%2e%2e/secret.txt",
        "P1/..%5c..%5csecret.txt/measures.json",
        "../measures.json",
        "%2e%2e/P1/measures.json",
        "..%2f../x/measures.json",
        "//etc/passwd",
        "%2fetc/passwd/report.html",
        "P1/S1/measures.json%00.html",
        "P1%00/S1/measures.json",
        "P1/S1/.measures.json",
        "P1/linked/measures.json",
        "linked/S1/measures.json",
        "P1/S2/measures.json",
        "P1/S2/quality.json",
        "P1/S2/foot.stl",
        "P1/S2/report.html",
    ],
)
@pytest.mark.usefixtures("foot")
def test_nothing_outside_the_results_is_given(web: TestClient, results: Path, path: str) -> None:
    outside = results.parent / "outside"
    (outside / "S1").mkdir(parents=True)
    for folder in (outside, outside / "S1", results.parent):
        for name in ("measures.json", "secret.txt", "report.html"):
            (folder / name).write_text(SECRET)
    (results / "linked").symlink_to(outside)
    (results / "P1" / "linked").symlink_to(outside)
    second = results / "P1" / "S2"
    second.mkdir()
    (second / "measures.json").symlink_to(outside / "measures.json")
    (second / "quality.json").mkdir()
    os.mkfifo(second / "foot.stl")
    (second / "report.html").symlink_to("../../../outside/report.html")
    answer = web.get(f"/results/{path}")
    assert answer.status_code == 404
    assert SECRET not in answer.text


@pytest.mark.parametrize("name", ["../console.py", "..%2fconsole.py", "nothing.js", "%2fetc%2fpasswd", "."])
def test_static_files_are_those_of_the_page(web: TestClient, name: str) -> None:
    assert web.get(f"/static/{name}").status_code == 404


def test_every_answer_bears_the_policy(web: TestClient, foot: str) -> None:
    for path in ("/", f"/foot/{foot}", "/static/link.js", "/static/console.css", "/nowhere", "/cameras/1.jpg"):
        headers = web.get(path).headers
        policy = headers["content-security-policy"]
        assert "script-src 'self';" in policy, path
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"


def test_pages_have_no_script_of_their_own(web: TestClient, foot: str, results: Path) -> None:
    (results / "P1" / "L").mkdir()
    deliver_made_up(results / "P1" / "L", "left")
    for path in ("/", f"/foot/{foot}", "/pair/P1/L/S1"):
        page = web.get(path).text
        assert page.count("<script") >= 2, path
        assert re.findall(r"<script(?! src=\"/static/\w+\.js\" defer></script>)", page) == []
        assert re.findall(r"\son\w+\s*=", page) == []
        assert "://" not in page


@pytest.mark.parametrize(
    "address", ["%2e%2e/S1", "P1/%2e%2e", "P1/S1%2f..", "P1/nothing", "P1/S1/extra", "P 1/S1", "P1/%00"]
)
@pytest.mark.usefixtures("foot")
def test_pages_are_of_scans_alone(web: TestClient, address: str) -> None:
    assert web.get(f"/foot/{address}").status_code == 404
    assert web.get(f"/pair/{address}/S1").status_code in {404, 405}


def test_names_and_notes_of_others_are_data(web: TestClient, foot: str, results: Path) -> None:
    (results / "P1" / "L").mkdir()
    deliver_made_up(results / "P1" / "L", "left")
    hostile = "<img src=x onerror=alert(1)>"
    file = results / foot / "measures.json"
    measures = json.loads(file.read_text())
    measures["measures"]["foot_length"] |= {"status": "uncertain", "note": hostile, "definition": hostile}
    measures["measures"][hostile] = measures["measures"]["foot_breadth"]
    file.write_text(json.dumps(measures))
    for path in (f"/foot/{foot}", "/pair/P1/L/S1"):
        page = web.get(path).text
        assert hostile.lower() not in page.lower(), path
        assert page.count("&lt;img src=x onerror=alert(1)&gt;") >= 2, path


def test_a_broken_result_is_told_and_not_shown(web: TestClient, foot: str, results: Path) -> None:
    for name, broken in (("measures.json", b"{"), ("quality.json", b"[]"), ("foot.ply", b"ply\nformat odd 1.0\n")):
        kept = (results / foot / name).read_bytes()
        (results / foot / name).write_bytes(broken)
        answer = web.get(f"/foot/{foot}")
        assert answer.status_code == 404, name
        assert name in answer.text
        (results / foot / name).write_bytes(kept)
    assert web.get(f"/foot/{foot}").status_code == 200


def test_live_pictures_come_with_their_stripe(web: TestClient, scanner: StandIn) -> None:
    assert web.get("/cameras/1.jpg").status_code == 204, "not connected"
    scanner.connect()
    dark = web.get("/cameras/1.jpg")
    assert dark.headers["content-type"] == "image/jpeg"
    assert dark.headers["x-stripe-points"] == "0"
    scanner.lit = True
    assert 600 <= int(web.get("/cameras/1.jpg").headers["x-stripe-points"]) <= 640, "one point for each column"
    assert web.get("/cameras/99.jpg").status_code == 204
    assert web.get("/cameras/x.jpg").status_code == 404


@pytest.fixture
def guarded(console: Console) -> TestClient:
    """A server on an address other than loopback."""
    return TestClient(application(console, "0.0.0.0", TOKEN), base_url="http://10.0.0.7:8760", follow_redirects=False)


def test_beyond_loopback_a_token_is_asked_for(guarded: TestClient, scanner: StandIn) -> None:
    order = {"origin": "http://10.0.0.7:8760", "x-footscan-page": OTHER_PAGE}
    for path in ("/", "/static/link.js", "/cameras/1.jpg", "/results/P1/S1/foot.stl", "/?token=", "/?token=wrong"):
        assert guarded.get(path).status_code == 401, path
    assert guarded.post("/do/stop", json={}, headers=order).status_code == 401
    assert guarded.post(f"/do/stop?token={TOKEN}", json={}, headers=order).status_code == 401
    assert guarded.get("/", headers={"host": "evil.example"}).status_code == 421
    entered = guarded.get(f"/?token={TOKEN}")
    assert (entered.status_code, entered.headers["location"]) == (303, "/")
    cookie = entered.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=lax" in cookie
    assert guarded.get("/").status_code == 200
    assert guarded.post("/do/stop", json={}, headers=order).status_code == 204
    assert scanner.calls == ["stop"]
    guarded.cookies.clear()
    assert guarded.get("/").status_code == 401
    assert guarded.get("/", headers={"cookie": f"footscan_console={TOKEN[:-1]}"}).status_code == 401


@pytest.mark.parametrize(
    ("host", "is_so"),
    [("127.0.0.1", True), ("127.0.0.53", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("::", False),
     ("10.0.0.7", False), ("localhost.evil.example", False), ("scanner", False)],
)  # fmt: skip
def test_loopback_is_known(host: str, is_so: bool) -> None:
    assert is_loopback(host) is is_so


def test_a_port_in_use_is_refused_in_one_line() -> None:
    with listen("127.0.0.1", 0) as socket:
        port = socket.getsockname()[1]
        with pytest.raises(
            RefusedInput, match=rf"^127\.0\.0\.1:{port}: cannot be listened on \(Address already in use\)"
        ):
            listen("127.0.0.1", port)


SWAPPED = {
    "a folder": lambda file: file.mkdir(),
    "a named pipe": os.mkfifo,
    "a link that leads out": lambda file: file.symlink_to("/etc/hostname"),
    "nothing": Path.exists,
    "an empty file": lambda file: file.touch(),
    "other bytes": lambda file: file.write_bytes(b"\xff\x00{" * 50),
    "half a file": lambda file: file.write_text('{"format": "footscan.measures/1", "unit"'),
    "another document": lambda file: file.write_text(
        '{"format": "footscan.measures/1", "measures": {"foot_length": 1e999}}'
    ),
    "deep nesting": lambda file: file.write_text("[" * 100_000),
    "a sparse file of 6 GB": lambda file: (file.touch(), os.truncate(file, 6 * 2**30)),
}


@pytest.mark.parametrize("swapped", SWAPPED)
@pytest.mark.parametrize("name", ["measures.json", "quality.json", "foot.stl", "foot.ply"])
def test_results_that_are_swapped_are_told_in_a_line(
    web: TestClient, results: Path, foot: str, swapped: str, name: str
) -> None:
    assert web.get(f"/foot/{foot}").status_code == 200
    file = results / foot / name
    file.unlink(missing_ok=True)
    SWAPPED[swapped](file)
    for path in (f"/foot/{foot}", f"/results/{foot}/{name}", "/pair/P1/S1/S1"):
        answer = web.get(path)
        assert answer.status_code in {200, 404}, (path, answer.text[:300])
        assert "Traceback" not in answer.text
        if answer.status_code == 404:
            assert answer.text.startswith("footscan: ")
            assert answer.text.count("\n") == 1

"""The guard: requests of other sites, the warning to the operator, and a token on loopback."""

import pytest
from conftest import ADDRESS, PAGE, Until
from stand_in import StandIn
from starlette.testclient import TestClient

from pipelines.console.console import Console
from pipelines.console.guard import Rules
from pipelines.console.server import application

EVENTS = f"/events?page={'e' * 16}"
LINK = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "accept": "text/html,*/*;q=0.8"}
TOKEN = "t0ken-that-nobody-guesses"


@pytest.fixture
def stranger(console: Console) -> TestClient:
    """A browser that sends requests for a page of another site."""
    return TestClient(application(console, "127.0.0.1", None), base_url=ADDRESS)


@pytest.mark.parametrize(
    "sent",
    [
        LINK,
        LINK | {"sec-fetch-site": "same-site"},
        LINK | {"sec-fetch-site": "none"},
        LINK | {"accept": "text/event-stream"},
        {"sec-fetch-site": "cross-site", "sec-fetch-mode": "cors", "accept": "text/event-stream"},
        {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors"},
        {"origin": "http://evil.example", "accept": "text/event-stream"},
        {"origin": "http://127.0.0.1:9999", "accept": "text/event-stream"},
        {"origin": "null", "accept": "text/event-stream"},
        {"accept": "text/html"},
    ],
)
def test_the_state_is_followed_by_its_own_pages_alone(
    stranger: TestClient, console: Console, until: Until, sent: dict[str, str]
) -> None:
    console.take_over(PAGE)
    assert stranger.get(EVENTS, headers=sent).status_code == 403
    warning = until(lambda seen: seen["warning"] is not None)["warning"]
    assert warning.endswith("asked this scanner for /events and was refused")
    assert console.seen_by(PAGE)["in_charge"], "nobody else has come in"


@pytest.mark.parametrize("site", ["same-origin", None])
def test_its_own_page_follows_the_state(site: str | None) -> None:
    sent = [(b"host", b"127.0.0.1:8760"), (b"accept", b"text/event-stream")]
    sent += [] if site is None else [(b"sec-fetch-site", site.encode()), (b"sec-fetch-mode", b"cors")]
    told: list[str] = []
    scope = {"type": "http", "method": "GET", "path": "/events", "query_string": b"", "headers": sent}
    assert Rules("127.0.0.1", None, told.append).answer(scope) is None
    assert told == []


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1:8761", "http://127.0.0.1:8760", None),
        ("evil.example:8761", "http://evil.example:8760", 421),  # a name that was bound to this computer afterwards
        ("127.0.0.1:8761", "http://evil.example:8760", 403),
    ],
)
def test_stop_on_its_own_port_is_for_this_servers_pages(host: str, origin: str, status: int | None) -> None:
    sent = [(b"host", host.encode()), (b"origin", origin.encode()), (b"content-length", b"0")]
    scope = {"type": "http", "method": "POST", "path": "/do/stop", "query_string": b"", "headers": sent}
    refused = Rules("127.0.0.1", None, lambda _: None, (8760, 8761)).answer_aside(scope)
    assert (None if refused is None else refused.status_code) == status


@pytest.mark.parametrize("path", ["/cameras/1.jpg", "/results/P1/S1/foot.stl", "/static/link.js", EVENTS])
def test_another_site_links_to_pages_alone(stranger: TestClient, path: str) -> None:
    assert stranger.get(path, headers=LINK).status_code == 403
    assert stranger.get("/", headers=LINK).status_code == 200


def test_what_a_stranger_is_called_is_text(stranger: TestClient, until: Until) -> None:
    stranger.get(EVENTS, headers=LINK | {"referer": "http://evil.example/\x1b[2J\r" + "x" * 900})
    warning = until(lambda seen: seen["warning"] is not None)["warning"]
    assert warning.isprintable()
    assert len(warning) < 200


def test_a_token_is_wanted_on_loopback_where_it_is_asked_for(console: Console, scanner: StandIn) -> None:
    """Another account of this computer has the address, but no token."""
    guarded = TestClient(application(console, "127.0.0.1", TOKEN), base_url=ADDRESS, follow_redirects=False)
    order = {"origin": ADDRESS, "x-footscan-page": PAGE}
    for path in ("/", "/static/link.js", "/cameras/1.jpg", "/results/P1/S1/foot.stl", "/?token=wrong"):
        assert guarded.get(path).status_code == 401, path
    assert guarded.get(EVENTS, headers={"accept": "text/event-stream"}).status_code == 401
    for name in ("stop", "home", "take-over"):
        assert guarded.post(f"/do/{name}", json={}, headers=order).status_code == 401
    assert scanner.calls == []
    assert guarded.get(f"/?token={TOKEN}").status_code == 303
    assert guarded.post("/do/stop", json={}, headers=order).status_code == 204
    assert scanner.calls == ["stop"]

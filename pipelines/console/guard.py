"""Who is let in: loopback or a token, the server's own pages alone, small requests; and what browsers are told."""

import hmac
import ipaddress
import re
from collections.abc import Callable
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "footscan_console"
PAGE_HEADER = "x-footscan-page"
PAGE = re.compile(r"[A-Za-z0-9]{8,64}")
LARGEST_BODY = 4096
LINKED = ("/foot/", "/pair/")
"""What another site's page may link to, besides the first page."""
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; "
    "img-src 'self' blob: data:; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "x-frame-options": "DENY",
    "cache-control": "no-store",
}


class Guard:
    """Stands before the application; what it refuses, the application never sees."""

    def __init__(self, app: ASGIApp, rules: "Rules") -> None:
        self._app = app
        self._rules = rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """As ASGI has it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in {**HEADERS, "content-security-policy": self._rules.policy(scope)}.items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._rules.answer(scope) or self._app)(scope, receive, send_with_headers)


class Rules:
    """Which requests are let in.

    Parameters
    ----------
    host : the address that is listened on
    token : what a browser must bring along; None where none is asked for
    foreign : is told, in words, of each request that another site's page has made
    ports : of the pages, and of Stop alone; None where it has none of its own
    """

    def __init__(
        self, host: str, token: str | None, foreign: Callable[[str], None], ports: tuple[int, int] | None = None
    ) -> None:
        self._host = host
        self._token = token
        self._foreign = foreign
        self._ports = ports

    def answer(self, scope: Scope) -> Response | None:
        """What a request is answered that does not come in; None of one that does."""
        return self._refusal(scope) or self._entrance(scope)

    def answer_aside(self, scope: Scope) -> Response | None:
        """As `answer`, of a Stop on the port of its own: that is another origin than the page's, and of the same site.

        It has no header of the page's own, for which a browser would ask beforehand whether it may.
        """
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return _refused(421, "this server is asked by its own address only")
        if (
            headers.get("origin") != self.page_origin(hosts[0])
            or headers.get("sec-fetch-site", "same-site") != "same-site"
        ):
            return self._of_another_site(scope, headers)
        return _length_refused(headers) or self._entrance(scope)

    def page_origin(self, host: str) -> str:
        """Of the pages, for who has asked the port of Stop by the name `host`."""
        port = self._ports[0] if self._ports else 80
        return f"http://{_name(host)}" + ("" if port == 80 else f":{port}")

    def policy(self, scope: Scope) -> str:
        """What a page may load, and whom it may ask: this server, and the port of Stop."""
        host = Headers(scope=scope).get("host", "")
        if self._ports is None or not self._is_ours(host) or "[" in host:  # of IPv6 a policy knows nothing
            return POLICY
        return POLICY.replace("connect-src 'self'", f"connect-src 'self' http://{_name(host)}:{self._ports[1]}")

    def _refusal(self, scope: Scope) -> Response | None:
        """What a request is answered that must not come in; None for all others."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return _refused(421, "this server is asked by its own address only")
        if scope["method"] in {"GET", "HEAD"}:
            return None if self._may_look(scope["path"], hosts[0], headers) else self._of_another_site(scope, headers)
        if scope["method"] != "POST":
            return _refused(405, "expected GET or POST")
        from_own_page = (
            headers.get("origin") == f"http://{hosts[0]}"
            and headers.get("sec-fetch-site", "same-origin") == "same-origin"
            and PAGE.fullmatch(headers.get(PAGE_HEADER, "")) is not None
        )
        if not from_own_page:
            return self._of_another_site(scope, headers)
        return _length_refused(headers)

    def _may_look(self, path: str, host: str, headers: Headers) -> bool:
        """Whether a page may be read: another site may link to pages, and have nothing else."""
        if path == "/events" and "text/event-stream" not in headers.get("accept", ""):
            return False  # a link, which would make whoever follows it look on, perhaps in charge
        is_page = path == "/" or path.startswith(LINKED)
        if not is_page and headers.get("origin", f"http://{host}") != f"http://{host}":
            return False  # all that browsers tell a server that is on another computer
        if headers.get("sec-fetch-site") not in {"cross-site", "same-site"}:
            return True
        return is_page and headers.get("sec-fetch-mode") == "navigate"

    def _of_another_site(self, scope: Scope, headers: Headers) -> Response:
        by = headers.get("origin") or headers.get("referer") or "a page that does not say where it is from"
        self._foreign(f"{by[:80]} asked this scanner for {scope['path'][:40]} and was refused")
        return _refused(403, "expected a request of this server's own page")

    def _entrance(self, scope: Scope) -> Response | None:
        """The way in with a token: the first visit brings it along and is given a cookie."""
        if self._token is None:
            return None
        given = cookie_parser(Headers(scope=scope).get("cookie", "")).get(COOKIE, "")
        if self._fits(given):
            return None
        asked = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if scope["method"] == "GET" and self._fits(asked):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(COOKIE, self._token, httponly=True, samesite="lax", path="/")
            return answer
        return _refused(401, "open the address that 'footscan console' has printed, with its token")

    def _fits(self, given: str) -> bool:
        return self._token is not None and hmac.compare_digest(given.encode(), self._token.encode())

    def _is_ours(self, host: str) -> bool:
        """Whether a browser that asks for `host` cannot have been led here by a name of somebody else's."""
        name = _name(host)
        if name in LOOPBACK_NAMES or name == self._host.lower():
            return True
        return self._token is not None and _is_address(name.removeprefix("[").removesuffix("]"))


def is_loopback(host: str) -> bool:
    """Whether only programs of this computer reach `host`."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _name(host: str) -> str:
    """Without the port."""
    return re.sub(r":\d{1,5}$", "", host).lower()


def _length_refused(headers: Headers) -> Response | None:
    length = headers.get("content-length", "")
    if length.isascii() and length.isdigit() and int(length[:9]) <= LARGEST_BODY:
        return None
    return _refused(413, f"expected a body of a told length, up to {LARGEST_BODY} bytes")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _refused(status: int, why: str) -> Response:
    return PlainTextResponse(f"footscan: {why}\n", status)

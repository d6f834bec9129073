"""Access control: loopback or a token, only the server's own pages, small requests; and the headers for browsers."""

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
"""Bytes of the body of a request: a bound of memory, far above the largest order."""
LINKED = ("/foot/", "/pair/", "/edit/")
"""Pages that other sites may link to, besides the first page."""
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
    """ASGI middleware: the application never sees a request that the rules refuse."""

    def __init__(self, app: ASGIApp, rules: "Rules") -> None:
        self._app = app
        self._rules = rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request; ASGI interface."""
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
    """The rules of access.

    Parameters
    ----------
    host : the address that the server listens on
    token : the token that a browser must send; None if none is required
    foreign : called with a sentence about each request from a page of another site
    ports : port of the pages, and port that accepts only Stop; None if Stop has no port of its own
    """

    def __init__(
        self, host: str, token: str | None, foreign: Callable[[str], None], ports: tuple[int, int] | None = None
    ) -> None:
        self._host = host
        self._token = token
        self._foreign = foreign
        self._ports = ports

    def answer(self, scope: Scope) -> Response | None:
        """The answer to a request that is not admitted; None if it is admitted."""
        return self._refusal(scope) or self._entrance(scope)

    def answer_aside(self, scope: Scope) -> Response | None:
        """As `answer`, for a Stop on its own port: for a browser that is another origin of the same site.

        The request has no custom header, because for that a browser would first send a preflight request.
        """
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return _refused(421, "expected a request to this server's own address")
        if (
            headers.get("origin") != self.page_origin(hosts[0])
            or headers.get("sec-fetch-site", "same-site") != "same-site"
        ):
            return self._of_another_site(scope, headers)
        return _length_refused(headers) or self._entrance(scope)

    def page_origin(self, host: str) -> str:
        """Origin of the pages, for a request to the port of Stop that named the server `host`."""
        port = self._ports[0] if self._ports else 80
        return f"http://{_name(host)}" + ("" if port == 80 else f":{port}")

    def policy(self, scope: Scope) -> str:
        """The content security policy of a page: it may connect to this server, and to the port of Stop."""
        host = Headers(scope=scope).get("host", "")
        if self._ports is None or not self._is_ours(host) or "[" in host:  # policies do not support IPv6 addresses
            return POLICY
        return POLICY.replace("connect-src 'self'", f"connect-src 'self' http://{_name(host)}:{self._ports[1]}")

    def _refusal(self, scope: Scope) -> Response | None:
        """The answer to a request that breaks a rule; None if it breaks none."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return _refused(421, "expected a request to this server's own address")
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
        """True if the page may be read: other sites may link to pages, but read nothing else."""
        if path == "/events" and "text/event-stream" not in headers.get("accept", ""):
            return False  # a link to it would register a page, perhaps in charge
        is_page = path == "/" or path.startswith(LINKED)
        if not is_page and headers.get("origin", f"http://{host}") != f"http://{host}":
            return False  # the only hint of browsers to a server on another computer
        if headers.get("sec-fetch-site") not in {"cross-site", "same-site"}:
            return True
        return is_page and headers.get("sec-fetch-mode") == "navigate"

    def _of_another_site(self, scope: Scope, headers: Headers) -> Response:
        origin = headers.get("origin") or headers.get("referer") or "a page of unknown origin"
        self._foreign(f"{origin[:80]} asked this scanner for {scope['path'][:40]} and was refused")
        return _refused(403, "expected a request from this server's own page")

    def _entrance(self, scope: Scope) -> Response | None:
        """Check the token: the first visit has it in its address, and gets a cookie for the next ones."""
        if self._token is None:
            return None
        cookie = cookie_parser(Headers(scope=scope).get("cookie", "")).get(COOKIE, "")
        if self._fits(cookie):
            return None
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if scope["method"] == "GET" and self._fits(token):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(COOKIE, self._token, httponly=True, samesite="lax", path="/")
            return answer
        return _refused(401, "expected a token: open the address that 'footscan console' has printed")

    def _fits(self, token: str) -> bool:
        return self._token is not None and hmac.compare_digest(token.encode(), self._token.encode())

    def _is_ours(self, host: str) -> bool:
        """True if `host` names this server; any other name may be of a foreign site that resolves to this address."""
        name = _name(host)
        if name in LOOPBACK_NAMES or name == self._host.lower():
            return True
        return self._token is not None and _is_address(name.removeprefix("[").removesuffix("]"))


def is_loopback(host: str) -> bool:
    """True if only programs of this computer can reach `host`."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _name(host: str) -> str:
    """The name of a host, without its port."""
    return re.sub(r":\d{1,5}$", "", host).lower()


def _length_refused(headers: Headers) -> Response | None:
    length = headers.get("content-length", "")
    if length.isascii() and length.isdigit() and int(length[:9]) <= LARGEST_BODY:
        return None
    return _refused(413, f"expected a content-length of up to {LARGEST_BODY} bytes")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _refused(status: int, why: str) -> Response:
    return PlainTextResponse(f"footscan: {why}\n", status)

"""Who is let in: loopback or a token, the server's own pages alone, small requests; and what browsers are told."""

import hmac
import ipaddress
import re
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "footscan_console"
PAGE_HEADER = "x-footscan-page"
PAGE = re.compile(r"[A-Za-z0-9]{8,64}")
LARGEST_BODY = 4096
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

    def __init__(self, app: ASGIApp, host: str, token: str | None) -> None:
        self._app = app
        self._host = host
        self._token = token

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
                for name, value in {**HEADERS, "content-security-policy": POLICY}.items():
                    headers.setdefault(name, value)
            await send(message)

        answer = self._refusal(scope) or self._entrance(scope)
        await (answer or self._app)(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> Response | None:
        """What a request is answered that must not come in; None for all others."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return _refused(421, "this server is asked by its own address only")
        if scope["method"] in {"GET", "HEAD"}:
            is_foreign = headers.get("sec-fetch-site") in {"cross-site", "same-site"}
            foreign = is_foreign and headers.get("sec-fetch-mode") != "navigate"
            return _refused(403, "another site has no business here") if foreign else None
        if scope["method"] != "POST":
            return _refused(405, "expected GET or POST")
        from_own_page = (
            headers.get("origin") == f"http://{hosts[0]}"
            and headers.get("sec-fetch-site", "same-origin") == "same-origin"
            and PAGE.fullmatch(headers.get(PAGE_HEADER, "")) is not None
        )
        if not from_own_page:
            return _refused(403, "expected a request of this server's own page")
        length = headers.get("content-length", "")
        if not length.isascii() or not length.isdigit() or int(length[:9]) > LARGEST_BODY:
            return _refused(413, f"expected a body of a told length, up to {LARGEST_BODY} bytes")
        return None

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
        name = re.sub(r":\d{1,5}$", "", host).lower()
        if name in LOOPBACK_NAMES or name == self._host.lower():
            return True
        return self._token is not None and _is_address(name.removeprefix("[").removesuffix("]"))


def is_loopback(host: str) -> bool:
    """Whether only programs of this computer reach `host`."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _refused(status: int, why: str) -> Response:
    return PlainTextResponse(f"footscan: {why}\n", status)

"""Stop by a request: in a thread of its own, and answered soon even if the board does not respond."""

import json
import threading
from typing import Any

from pipelines.console.console import Console
from pipelines.console.gate import Headers
from pipelines.console.guard import Rules
from schemas.base.errors import FootscanError, RefusedInput

CONFIRM_SECONDS = 0.15
"""How long the answer waits for the board; chosen by hand, since Stop must be answered within 0.3 s."""


def stop_asked(console: Console, rules: Rules, scope: dict[str, Any], is_aside: bool) -> tuple[int, bytes, Headers]:
    """Stop if the request is permitted; return status, body and further headers of the answer.

    The answer does not wait for a board that is slow to confirm; if it never confirms, the state reports it.

    Parameters
    ----------
    scope : ASGI scope of the request
    is_aside : True if it came on the port of Stop, whose answers need CORS headers for a page to read them
    """
    refusal = rules.answer_aside(scope) if is_aside else rules.answer(scope)
    if refusal is not None:
        return refusal.status_code, bytes(refusal.body), []
    further: Headers = []
    if is_aside:
        origin = next(value for name, value in scope["headers"] if name == b"origin")
        further = [(b"access-control-allow-origin", origin), (b"access-control-allow-credentials", b"true")]
    problem = _stop(console)
    if problem is None:
        return 204, b"", further
    status = 409 if isinstance(problem, RefusedInput) else 502
    return status, json.dumps({"problem": str(problem)}).encode(), further


def _stop(console: Console) -> FootscanError | None:
    """Stop the scanner; return the problem, if one is known within `CONFIRM_SECONDS`."""
    problems: list[FootscanError] = []

    def stop() -> None:
        try:
            console.stop()
        except FootscanError as error:
            problems.append(error)
            console.warn(f"Stop: {error}")

    stopping = threading.Thread(target=stop, name="console: stop the board", daemon=True)
    stopping.start()
    stopping.join(CONFIRM_SECONDS)
    return problems[0] if problems else None

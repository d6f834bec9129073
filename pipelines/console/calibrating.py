"""Orders and pictures of the page that calibrates the scanner."""

from collections.abc import Callable
from typing import Annotated

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route

from pipelines.console.console import Console
from pipelines.console.pages.calibrating import calibrating_page
from pipelines.live.calibrating.guide import Guide
from pipelines.live.calibrating.view import Action
from schemas.base.errors import RefusedInput
from schemas.base.model import Document

ACTS: dict[Action, Callable[[Guide], None]] = {
    "calibrate": lambda guide: guide.begin("calibration"),
    "check": lambda guide: guide.begin("check"),
    "put": Guide.put,
    "take": Guide.take,
    "next": Guide.next,
    "finish": Guide.finish,
    "discard": Guide.discard,
    "body": Guide.body,
    "film-body": Guide.film_body,
    "use": Guide.use,
    "end": Guide.end,
}


class CalibratingRequest(Document):
    """The body of an order of the page: an action of the guide."""

    action: Action
    number: Annotated[int, Field(ge=0, lt=10_000)] = 0
    """The placement to `go` to."""


def order(console: Console, page: str, body: bytes) -> None:
    """Give an order to the guide."""
    asked = CalibratingRequest.model_validate_json(body)
    if asked.action == "go":
        console.calibrate(page, lambda guide: guide.go(asked.number))
    else:
        console.calibrate(page, ACTS[asked.action])


def calibrating_routes(console: Console) -> list[Route]:
    """The page and its pictures."""

    async def page(_: Request) -> Response:
        return HTMLResponse(calibrating_page())

    async def stripes(_: Request) -> Response:
        return Response(await run_in_threadpool(_guide(console).picture), media_type="image/svg+xml")

    async def placement(_: Request) -> Response:
        picture = await run_in_threadpool(_guide(console).placement_picture)
        return Response(status_code=204) if picture is None else Response(picture, media_type="image/svg+xml")

    async def result(_: Request) -> Response:
        picture = await run_in_threadpool(_guide(console).result_picture)
        return Response(status_code=204) if picture is None else Response(picture, media_type="image/png")

    return [
        Route("/calibrating", page),
        Route("/calibrating/placement.svg", placement),
        Route("/calibrating/stripes.svg", stripes),
        Route("/calibrating/result.png", result),
    ]


def _guide(console: Console) -> Guide:
    if console.guide is None:
        raise RefusedInput("reference object", "is missing, expected reference.yaml beside rig.yaml")
    return console.guide

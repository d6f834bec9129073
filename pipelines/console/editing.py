"""Requests of the page that edits a scan, and the server of `footscan edit`, which serves nothing else."""

import asyncio
import getpass
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from typing import Annotated

import uvicorn
from pydantic import Field, ValidationError
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from footscan.report.markup import UNITS, number_or_dash, words
from footscan.report.scan.measure_drawings import landmark_place
from pipelines.archive.editing import Edit, ScanEditor
from pipelines.console.guard import Guard, Rules
from pipelines.console.pages.editing import editing_page, from_view
from pipelines.console.web import body_of, not_there, static_file
from schemas.base.errors import Fault, FootscanError, RefusedInput
from schemas.landmarks import LandmarkPosition
from schemas.measures import Measures

EDITORS_KEPT = 2
"""Scans whose surfaces are kept in memory: a bound of memory."""


class PageEdit(Edit):
    """An edit as the page has it: what was moved, in the frame of its view, and what the program shall find again."""

    moved: dict[str, LandmarkPosition] = Field(default_factory=dict)
    back: Annotated[list[str], Field(max_length=40)] = Field(default_factory=list)

    def whole(self, editor: ScanEditor) -> Edit:
        """All landmarks, in the scanner's frame: those that were set before, too."""
        before, measures = editor.decisions.landmarks.points(), editor.measures()
        kept = {name: point for name, point in before.items() if name not in self.back}
        moved = {name: from_view(point, measures) for name, point in self.moved.items()}
        own = self.model_dump(exclude={"moved", "back", "landmarks"})
        return Edit(landmarks={**kept, **moved}, **own)


def editing_routes(editor_of: Callable[[str, str], ScanEditor]) -> list[Route]:
    """Routes of the pages of scans, `/edit/<patient>/<scan>`.

    `editor_of` makes the editor of a scan from patient and scan; RefusedInput if there is none.
    """
    worker = ThreadPoolExecutor(1, thread_name_prefix="console: editing")
    cached = lru_cache(EDITORS_KEPT)(editor_of)

    async def answer(work: Callable[[ScanEditor], Response], request: Request) -> Response:
        def run() -> Response:
            def problem(text: str, status: int) -> Response:
                if request.method == "GET":
                    return PlainTextResponse(f"footscan: {text}\n", status)
                return JSONResponse({"problem": text}, status)

            try:
                return work(cached(request.path_params["patient"], request.path_params["scan"]))
            except ValidationError:
                return problem("the edit has unexpected fields or values", 400)
            except Fault as error:
                return problem(str(error), 502)
            except FootscanError as error:
                return problem(str(error), 409)

        return await asyncio.get_running_loop().run_in_executor(worker, run)

    async def page(request: Request) -> Response:
        cached.cache_clear()  # it was opened anew: so are the files
        return await answer(_page, request)

    async def order(work: Callable[[bytes, ScanEditor], Response], request: Request) -> Response:
        return await answer(partial(work, await body_of(request)), request)

    return [
        Route("/edit/{patient}/{scan}", page),
        Route("/edit/{patient}/{scan}/try", partial(order, _try), methods=["POST"], name="try"),
        Route("/edit/{patient}/{scan}/save", partial(order, _save), methods=["POST"], name="save"),
    ]


def _page(editor: ScanEditor) -> Response:
    scan = editor.scan
    exports, by = editor.job.wanted.exports, getpass.getuser()
    mesh, measures = editor.mesh, editor.measures()
    return HTMLResponse(editing_page(scan.name, scan.document.posture, mesh, measures, editor.decisions, by, exports))


def _try(body: bytes, editor: ScanEditor) -> Response:
    saved = editor.measures()
    now = editor.tried(PageEdit.model_validate_json(body).whole(editor))
    seen = now.model_copy(update={"transform": saved.transform})  # the page keeps its view
    return JSONResponse(
        {
            "measures": {name: _compared(name, saved, now) for name in now.measures},
            "landmarks": {name: landmark_place(seen, name).tolist() for name in now.landmarks},
        }
    )


def _compared(name: str, saved: Measures, now: Measures) -> dict[str, str]:
    measure, before = now.measures[name], saved.measures.get(name)
    unit, decimals = UNITS[measure.unit]
    shown = number_or_dash(measure.value, decimals)
    change = ""
    if before is not None and measure.value is not None and before.value is not None:
        change = f"{measure.value - before.value:+.{decimals + 1}f}"
        change = change if float(change) else ""
    return {
        "label": words(name),
        "now": shown,
        "change": change,
        "unit": unit,
        "status": measure.status,
    }


def _save(body: bytes, editor: ScanEditor) -> Response:
    end = editor.save(PageEdit.model_validate_json(body).whole(editor))
    if end.problem is not None:
        return JSONResponse({"problem": end.problem}, 409)
    return JSONResponse({"scan": end.scan})


def edit_server(editor: ScanEditor, host: str, token: str | None) -> uvicorn.Server:
    """Return a server for the page of one scan, behind the guard; `host` and `token` as in `Rules`."""
    document = editor.scan.document
    address = f"/edit/{document.patient}/{document.scan}"

    def editor_of(patient: str, scan: str) -> ScanEditor:
        if (patient, scan) != (document.patient, document.scan):
            raise RefusedInput(f"{patient}/{scan}"[:80], f"is not edited here, expected {editor.scan.name}")
        return ScanEditor(editor.job, editor.folder)

    async def first(_: Request) -> Response:
        return RedirectResponse(address, 303)

    application = Starlette(
        routes=[Route("/", first), *editing_routes(editor_of), Route("/static/{name}", static_file)],
        middleware=[Middleware(Guard, rules=Rules(host, token, lambda _: None))],
        exception_handlers={RefusedInput: not_there},
    )
    return uvicorn.Server(
        uvicorn.Config(application, log_level="critical", access_log=False, server_header=False, proxy_headers=False)
    )

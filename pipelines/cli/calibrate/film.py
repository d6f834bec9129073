"""`footscan calibrate film` and `footscan calibrate morning`: the scanner films the reference object itself."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.live.options import (
    CAPTURES,
    VIRTUAL_FOLDER,
    RigFile,
    StateTeller,
    Virtual,
    VirtualFolder,
    opened_rig,
    plain_world,
)
from pipelines.cli.terminal.output import AsJson, message, print_json, print_table
from schemas.base.errors import FootscanError, RefusedInput

if TYPE_CHECKING:
    from pipelines.live.calibrating.filmed import Purpose
    from pipelines.live.calibrating.guide import Guide
    from pipelines.live.calibrating.view import Action, View

KEYS: "dict[str, tuple[Action, str]]" = {
    "v": ("put", "put the virtual object there"),
    "t": ("take", "film it"),
    "n": ("next", "next placement"),
    "f": ("finish", "finish with what is filmed"),
    "b": ("body", "film the body, too"),
    "m": ("film-body", "film the body"),
    "u": ("use", "use it for scans"),
    "d": ("discard", "discard what is filmed"),
    "q": ("end", "leave; what is filmed stays"),
}
"""Keys, the actions that they stand for, and these in words. A number goes to a placement."""

Reference = Annotated[
    Path | None, typer.Option(help="Reference object (YAML); default: reference.yaml beside rig.yaml.")
]
Captures = Annotated[Path, typer.Option(help="Folder of the captures.")]
Power = Annotated[
    float | None, typer.Option(min=0.01, max=1, help="Power of the lasers; default: chosen at the first placement.")
]
Exposure = Annotated[
    float | None, typer.Option(min=0.05, max=1000, help="Exposure of all cameras, ms; requires --power.")
]
Yes = Annotated[
    bool, typer.Option("--yes", help="Ask nothing and do what is usual; end with status 1 if a placement is wrong.")
]


def film(
    rig: RigFile = None,
    reference: Reference = None,
    captures: Captures = CAPTURES,
    body: Annotated[
        Path | None, typer.Option(help="Mesh of the body that shows the laser planes (mm); default: the standard one.")
    ] = None,
    with_body: Annotated[bool, typer.Option("--with-body", help="With --yes: film the body, too.")] = False,
    power: Power = None,
    exposure_ms: Exposure = None,
    yes: Yes = False,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> int:
    """Calibrate the scanner by the scanner: film the reference object, placement by placement."""
    files = rig, reference, captures, body
    with _guide(files, power, exposure_ms, virtual_folder if virtual else None, is_timed=with_body) as guide:
        last = _converse(guide, "calibration", yes, with_body)
    _print_outcome(last, as_json)
    return 0 if last.outcome is not None else 1


def morning(
    rig: RigFile = None,
    reference: Reference = None,
    captures: Captures = CAPTURES,
    power: Power = None,
    exposure_ms: Exposure = None,
    yes: Yes = False,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> int:
    """Check by the scanner whether its calibration still holds; the exit status is 1 if a camera has moved."""
    files = rig, reference, captures, None
    with _guide(files, power, exposure_ms, virtual_folder if virtual else None) as guide:
        last = _converse(guide, "check", yes, with_body=False)
    _print_outcome(last, as_json)
    return 0 if last.is_well else 1


@contextmanager
def _guide(
    files: tuple[Path | None, Path | None, Path, Path | None],
    power: float | None,
    exposure_ms: float | None,
    virtual: Path | None,
    *,
    is_timed: bool = False,
) -> "Iterator[Guide]":
    """A guide over the scanner of a rig, or over the virtual scanner in the folder `virtual`.

    `is_timed`: the latencies of a virtual scanner are needed, and measured if they are missing.
    """
    from pipelines.cli.live.light import light_of
    from pipelines.live.calibrating.guide import Guide
    from pipelines.live.calibrating.live import LiveStanding
    from pipelines.live.calibrating.settings import settings_of
    from pipelines.live.scanner import LiveScanner

    rig, reference, captures, body = files
    world = plain_world(virtual is not None, virtual or VIRTUAL_FOLDER)
    with opened_rig(rig, virtual or VIRTUAL_FOLDER, world, calibrated=is_timed) as opened:
        light = light_of(opened.rig, power, exposure_ms, virtual is not None)
        settings = settings_of(opened.file, captures, reference, body, light)
        if settings is None:
            problem = "is missing, expected the reference object there or --reference"
            raise RefusedInput(opened.file.parent / "reference.yaml", problem)
        with LiveScanner(opened.rig) as scanner:
            scanner.listen(StateTeller())
            for problem in scanner.connect().values():
                message(f"footscan: {problem}")
            yield Guide(LiveStanding(scanner), settings, None if opened.world is None else opened.world.put)


def _converse(guide: "Guide", purpose: "Purpose", yes: bool, with_body: bool) -> "View":
    """Lead through a session; return its last view."""
    guide.begin(purpose)
    shown = None
    while True:
        view = guide.view
        if view != shown:
            _tell(guide)
        shown = view
        if yes:
            if view.complaints or view.step in {"used", "checked"}:
                return view
            action = "body" if with_body and view.step == "calibrated" else view.actions[0]
            _do(guide, action)
            continue
        answer = _ask(view)
        if answer is None:
            return view
        try:
            if isinstance(answer, int):
                guide.go(answer - 1)
            elif answer in {"end", "discard"}:
                _do(guide, answer)
                return view if answer == "end" else guide.view
            else:
                _do(guide, answer)
        except FootscanError as error:
            message(f"footscan: {error}")
            shown = None


def _do(guide: "Guide", action: "Action") -> None:
    {
        "put": guide.put, "take": guide.take, "next": guide.next, "finish": guide.finish, "discard": guide.discard,
        "body": guide.body, "film-body": guide.film_body, "use": guide.use, "end": guide.end,
    }[action]()  # fmt: skip


def _tell(guide: "Guide") -> None:
    from pipelines.engine.files.atomic import write_atomically

    view = guide.view
    message("")
    for complaint in view.complaints:
        message(f"! {complaint.words}")
    message(view.words)
    if view.coverage and view.step in {"look", "filmed"}:
        picture = Path(view.folder) / "coverage.svg"
        write_atomically(picture, guide.picture().encode())
        shares = ", ".join(f"{camera}: {100 * share:.0f} %" for camera, share in sorted(view.coverage.items()))
        message(f"covered of each camera's picture so far: {shares} ({picture})")
    if view.price:
        message(view.price)


def _ask(view: "View") -> "Action | int | None":
    """Ask what to do next; a number is a placement, None is the end of the input."""
    keys = {action: key for key, (action, _) in KEYS.items()}
    words = dict(KEYS.values())
    known = [action for action in view.actions if action in keys]
    offered = [f"Enter: {words[known[0]]}", *(f"{keys[action]}: {words[action]}" for action in known[1:])]
    if "go" in view.actions:
        offered.append(f"1 to {len(view.placements)}: that placement")
    message(f"[{'; '.join(offered)}]")
    while True:
        line = sys.stdin.readline()
        if not line:
            return None
        answer = line.strip().lower()
        if not answer:
            return known[0]
        if answer.isdecimal() and "go" in view.actions:
            return int(answer[:6])
        if answer in KEYS and KEYS[answer][0] in known:
            return KEYS[answer][0]
        message(f"{answer[:20]!r}: expected one of the keys above")


def _print_outcome(view: "View", as_json: bool) -> None:
    if as_json:
        outcome = None if view.outcome is None else asdict(view.outcome)
        print_json({"step": view.step, "capture": view.folder, "taken": list(view.taken), "outcome": outcome})
        return
    if view.outcome is not None:
        print_table("", view.outcome.columns, view.outcome.rows)
        if view.outcome.planes:
            print_table("Laser planes", view.outcome.plane_columns, view.outcome.planes)
        for remark in view.outcome.remarks:
            message(remark)
        message(f"{view.outcome.file}: stored")

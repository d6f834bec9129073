"""`footscan scan`, `footscan home` and `footscan jog`."""

import datetime
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from pipelines.cli.live.light import light_of
from pipelines.cli.live.options import (
    OF_VIRTUAL,
    VIRTUAL_FOLDER,
    GridMm,
    RigFile,
    StateTeller,
    Virtual,
    VirtualFolder,
    opened_rig,
    plain_world,
)
from pipelines.cli.terminal.output import AsJson, message, print_json, print_line
from schemas.base.errors import Fault, FootscanError, RefusedInput

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pipelines.live.scan_order import LiveResult
    from pipelines.live.scanner import LiveScanner
    from pipelines.live.virtual.world import World
    from schemas.rig import Rig

DARK_GRID_MM = 100.0
"""Between rendered pictures with the lasers off; coarse, because only --texture uses them."""

Speed = Annotated[float | None, typer.Option("--speed", min=0.1, help="Speed of the heads, mm/s; default: the rig's.")]


def scan(
    patient: Annotated[str, typer.Argument(help="Pseudonym of the patient.")],
    side: Annotated[Literal["right", "left"], typer.Argument(help="Side of the foot on the glass.")],
    rig: RigFile = None,
    out: Annotated[Path, typer.Option(help="Folder of the archive.")] = Path("archive"),
    results: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results"),
    name: Annotated[str | None, typer.Option(help="Name of the scan; default: day and side.")] = None,
    posture: Annotated[
        Literal["sitting", "half_weight", "standing", "unknown"],
        typer.Option(
            help="Sitting; standing with half the weight on the foot, as ISO 7250-1 requires; or standing on it."
        ),
    ] = "unknown",
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; default: the rig's.")] = None,
    speed: Speed = None,
    from_mm: Annotated[float | None, typer.Option(help="X of the first frame, mm; default: the rig's.")] = None,
    to_mm: Annotated[float | None, typer.Option(help="X of the last frame, mm; default: the rig's.")] = None,
    power: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=1, help="Power of the lasers, as a share of full power; default: set from a test picture."
        ),
    ] = None,
    exposure_ms: Annotated[
        float | None, typer.Option(min=0.05, max=1000, help="Exposure of all cameras, ms; requires --power.")
    ] = None,
    texture: Annotated[
        bool, typer.Option("--texture", help="Film skin colours on the way back, with the lasers off.")
    ] = False,
    keep_partial: Annotated[
        bool,
        typer.Option(
            "--keep-partial",
            help="Keep a scan even if the films of some cameras are incomplete; these cameras are left out.",
        ),
    ] = False,
    measure: Annotated[bool, typer.Option("--measure/--no-measure", help="Reconstruct and measure at once.")] = True,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    foot_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            rich_help_panel=OF_VIRTUAL,
            help="Random seed of a foot drawn from the population; default: the mean male foot.",
        ),
    ] = None,
    light: Annotated[
        Literal["dark", "ambient", "bright"], typer.Option(rich_help_panel=OF_VIRTUAL, help="Light in the room.")
    ] = "ambient",
    ripple: Annotated[
        float,
        typer.Option(
            min=0, max=0.5, rich_help_panel=OF_VIRTUAL, help="Ripple of the heads' speed, as a share, at 1 Hz."
        ),
    ] = 0.0,
    pause: Annotated[
        float,
        typer.Option(min=0, max=60, rich_help_panel=OF_VIRTUAL, help="Pause of the heads halfway, s."),
    ] = 0.0,
    jitter_ms: Annotated[
        float,
        typer.Option(min=0, max=25, rich_help_panel=OF_VIRTUAL, help="Jitter of the cameras' exposure times, ms."),
    ] = 10.0,
    grid_mm: GridMm = 0.45,
    as_json: AsJson = False,
) -> int:
    """Scan a foot: home, film, store, reconstruct and measure."""
    from footscan.ahead_of_time import SCAN, Compilation
    from pipelines.live.scan_order import ScanOrder
    from pipelines.live.scanner import LiveScanner
    from pipelines.live.storing import ScanName, next_scan_name
    from schemas.base.model import pseudonym

    pseudonym(patient, "PATIENT")
    if name is not None:
        pseudonym(name, "--name")
    world = None
    if virtual:
        from pipelines.live.virtual.world import World

        world = World(
            pictures=str(virtual_folder / "pictures"), subject=side, foot_seed=foot_seed, light=light, ripple=ripple,
            pause_s=pause, jitter_ms=jitter_ms, grid_mm=grid_mm, start_mm=0.0 if from_mm is None else from_mm,
            end_mm=400.0 if to_mm is None else to_mm, mm_per_s=speed or 400.0 / 11.0,
            dark_grid_mm=grid_mm if texture else DARK_GRID_MM,
        )  # fmt: skip
    with (
        Compilation(*[SCAN] if measure else [], in_background=True) as loops,
        opened_rig(rig, virtual_folder, world, calibrated=True) as opened,
    ):
        used = _with_travel(opened.rig, speed, from_mm, to_mm)
        today = datetime.datetime.now().astimezone().date()
        order = ScanOrder(
            ScanName(patient, name or next_scan_name(out, patient, side, today), side, today, posture),
            out,
            results if measure else None,
            calibration,
            light_of(used, power, exposure_ms, virtual),
            texture,
            keep_partial,
        )
        _warn_of_drift(calibration, used)
        with LiveScanner(used, loops) as scanner:
            scanner.listen(StateTeller())
            if problems := scanner.connect():
                raise Fault("; ".join(problems.values()))
            result = scanner.scan(order)
    _print(result, _known(world), as_json)
    return 0 if result.measured is None else _status(result.measured.kind)


def home(
    rig: RigFile = None,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> None:
    """Home the heads and align them."""
    with _homed(rig, virtual, virtual_folder) as one:
        _print_heads(one.heads.position_mm(), as_json)


def jog(
    heads: Annotated[Literal["all", "1", "2", "3", "4"], typer.Argument(help="Which.")],
    mm: Annotated[float, typer.Argument(help="Distance along X, mm; write -- before a negative one.")],
    rig: RigFile = None,
    speed: Speed = 20.0,
    virtual: Virtual = False,
    virtual_folder: VirtualFolder = VIRTUAL_FOLDER,
    as_json: AsJson = False,
) -> None:
    """Move the heads, with the lasers off. Heads that are not homed are homed first."""
    with _homed(rig, virtual, virtual_folder) as one:
        _print_heads(one.jog(mm, speed or 20.0, None if heads == "all" else int(heads)), as_json)


@contextmanager
def _homed(rig: RigFile, virtual: bool, virtual_folder: Path) -> "Iterator[LiveScanner]":
    """Connect to the scanner, home the heads and report each state."""
    from pipelines.live.scanner import LiveScanner

    with (
        opened_rig(rig, virtual_folder, plain_world(virtual, virtual_folder)) as opened,
        LiveScanner(opened.rig) as one,
    ):
        one.listen(StateTeller())
        one.home()
        yield one


def _warn_of_drift(calibration: Path | None, rig: "Rig") -> None:
    """Print a warning if a camera had moved when the calibration was last checked."""
    from pipelines.calibration_check import scanner_check

    file = calibration or (None if rig.calibration is None else Path(rig.calibration))
    check = scanner_check(file, [camera.id for camera in rig.cameras])
    if check is not None and check.doubt is not None:
        message(f"Warning: {check.doubt}; the measures of this scan will be uncertain")


def _with_travel(rig: "Rig", speed: float | None, from_mm: float | None, to_mm: float | None) -> "Rig":
    start = rig.travel.start_mm if from_mm is None else from_mm
    end = rig.travel.end_mm if to_mm is None else to_mm
    if end <= start:
        raise RefusedInput("--to-mm", f"expected more than {start:g}, found {end:g}")
    travel = {"start_mm": start, "length_mm": end - start, "mm_per_s": speed or rig.travel.mm_per_s}
    return rig.model_copy(update={"travel": rig.travel.model_copy(update=travel)})


def _known(world: "World | None") -> dict[str, float]:
    """The true measures of a virtual foot."""
    if world is None or world.subject not in {"right", "left"}:
        return {}
    from pipelines.live.virtual.world import virtual_foot

    return virtual_foot(world, "left" if world.subject == "left" else "right").measures


def _print(result: "LiveResult", known: dict[str, float], as_json: bool) -> None:
    from pipelines.cli.foot.measure import print_measures

    for camera, problem in sorted(result.stored.left_out.items()):
        message(f"camera {camera} is left out: {problem}")
    measured = result.measured
    if measured is not None and measured.problem is not None:
        message(f"footscan: {measured.problem}")
    for warning in () if measured is None else measured.warnings:
        message(f"Warning: {warning}")
    if as_json:
        print_json(_json(result))
        return
    print_line(f"Scan: {result.stored.place}")
    if measured is not None and measured.folder is not None and measured.measures is not None:
        print_measures(measured.measures, known)
        print_line(f"Report: {measured.folder / 'report.html'}")


def _json(result: "LiveResult") -> dict[str, Any]:
    measured = result.measured
    return {
        "scan": str(result.stored.place),
        "cameras": [
            {
                "camera": camera,
                "frames": len(film.x_mm),
                "lost": {str(frame): reason for frame, reason in film.lost.items()},
                "position_sd_mm": round(float((film.sd_mm**2).mean() ** 0.5), 4),
                "mm_per_s": round(film.mm_per_s, 3),
            }
            for camera, film in sorted(result.stored.films.items())
        ],
        "left_out": {str(camera): problem for camera, problem in result.stored.left_out.items()},
        "results": None if measured is None or measured.folder is None else str(measured.folder),
        "problem": None if measured is None else measured.problem,
        "warnings": [] if measured is None else list(measured.warnings),
        "measures": None
        if measured is None or measured.measures is None
        else measured.measures.model_dump(mode="json")["measures"],
    }


def _print_heads(x_mm: tuple[float, ...], as_json: bool) -> None:
    if as_json:
        print_json({"x_mm": list(x_mm)})
    else:
        print_line(", ".join(f"head {head} at X = {x:.2f} mm" for head, x in enumerate(x_mm, start=1)))


def _status(kind: str | None) -> int:
    """The exit status of a command on one scan."""
    match kind:
        case None:
            return 0
        case "refused":
            return RefusedInput.exit_status
        case "finding":
            return 1
    return FootscanError.exit_status

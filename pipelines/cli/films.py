"""`footscan simulate` and `footscan ingest`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.terminal.output import AsJson, message, note, print_json, print_table
from schemas.base.errors import Fault, RefusedInput

if TYPE_CHECKING:
    from schemas.parameters.simulation import SimulationSettings
    from schemas.reference import ReferenceObject

simulate = typer.Typer(help="Film with the virtual scanner: a scan, or the reference object.", no_args_is_help=True)

Out = Annotated[Path, typer.Option(help="Folder to write; must be new or empty.")]
RoomLight = Annotated[Literal["dark", "ambient", "bright"], typer.Option(help="Light in the room.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed of noise, speckle and clicks.")]
ScannerSeed = Annotated[
    int, typer.Option(min=0, help="Random seed of the scanner's geometry; use the same one for capture and scans.")
]


@simulate.command("scan")
def simulate_scan(
    out: Out,
    mesh: Annotated[Path | None, typer.Argument(help="Mesh in mm: STL, PLY or OBJ.")] = None,
    foot: Annotated[
        Literal["right", "left"] | None, typer.Option(help="Film the parametric foot instead of a mesh.")
    ] = None,
    block: Annotated[
        bool, typer.Option("--block", help="Film the block of 150 x 100 x 50 mm instead of a mesh.")
    ] = False,
    patient: Annotated[str, typer.Option(help="Pseudonym of the patient.")] = "P0001",
    scan: Annotated[str, typer.Option(help="Name of the scan; default: the folder's name.")] = "",
    side: Annotated[Literal["right", "left", "unknown"], typer.Option(help="Side of the foot.")] = "unknown",
    calibration: Annotated[
        str | None, typer.Option(help="Calibration path to write into scan.yaml, relative to it.")
    ] = None,
    turn_deg: Annotated[
        float | None,
        typer.Option(
            help="Rotation about Z in degrees, counter-clockwise seen from above; default: 5 for --block, else 0."
        ),
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=10_000)] = 200,
    step_mm: Annotated[float, typer.Option(min=0.01, max=1000)] = 2.0,
    light: RoomLight = "ambient",
    seed: Seed = 1,
    scanner_seed: ScannerSeed = 1,
    stripe_truth: Annotated[
        bool, typer.Option("--stripe-truth", help="Also write the true stripe centres (CSV).")
    ] = False,
    laser_off: Annotated[bool, typer.Option("--laser-off", help="Also film backgrounds, with the laser off.")] = False,
) -> None:
    """Film a mesh that stands on the glass, centred on the travel."""
    from footscan.virtual.filming.record import ScanExtras, ScanName, record_scan
    from footscan.virtual.optics.scene import Mesh
    from footscan.virtual.stage.standing import BLOCK_TURN_DEG, stand_in_the_middle
    from pipelines.cli.terminal.progress import frame_progress
    from pipelines.virtual_objects import virtual_object
    from schemas.base.model import pseudonym

    if [mesh is not None, foot is not None, block].count(True) != 1:
        raise RefusedInput("simulate scan", "expected one of MESH, --foot and --block")
    _check_empty(out)
    vertices, faces, known_side = virtual_object(mesh, foot, side)
    settings = _settings(light, seed, scanner_seed, frames, step_mm)
    turn = turn_deg if turn_deg is not None else BLOCK_TURN_DEG if block else 0.0
    vertices = stand_in_the_middle(vertices, settings, turn)
    with frame_progress("filming") as progress:
        record_scan(
            Mesh(vertices, faces),
            out,
            ScanName(pseudonym(patient, "--patient"), pseudonym(scan or out.resolve().name, "--scan"), known_side),
            settings,
            extras=ScanExtras(calibration, stripe_truth=stripe_truth, laser_off=laser_off),
            progress=progress,
        )
    note(f"{out}: filmed {settings.frames} frames by each of 8 cameras")


@simulate.command("capture")
def simulate_capture(
    out: Out,
    reference: Annotated[Path | None, typer.Option(help="Reference object (YAML); default: the standard one.")] = None,
    placements: Annotated[int | None, typer.Option(min=1, help="Number of placements to film; default: all.")] = None,
    light: RoomLight = "ambient",
    seed: Seed = 1,
    scanner_seed: ScannerSeed = 1,
) -> None:
    """Film the reference object in its placements, and write the chart of its corners as if clicked by hand."""
    from footscan.virtual.filming.capture import record_capture
    from footscan.virtual.stage.reference import read_reference, standard_reference
    from pipelines.cli.terminal.progress import frame_progress

    _check_empty(out)
    filmed = standard_reference() if reference is None else read_reference(reference)
    if placements is not None:
        filmed = _first_placements(filmed, placements)
    with frame_progress("filming") as progress:
        record_capture(
            out,
            filmed,
            settings=_settings(light, seed, scanner_seed),
            clicks_seed=seed,
            progress=progress,
        )
    count = len(filmed.placements_mm)
    placed = f"{count} placement{'s' * (count != 1)}"
    note(f"{out}: filmed the reference object in {placed}, chart in {out / 'chart.csv'}")


@simulate.command("chessboard")
def simulate_chessboard(
    out: Out,
    light: RoomLight = "ambient",
    seed: Seed = 1,
    scanner_seed: ScannerSeed = 1,
) -> None:
    """Take pictures of a chessboard with each camera, with and without the laser."""
    from footscan.virtual.chessboard.record import record_chessboard
    from pipelines.cli.terminal.progress import frame_progress

    _check_empty(out)
    with frame_progress("poses") as progress:
        record_chessboard(out, settings=_settings(light, seed, scanner_seed), progress=progress)
    note(f"{out}: pictures of a chessboard by 8 cameras")


@simulate.command("world")
def simulate_world(
    out: Out,
    seed: Annotated[int | None, typer.Option(min=0, max=2**32 - 1, help="Random seed of the whole world.")] = None,
    world: Annotated[
        Path | None, typer.Option(help="Description of a world (world.json) that is filmed instead of a drawn one.")
    ] = None,
    points: Annotated[
        bool, typer.Option("--points", help="Write the stripe points of each camera (CSV) instead of films.")
    ] = False,
    body: Annotated[
        Path | None,
        typer.Option(help="Film this body (mesh, mm) instead of the subject, for `footscan calibrate travel`."),
    ] = None,
) -> None:
    """Draw a whole world, and film it: a calibrated scan, with the true surface and the true measures beside it."""
    import numpy as np

    from footscan.mesh.formats.files import read_mesh
    from footscan.virtual.optics.scene import Mesh
    from footscan.virtual.worlds.draw import draw_world
    from pipelines.cli.terminal.progress import frame_progress
    from pipelines.worlds.export import write_films, write_points
    from schemas.base.json_files import read_json
    from schemas.world import World

    if (seed is None) == (world is None):
        raise RefusedInput("simulate world", "expected one of --seed and --world")
    if points and body is not None:
        raise RefusedInput("simulate world", "expected one of --points and --body")
    shape = None
    if body is not None:
        vertices, faces = read_mesh(body)
        shape = Mesh(vertices, faces.astype(np.int64))
    _check_empty(out)
    whole = read_json(world, World) if world is not None else draw_world(seed or 0)
    if points:
        write_points(whole, out)
    else:
        with frame_progress("filming") as progress:
            write_films(whole, out, progress, shape)
    note(f"{out}: world {whole.seed}")


def ingest(
    folders: Annotated[list[Path], typer.Argument(help="Scan folders, or an archive of them.")],
    repack: Annotated[
        bool, typer.Option("--repack", help="Read no films: gather arrays of one file a frame in one file a camera.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Convert films to Zarr: one array per camera in frames.zarr beside the films, with the JPEG bytes unchanged."""
    from pipelines.archive.ingest import ingest_scans, repack_scans
    from pipelines.cli.terminal.progress import frame_progress

    with frame_progress("scans") as progress:
        ends = (repack_scans if repack else ingest_scans)(folders, progress)
    if as_json:
        print_json([end.to_json() for end in ends])
    elif repack:
        rows = [[e.scan, str(e.camera or ""), str(e.files_fewer), str(e.store_bytes), e.problem or "ok"] for e in ends]
        print_table("", ["scan", "camera", "files fewer", "store bytes", ""], rows)
    else:
        rows = [
            [
                e.scan,
                str(e.camera or ""),
                str(e.frames),
                str(e.lost),
                f"{e.film_bytes}",
                f"{e.store_bytes}",
                e.problem or "ok",
            ]
            for e in ends
        ]
        print_table("", ["scan", "camera", "frames", "lost", "film bytes", "store bytes", ""], rows)
    failed = [end for end in ends if end.problem is not None]
    for end in failed:
        message(f"footscan: {end.problem}")
    if not failed:
        return 0
    if any(end.exit_status == Fault.exit_status for end in failed):
        return Fault.exit_status
    return RefusedInput.exit_status if len(folders) == 1 and len({end.scan for end in ends}) == 1 else 1


def _settings(
    light: Literal["dark", "ambient", "bright"], seed: int, scanner_seed: int, frames: int = 200, step_mm: float = 2.0
) -> "SimulationSettings":
    from schemas.parameters.simulation import SimulationSettings

    return SimulationSettings(seed=seed, scanner_seed=scanner_seed, ambient=light, frames=frames, step_mm=step_mm)


def _first_placements(reference: "ReferenceObject", count: int) -> "ReferenceObject":
    known = len(reference.placements_mm)
    if count > known:
        raise RefusedInput("--placements", f"the reference object has {known}, expected at most as many, found {count}")
    return reference.model_copy(update={"placements_mm": reference.placements_mm[:count]})


def _check_empty(folder: Path) -> None:
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise RefusedInput(folder, "is there already, expected a new or an empty folder")

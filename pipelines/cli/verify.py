"""`footscan verify`: what a scanner makes of bodies whose form is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.terminal.output import AsJson, figure, print_json, print_line, print_table
from schemas.base.errors import Finding, RefusedInput, one_line

if TYPE_CHECKING:
    from schemas.fits import CuboidDimension, CuboidFit, SphereFit

BASES = {"faces": "face", "stripes": "stripes", "floor": "floor", None: "not seen"}

verify = typer.Typer(help="Compare a scan of a body of known shape with that shape.", no_args_is_help=True)


@verify.command("block")
def block(
    scan: Annotated[Path, typer.Argument(help="Results of a scan, or a cloud or mesh of the block: PLY, STL, OBJ.")],
    nominal: Annotated[str, typer.Option(help="True dimensions of the block, mm.")] = "150x100x50",
    edge_mm: Annotated[float, typer.Option(min=0, max=20, help="Ignore points closer to an edge than this, mm.")] = 3.0,
    floor_mm: Annotated[
        float,
        typer.Option(
            min=-1e4,
            max=1e4,
            help="Z of the supporting plane, mm; used for the height when the bottom face is not seen.",
        ),
    ] = 0.0,
    sheet_mm: Annotated[
        tuple[float, float],
        typer.Option(
            help="Smallest and largest standard deviation of the laser's profile; 0 0: do not look for cut stripes."
        ),
    ] = (0.2, 0.6),
    as_json: AsJson = False,
) -> None:
    """Fit a cuboid: dimensions, angles and flatness, compared with Table 6-1 of the thesis."""
    from pipelines.block import beside_nominal, cloud_of, error_mm, fit_block
    from schemas.fits import CuboidParameters

    true = _dimensions(nominal)
    if not 0 <= sheet_mm[0] <= sheet_mm[1] <= 5:
        raise RefusedInput("--sheet-mm", f"{sheet_mm[0]:g} {sheet_mm[1]:g}, expected two mm from 0 to 5, ascending")
    source = cloud_of(scan)
    fit = fit_block(source, CuboidParameters(edge_mm=edge_mm, floor_mm=floor_mm, sheet_mm=sheet_mm))
    compared = beside_nominal(fit, true)
    if as_json:
        rows = [
            {"nominal_mm": true_mm, "thesis_mm": thesis_mm, "error_mm": error_mm(found, true_mm)}
            | found.model_dump(mode="json")
            for true_mm, thesis_mm, found in compared
        ]
        print_json({"file": str(source), "table_6_1": rows, "fit": fit.model_dump(mode="json")})
    else:
        _print_block(fit, compared, source)


@verify.command("sphere")
def sphere(
    files: Annotated[list[Path], typer.Argument(help="Clouds or meshes (PLY, STL, OBJ), or results of scans.")],
    diameter: Annotated[float, typer.Option(min=1, max=1000, help="Calibrated diameter, mm.")] = 120.0,
    as_json: AsJson = False,
) -> None:
    """Fit spheres of one calibrated diameter at several places of the volume, as in ISO 20685-2."""
    from footscan.verify.shapes.sphere import find_spheres
    from pipelines.block import cloud_of, points_of

    found: list[tuple[Path, SphereFit]] = []
    for file in files:
        source = cloud_of(file)
        try:
            found += [(source, fit) for fit in find_spheres(points_of(source), diameter)]
        except Finding as error:
            raise Finding(f"{source}: {error}") from None
    if as_json:
        print_json([{"file": str(source)} | fit.model_dump(mode="json") for source, fit in found])
    else:
        _print_spheres(found, diameter)


def _dimensions(text: str) -> tuple[float, float, float]:
    try:
        a, b, c = (float(part) for part in text.lower().split("x"))
    except ValueError:
        raise RefusedInput("--nominal", f"{one_line(text)[:60]!r}, expected three numbers such as 150x100x50") from None
    if not all(1 <= value <= 1000 for value in (a, b, c)):
        raise RefusedInput("--nominal", f"{one_line(text)[:60]!r}, expected mm from 1 to 1000")
    return a, b, c


def _print_block(fit: "CuboidFit", compared: list[tuple[float, float | None, "CuboidDimension"]], source: Path) -> None:
    from pipelines.block import error_mm

    rows = []
    for nominal, thesis, found in compared:
        lower, upper = (BASES[end] for end in found.ends)
        rows.append(
            [
                f"{nominal:g}",
                figure(thesis, ".1f"),
                figure(found.value_mm),
                figure(found.uncertainty_mm),
                figure(error_mm(found, nominal), "+.3f"),
                figure(found.free_mm),
                lower if lower == upper else f"{lower}, {upper}",
            ]
        )
    columns = ["nominal", "thesis", "this scan", "uncertainty", "error", "without right angles", "ends"]
    print_table(f"Table 6-1: {one_line(str(source))}, mm", columns, rows)
    print_table(
        f"Faces, mm; {fit.edge_mm:g} mm along the edges left out",
        ["face", "points", "near edges", "outliers", "rms", "largest"],
        [
            [
                face.name,
                *map(str, (face.points, face.edge_points, face.outliers)),
                figure(face.rms_mm),
                figure(face.max_mm),
            ]
            for face in fit.faces
        ],
    )
    print_table("Angles", ["faces", "degrees"], [[" and ".join(a.faces), f"{a.degrees:.3f}"] for a in fit.angles])
    for found in fit.dimensions:
        if found.note:
            print_line(f"{figure(found.value_mm)}: {found.note}")
    bases = {end for found in fit.dimensions for end in found.ends}
    if "floor" in bases:
        print_line(f"Floor: nothing saw the bottom, so the height counts from Z = {fit.floor_mm:g} mm.")
    if "stripes" in bases:
        step = figure(fit.stripe_step_mm, "g")
        print_line(
            f"Stripes: no point lies on that end; it stands by the last stripe on the block, one every {step} mm."
        )
        print_line("Turned by 5 degrees, the block would show its ends.")


def _print_spheres(found: "list[tuple[Path, SphereFit]]", diameter: float) -> None:
    columns = ["file", "centre", "diameter", "error", "uncertainty", "sd", "95 %", "fixed: rms", "95 %", "points"]
    rows = [
        [
            one_line(str(source)),
            ", ".join(f"{value:.1f}" for value in fit.centre_mm),
            figure(fit.diameter_mm),
            figure(fit.diameter_error_mm, "+.3f"),
            figure(fit.diameter_uncertainty_mm),
            figure(fit.radial_sd_mm),
            figure(fit.radial_range95_mm),
            figure(fit.fixed_rms_mm),
            figure(fit.fixed_range95_mm),
            str(fit.points),
        ]
        for source, fit in found
    ]
    print_table(f"Spheres of {diameter:g} mm, mm", columns, rows)
    fits = [fit for _, fit in found]
    error = max((fit.diameter_error_mm for fit in fits), key=abs)
    deviation = max(fit.radial_sd_mm for fit in fits)
    shell = max(fit.radial_range95_mm for fit in fits)
    print_line(
        f"Worst of {len(fits)}: error of diameter {error:+.3f}, standard deviation {deviation:.3f}, 95 % {shell:.3f}"
    )

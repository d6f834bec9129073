"""`footscan compare`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.terminal.output import AsJson, figure, keep_inputs, message, print_json, print_line, print_table
from schemas.base.errors import Finding, RefusedInput, one_line

if TYPE_CHECKING:
    from footscan.mesh.formats.files import Shape
    from footscan.mesh.mesh import Mesh
    from footscan.verify.register import Registration
    from schemas.quality import Comparison

MOST_CLASSES = 10_000


def compare(
    result: Annotated[Path, typer.Argument(help="Mesh or cloud to examine: STL, PLY or OBJ in millimetres.")],
    reference: Annotated[Path, typer.Argument(help="Mesh or cloud to compare it with.")],
    register: Annotated[
        bool, typer.Option("--register", help="Register the first onto the reference before the comparison.")
    ] = False,
    both: Annotated[
        bool,
        typer.Option(
            "--both", help="Also compute the distances from the reference to the first, which show what is missing."
        ),
    ] = False,
    classes: Annotated[int, typer.Option(min=1, max=MOST_CLASSES, help="Number of classes of the histograms.")] = 70,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="CSV to write: figures, regions and classes, one per row.")
    ] = None,
    coloured: Annotated[
        Path | None, typer.Option("--mesh", help="Mesh to write: the first, coloured by its distance (PLY).")
    ] = None,
    pictures: Annotated[Path | None, typer.Option(help="Folder for four pictures (PNG).")] = None,
    report: Annotated[Path | None, typer.Option(help="Report to write (HTML).")] = None,
    as_json: AsJson = False,
) -> None:
    """Compute the distances in mm of one surface to another. Use --register if their frames differ."""
    from footscan.mesh.formats.files import read_file
    from footscan.report.comparison.table import comparison_csv
    from footscan.verify import compare as verify
    from pipelines.engine.files.atomic import write_atomically

    keep_inputs([csv_file, coloured, report], result, reference)
    if coloured is not None and coloured.suffix.lower() != ".ply":
        raise RefusedInput(coloured, f"expected a file that ends in .ply, found {coloured.suffix!r}", field="--mesh")
    if pictures is not None and pictures.exists() and not pictures.is_dir():
        raise RefusedInput(pictures, "is a file, expected a folder for pictures")
    a, b = read_file(result), read_file(reference)
    for mesh, file in ((a, result), (b, reference)):
        if mesh.normals is not None and not len(mesh.faces) and verify.cloud_normals(mesh) is None:
            message(f"{one_line(str(file))}: has normals that are no unit vectors, which are not used")
    registration = None
    if register:
        registration = _register(a, b, result, reference)
        a = verify.moved(a, registration.transform)
    try:
        comparison = verify.compare(
            _shape(a),
            _shape(b),
            normals_a=verify.cloud_normals(a),
            normals_b=verify.cloud_normals(b),
            classes=classes,
            both=both,
        )
        if registration is not None:
            comparison = comparison.model_copy(update={"transform": registration.transform})
        if coloured is not None or pictures is not None or report is not None:
            _show(a, b, comparison, registration, (result.name, reference.name), coloured, pictures, report)
    except RefusedInput as error:
        named = {"shape": result, "reference": reference}
        raise RefusedInput(named.get(error.source, error.source), error.problem) from None
    if registration is None and (gap := verify.apart_mm(_shape(a), _shape(b))):
        names = f"{one_line(result.name)} and {one_line(reference.name)}"
        message(f"{names} do not overlap, they are {gap:.4g} mm apart: --register moves the first onto the second")
    if csv_file is not None:
        write_atomically(csv_file, comparison_csv(comparison).encode())
    if as_json:
        registered = {} if registration is None else {"registration": registration.model_dump(mode="json")}
        print_json(comparison.model_dump(mode="json") | registered)
    else:
        _print(comparison, registration, result.name, reference.name)


def _register(a: "Mesh", b: "Mesh", result: Path, reference: Path) -> "Registration":
    from footscan.verify.register import register

    try:
        return register(_shape(a), _shape(b))
    except Finding as error:
        which, _, problem = str(error).partition(": ")
        file = {"moving": result, "fixed": reference}.get(which)
        raise RefusedInput(file or result, f"cannot be registered: {problem if file else error}") from None


def _shape(mesh: "Mesh") -> "Shape":
    return mesh.vertices, mesh.faces


def _show(
    a: "Mesh",
    b: "Mesh",
    comparison: "Comparison",
    registration: "Registration | None",
    names: tuple[str, str],
    coloured: Path | None,
    pictures: Path | None,
    report: Path | None,
) -> None:
    """Write the pictures and the report."""
    from footscan.report.comparison.page import comparison_page
    from footscan.report.deviation import deviation_of, deviation_pictures, deviation_ply
    from footscan.verify.compare import cloud_normals, vertex_distances
    from footscan.verify.regions import foot_regions
    from pipelines.engine.files.atomic import write_atomically

    first, second = _shape(a), _shape(b)
    distances = vertex_distances(first, second, normals_a=cloud_normals(a), normals_b=cloud_normals(b))
    deviation = deviation_of(first, distances, foot_regions(second) or foot_regions(first))
    if coloured is not None:
        write_atomically(coloured, deviation_ply(first, deviation.distance))
    if pictures is not None:
        for name, picture in deviation_pictures(deviation).items():
            write_atomically(pictures / name, picture)
    if report is not None:
        write_atomically(report, comparison_page(*names, comparison, deviation, registration).encode())


def _print(comparison: "Comparison", registration: "Registration | None", first: str, second: str) -> None:
    from schemas.quality import Figures

    if registration is not None:
        before, after = registration.before, registration.after
        print_line(f"Moved onto {one_line(second)} by")
        for line in registration.transform:
            print_line("  " + " ".join(f"{value:12.6f}" for value in line))
        print_line(f"Residuals, rms: {before.rms:.4f} mm before, {after.rms:.4f} mm after; {registration.verdict}")
    rows = [[name, figure(getattr(comparison, name), ".4f")] for name in Figures.model_fields if name != "points"]
    print_table(f"{first} to {second}, mm", ["figure", "mm"], rows)
    for title, regions in (
        ("Regions of the foot, mm", comparison.regions),
        ("Regions of the second, to the first, mm", comparison.completeness.regions if comparison.completeness else []),
    ):
        columns = ("mean", "std", "p50", "p95", "max", "signed_mean")
        if regions:
            of_regions = [[r.region, str(r.points), *(figure(getattr(r, name)) for name in columns)] for r in regions]
            print_table(title, ["region", "points", *columns], of_regions)
    if comparison.completeness is not None:
        found = comparison.completeness
        within = f"{100 * found.within_share:.2f} % of {one_line(second)} is within {found.within_mm:g} mm"
        print_line(f"{within} of {one_line(first)}; mean {found.mean:.4f} mm, largest {found.max:.4f} mm")

"""`footscan export`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.terminal.output import AsJson, figure, keep_inputs, message, print_json, print_table
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from footscan.mesh.mesh import Mesh
    from footscan.surface.fidelity import Fidelity
    from schemas.quality import MeshQuality

FLOOR_MM = 1.0
"""Largest distance in mm of the lowest vertex from Z = 0 for a mesh that stands there; chosen by hand."""
ANONYMOUS = {("side", "right"), ("side", "left"), ("side", "unknown"), ("frame", "scanner"), ("unit", "mm")}
"""The metadata that do not identify a patient; values are checked, too, because a file may contain anything."""
SIZE_MM = (20.0, 2000.0)
"""Range of the extent in mm of a foot, a block or a sphere; in metres or inches it is smaller."""


def export(
    file: Annotated[Path, typer.Argument(help="Mesh of a foot in millimetres: STL, PLY or OBJ.")],
    out: Annotated[Path, typer.Option(help="File to write: .stl, .ply, .obj, .wrl, .3mf or .glb.")],
    triangles: Annotated[
        int | None,
        typer.Option(min=4, help="Largest number of faces; 40000 or 20000 suit most programs. [default: all]"),
    ] = None,
    floor: Annotated[bool, typer.Option("--floor", help="Move the mesh so that its lowest point is at Z = 0.")] = False,
    side: Annotated[
        Literal["right", "left", "unknown"] | None, typer.Option(help="Side of the foot. [default: as FILE says]")
    ] = None,
    patient: Annotated[str | None, typer.Option(help="Pseudonym to write into the file.")] = None,
    scan: Annotated[str | None, typer.Option(help="Name of the scan to write into the file.")] = None,
    anonymous: Annotated[
        bool, typer.Option("--anonymous", help="Write nothing that identifies the patient: no names, no skin colours.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a foot's mesh for another program, with fewer triangles if needed."""
    from dataclasses import replace

    from footscan.mesh.formats.files import WRITERS, mesh_bytes, read_file
    from footscan.mesh.mesh import on_floor, outward, used, with_normals
    from footscan.surface.decimate import decimate
    from footscan.surface.fidelity import fidelity
    from footscan.surface.quality import mesh_quality
    from pipelines.engine.files.atomic import write_atomically
    from pipelines.version import SOFTWARE
    from schemas.base.model import pseudonym

    suffix = out.suffix.lower()
    if suffix not in WRITERS:
        raise RefusedInput(out, f"expected a name that ends in {', '.join(WRITERS)}, found {out.suffix!r}")
    if anonymous and (patient is not None or scan is not None):
        raise RefusedInput("--anonymous", "excludes --patient and --scan")
    keep_inputs([out], file)
    given = read_file(file)
    if anonymous:
        _check_name(out, file, given)
        kept = dict(sorted(given.metadata.items() & ANONYMOUS))
        given = replace(given, metadata=kept, colours=None)  # of a photograph: skin, scars, tattoos
    _check(given, file)
    names = {
        key: pseudonym(name, f"--{key}") for key, name in (("patient", patient), ("scan", scan)) if name is not None
    }
    metadata = {**given.metadata, **names, **({"side": side} if side else {}), "software": SOFTWARE}
    full = outward(used(replace(given, metadata=metadata)))
    full = on_floor(full) if floor else full
    mesh = full if triangles is None else decimate(full, triangles)
    changed = None if mesh is full else fidelity(full, mesh)
    if changed is not None and not changed.kept:
        problem = (
            f"would move ends by {changed.extremes:.2f} mm and change girths by {changed.girths:.2f} mm, "
            "expected more triangles"
        )
        raise RefusedInput(file, problem, field=f"--triangles {triangles}")
    data = mesh_bytes(with_normals(mesh), suffix)
    write_atomically(out, data)
    quality = mesh_quality(mesh.vertices, mesh.faces)
    _warn(mesh, quality, file, triangles)
    if as_json:
        print_json(
            {
                "file": str(out),
                "bytes": len(data),
                "metadata": dict(mesh.metadata),
                "mesh": quality.model_dump(mode="json"),
                "changed_mm": None if changed is None else changed._asdict(),
            }
        )
    else:
        _print(quality, changed, out)


def _check_name(out: Path, file: Path, mesh: "Mesh") -> None:
    """Refuse a file name that identifies the patient, as far as the mesh or the folders of its results do."""
    names = {mesh.metadata.get("patient", ""), mesh.metadata.get("scan", "")}
    folder = file.resolve().parent
    if (folder / "measures.json").exists():
        names |= {folder.name, folder.parent.name}
    for name in sorted(names):
        if len(name) > 2 and name.casefold() in out.name.casefold():
            raise RefusedInput(out, f"has {one_line(name)!r} in its name, expected another one for --anonymous")


def _check(mesh: "Mesh", file: Path) -> None:
    import numpy as np

    if not len(mesh.faces):
        raise RefusedInput(file, "holds no triangles, expected a mesh")
    across = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if not SIZE_MM[0] <= across <= SIZE_MM[1]:
        expected = f"expected {SIZE_MM[0]:g} to {SIZE_MM[1]:g} mm, in mm"
        raise RefusedInput(file, f"is {across:.3g} across, {expected}")


def _warn(mesh: "Mesh", quality: "MeshQuality", file: Path, triangles: int | None) -> None:
    """Warnings about properties that another program may expect of the file."""
    name = one_line(str(file))
    if quality.open_edges or quality.non_manifold_edges:
        message(
            f"{name}: is not closed: {quality.open_edges} open edges in {quality.holes} holes, and "
            f"{quality.non_manifold_edges} edges where more than two triangles meet; printers want none"
        )
    if quality.components > 1:
        message(f"{name}: {quality.components} parts, expected one foot")
    if triangles is not None and quality.triangles > triangles:
        message(f"{name}: its shape allows no fewer than {quality.triangles} triangles")
    if abs(lowest := float(mesh.vertices[:, 2].min())) > FLOOR_MM:
        message(f"{name}: its lowest point is at Z = {lowest:.1f} mm; --floor sets it to 0")


def _print(quality: "MeshQuality", changed: "Fidelity | None", out: Path) -> None:
    rows = [["vertices", str(quality.vertices)], ["triangles", str(quality.triangles)]]
    rows.append(["open edges", str(quality.open_edges)])
    if changed is not None:
        rows += [
            ["surface moved by at most, mm", figure(changed.surface_max)],
            ["surface moved on average, mm", figure(changed.surface_mean)],
            ["ends moved by at most, mm", figure(changed.extremes)],
            ["girths changed by at most, mm", figure(changed.girths)],
        ]
    print_table(one_line(out.name), ["figure", "value"], rows)

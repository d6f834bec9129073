"""The mesh in a further format."""

from collections.abc import Mapping
from pathlib import Path

from footscan.mesh.formats.files import mesh_bytes
from footscan.mesh.formats.ply import parse_ply
from footscan.mesh.mesh import with_normals
from schemas.parameters.delivery import ExportParameters


def run(inputs: Mapping[str, bytes], parameters: ExportParameters, places: Mapping[str, Path]) -> bytes:
    """Write the mesh in the format of the parameters.

    `inputs`: `foot.ply`.
    """
    del places
    return mesh_bytes(with_normals(parse_ply(inputs["foot.ply"])), f".{parameters.export_format}")

"""Surface to the standard deviations of its vertices, which the report shows."""

from collections.abc import Mapping
from pathlib import Path

from footscan.mesh.mesh import Mesh
from footscan.surface.errors.scan_errors import scan_errors
from pipelines.arrays import pack, unpack
from pipelines.scan_evidence import evidence_of


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Estimate the errors of the surface: packed `deviations`, (V,) along its normals, mm.

    `inputs`: `clean`, `fused` and `surface`.
    """
    del parameters, places
    surface = unpack(inputs["surface"])
    mesh = Mesh(surface["vertices"], surface["faces"], filled=surface.get("filled"))
    return pack(deviations=scan_errors(mesh, evidence_of(inputs)).deviations)

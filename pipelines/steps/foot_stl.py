"""The mesh as foot.stl."""

from collections.abc import Mapping
from pathlib import Path

from footscan.mesh.formats.stl import stl_bytes
from pipelines.arrays import unpack
from schemas.parameters.foot import FootParameters


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """Write the mesh as binary STL.

    `inputs`: `surface`.
    """
    del places
    surface = unpack(inputs["surface"])
    return stl_bytes(surface["vertices"], surface["faces"], f"footscan unit=mm side={parameters.side}")

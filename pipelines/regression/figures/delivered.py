"""Figures of the delivered files of a scan: each is read back and compared with its source."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.points import coordinates
from footscan.mesh.formats.files import Shape, read_points
from pipelines.arrays import unpack
from schemas.base.errors import RefusedInput

MADE_OF = {"foot.stl": "surface", "foot.ply": "surface", "cloud.ply": "orient"}
"""Delivered files, and the kind of step that each is made from."""


def shape_of(result: bytes) -> Shape:
    """The mesh in the result of a step, or its cloud, without faces."""
    arrays = unpack(result)
    if "faces" in arrays:
        return arrays["vertices"], arrays["faces"]
    points: NDArray[np.float64] = coordinates(arrays["cloud"])
    return points, np.empty((0, 3), np.int64)


def delivered_figures(folder: Path, results: Mapping[str, bytes]) -> dict[str, float | None]:
    """Compute `files.NAME_off_mm`: the largest distance between the points of a file and its source, in mm.

    It is the larger one of both directions, and None if the file cannot be read.

    Parameters
    ----------
    folder : folder of the delivered files
    results : results of the steps in `MADE_OF`, by kind
    """
    trees = {kind: KDTree(shape_of(result)[0]) for kind, result in results.items()}
    return {f"files.{name}_off_mm": _off(folder / name, trees[kind]) for name, kind in MADE_OF.items() if kind in trees}


def _off(file: Path, made_of: KDTree) -> float | None:
    try:
        points = KDTree(read_points(file))
    except RefusedInput:
        return None
    return max(float(np.max(a.query(b.data)[0])) for a, b in ((points, made_of), (made_of, points)))

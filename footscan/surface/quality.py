"""Quality of a mesh: open edges, holes, parts, filled area and the shape of its triangles."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.topology import edge_counts, face_components
from footscan.surface.ankle import faces_on_cut
from footscan.surface.holes import perimeter, rims
from schemas.quality import MeshQuality

WORST_QUANTILE = 0.01
"""Quantile of the triangles' shapes that stands for the worst ones."""

Floats = NDArray[np.float64]


def mesh_quality(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    filled: NDArray[np.bool_] | None = None,
    cut_mm: float | None = None,
) -> MeshQuality:
    """Compute the quality of a mesh; a closed mesh has no open and no non-manifold edges.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3)
    filled : (V,) true for vertices that were not measured; None where that is unknown. A triangle is filled if one of
        its corners is
    cut_mm : Z of the flat cut above the ankle; None without a cut

    Examples
    --------
    A square of two triangles has four open edges, which form one hole 4 mm long:

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> quality = mesh_quality(square, np.array([[0, 1, 2], [0, 2, 3]]))
    >>> quality.open_edges, quality.holes, quality.largest_hole_mm, quality.components
    (4, 1, 4.0, 1)
    """
    points = np.asarray(vertices, np.float64)
    _, counts = edge_counts(faces)
    holes = rims(faces)
    area, shape = _areas_and_shapes(points.take(faces, axis=0))
    total = float(area.sum()) or 1.0
    on_cut = faces_on_cut(points, faces, cut_mm)
    is_filled = None if filled is None else filled[faces].any(axis=1) & ~on_cut
    return MeshQuality(
        vertices=len(vertices),
        triangles=len(faces),
        open_edges=int(np.sum(counts == 1)),
        non_manifold_edges=int(np.sum(counts > 2)),
        components=int(face_components(faces).max(initial=-1)) + 1,
        holes=len(holes),
        largest_hole_mm=max((perimeter(points[hole]) for hole in holes), default=0.0),
        filled_share=None if is_filled is None else float(area[is_filled].sum()) / total,
        cut_share=None if filled is None else float(area[on_cut].sum()) / total,
        triangle_quality=float(shape.mean()) if len(faces) else None,
        worst_triangles=float(np.quantile(shape, WORST_QUANTILE)) if len(faces) else None,
    )


def _areas_and_shapes(corners: Floats) -> tuple[Floats, Floats]:
    """Returns (F,) areas in mm² and (F,) shapes, 1 for equilateral triangles and 0 for slivers.

    R. Bank and R. Smith, "Mesh smoothing using a posteriori error estimates", 1997, doi:10.1137/S0036142994265292.
    """
    sides = corners - np.roll(corners, 1, axis=1)
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 1], sides[:, 2]), axis=1)
    squared = np.einsum("nki,nki->n", sides, sides)
    return area, 4 * np.sqrt(3.0) * area / np.where(squared > 0, squared, 1.0)

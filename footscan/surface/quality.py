"""How whole a mesh is."""

import numpy as np
from numpy.typing import NDArray

from footscan.surface.holes import rims
from footscan.surface.topology import edge_counts, face_components
from schemas.quality import MeshQuality


def mesh_quality(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> MeshQuality:
    """Counts of what a mesh consists of; a closed one has no open and no non-manifold edges."""
    _, counts = edge_counts(faces)
    return MeshQuality(
        vertices=len(vertices),
        triangles=len(faces),
        open_edges=int(np.sum(counts == 1)),
        non_manifold_edges=int(np.sum(counts > 2)),
        components=int(face_components(faces).max(initial=-1)) + 1,
        holes=len(rims(faces)),
    )

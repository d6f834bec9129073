"""Decimation of a mesh that keeps its length, its breadths and its heights everywhere along the foot."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh
from footscan.surface.collapse import collapse_edges

SLAB_MM = 5.0
"""Length of the slabs of the foot whose outermost vertices stay in place: heel, toes, ball, instep and sole are among
them. Chosen by hand."""
END_SHARE = 0.2
"""Share of the vertices at either end whose heights are compared: the leg is at the higher end."""


def decimate(mesh: Mesh, triangles: int) -> Mesh:
    """Reduce a mesh to at most `triangles`; a mesh with no more than these is returned as it is.

    A closed manifold mesh stays one, in as many parts. These vertices stay in place to the last digit: the foremost and
    the hindmost one, and in every 5 mm along the foot the outermost ones on both sides, on top and below. Colours are
    interpolated; camera of origin and filled are those of a vertex nearby. Normals are None: they follow the new faces.

    A mesh whose shape does not allow so few triangles (each of its parts keeps some) keeps more.
    """
    if len(mesh.faces) <= triangles:
        return mesh
    fixed = np.zeros(len(mesh.vertices), np.bool_)
    fixed[outermost(mesh.vertices, np.unique(mesh.faces))] = True
    colours = np.zeros((len(mesh.vertices), 0)) if mesh.colours is None else mesh.colours.astype(np.float64)
    vertices, faces, values, source = collapse_edges(mesh.vertices, mesh.faces, colours, fixed, triangles)
    return replace(
        mesh,
        # The place of least error may lie outside the bounds of the mesh by some 0.01 mm.
        vertices=np.clip(vertices, mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)),
        faces=faces,
        normals=None,
        colours=None if mesh.colours is None else np.rint(values).astype(np.uint8),
        camera=None if mesh.camera is None else mesh.camera[source],
        filled=None if mesh.filled is None else mesh.filled[source],
    )


def outermost(vertices: NDArray[np.float64], among: NDArray[np.integer]) -> NDArray[np.int64]:
    """Returns the sorted numbers of the vertices that `decimate` keeps in place.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, Z up
    among : numbers of the vertices that are considered
    """
    along, across = footprint_axes(vertices[among])
    places = np.column_stack([vertices[among] @ along, vertices[among] @ across, vertices[among, 2]])
    slab = np.floor((places[:, 0] - places[:, 0].min()) / SLAB_MM).astype(np.int64)
    kept = [np.argmin(places[:, 0]), np.argmax(places[:, 0])]
    for outward in (places[:, 1], -places[:, 1], places[:, 2], -places[:, 2]):
        order = np.lexsort([outward, slab])
        kept += list(order[np.flatnonzero(np.diff(slab[order], append=-1))])  # the last of each slab
    return np.unique(among[kept]).astype(np.int64)


def footprint_axes(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns two horizontal (3,) unit vectors: along the foot, away from the leg, and across it.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, Z up
    """
    _, axes = np.linalg.eigh(np.cov(vertices[:, :2].T))
    along = np.array([axes[0, 1], axes[1, 1], 0.0])
    x = vertices @ along
    back, front = vertices[x < np.quantile(x, END_SHARE), 2], vertices[x > np.quantile(x, 1 - END_SHARE), 2]
    if back.max(initial=-np.inf) < front.max(initial=-np.inf):
        along = -along
    return along, np.array([-along[1], along[0], 0.0])

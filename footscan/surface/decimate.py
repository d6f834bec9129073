"""A mesh with fewer triangles that is as long, as broad and as high as before, and everywhere."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh
from footscan.surface.collapse import collapse_edges

SLAB_MM = 5.0
"""Of each such length of the foot the outermost vertices stay: heel, toes, ball, instep and sole are among them."""


def decimate(mesh: Mesh, triangles: int) -> Mesh:
    """The mesh with at most `triangles`; one that has no more stays as it is.

    A closed manifold mesh stays one, in as many parts. The outermost vertices ahead and behind, and of every 5 mm along
    the foot those on both sides, on top and below, stay in their places to the last digit. Colours are interpolated,
    camera of origin and filled are those of a vertex nearby; normals follow the new faces.

    A mesh whose shape allows no fewer triangles (each of its parts keeps some) is left with more than wanted.
    """
    if len(mesh.faces) <= triangles:
        return mesh
    fixed = np.zeros(len(mesh.vertices), np.bool_)
    fixed[outermost(mesh.vertices, np.unique(mesh.faces))] = True
    colours = np.zeros((len(mesh.vertices), 0)) if mesh.colours is None else mesh.colours.astype(np.float64)
    vertices, faces, values, source = collapse_edges(mesh.vertices, mesh.faces, colours, fixed, triangles)
    return replace(
        mesh,
        # A vertex where planes meet best may lie outside by some 0.01 mm.
        vertices=np.clip(vertices, mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)),
        faces=faces,
        normals=None,
        colours=None if mesh.colours is None else np.rint(values).astype(np.uint8),
        camera=None if mesh.camera is None else mesh.camera[source],
        filled=None if mesh.filled is None else mesh.filled[source],
    )


def outermost(vertices: NDArray[np.float64], among: NDArray[np.integer]) -> NDArray[np.int64]:
    """Which of the vertices, of those `among`, are outermost in the directions that `decimate` tells, each once."""
    along, across = footprint_axes(vertices[among])
    places = np.column_stack([vertices[among] @ along, vertices[among] @ across, vertices[among, 2]])
    slab = np.floor((places[:, 0] - places[:, 0].min()) / SLAB_MM).astype(np.int64)
    found = [np.argmin(places[:, 0]), np.argmax(places[:, 0])]
    for outward in (places[:, 1], -places[:, 1], places[:, 2], -places[:, 2]):
        order = np.lexsort([outward, slab])
        found += list(order[np.flatnonzero(np.diff(slab[order], append=-1))])  # the last of each slab
    return np.unique(among[found]).astype(np.int64)


def footprint_axes(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(3,) unit vectors along the foot, away from the leg, and across it; both level."""
    _, axes = np.linalg.eigh(np.cov(vertices[:, :2].T))
    along = np.array([axes[0, 1], axes[1, 1], 0.0])
    x = vertices @ along
    if vertices[x < np.quantile(x, 0.2), 2].max(initial=-np.inf) < vertices[x > np.quantile(x, 0.8), 2].max(
        initial=-np.inf
    ):
        along = -along
    return along, np.array([-along[1], along[0], 0.0])

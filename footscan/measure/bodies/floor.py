"""The floor or a plate in a mesh: flat surface that the foot stands on."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.topology import face_components

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

FLAT, FACING = 0.008, 0.9
"""Floor lies within this share of the extent about its plane, and faces along its normal by more than this cosine.
Chosen by hand."""
LEAST_SHARE, ON_ONE_SIDE = 0.1, 0.97
"""Floor has at least the first share of the area, and at least the second share of all vertices lies on it or above.
Chosen by hand."""
TRIALS = 12
"""Directions of faces that are tried, the most frequent first; a bound of time."""


def floor_faces(vertices: Floats, faces: Faces) -> tuple[NDArray[np.bool_], tuple[Floats, Floats]] | None:
    """Find a floor that the rest of the surface stands on; None without one. Faces of a part look to the same side.

    A floor looks at the body on it; a sole and a cut through the leg look away from it. A flat part of its own may look
    either way.

    Returns
    -------
    floor : (F,) true for faces of the floor
    plane : (3,) a point of it and its (3,) normal, towards the foot
    """
    corners = vertices[faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(crosses, axis=1) / 2
    normals = crosses / np.maximum(2 * areas, 1e-300)[:, None]
    middles = corners.mean(axis=1)
    component = face_components(faces)
    reach = FLAT * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    coarse = np.unique(np.rint(4 * normals), axis=0, return_inverse=True)[1].ravel()
    weights = np.bincount(coarse, areas)
    for cell in np.argsort(-weights)[:TRIALS]:
        here = coarse == cell
        normal = (normals[here] * areas[here, None]).sum(axis=0)
        normal /= max(float(np.linalg.norm(normal)), 1e-300)
        for _ in range(3):
            heights = middles @ normal
            order = np.argsort(heights[here])
            along = np.cumsum(areas[here][order])
            level = heights[here][order][int(np.searchsorted(along, along[-1] / 2))]
            near = (np.abs(heights - level) < reach) & (np.abs(normals @ normal) > FACING)
            if np.count_nonzero(near) < 3:
                break
            weight = areas[near] / areas[near].sum()
            middle = weight @ middles[near]
            spread = ((middles[near] - middle) * weight[:, None]).T @ (middles[near] - middle)
            fitted = np.linalg.eigh(spread)[1][:, 0]
            normal, here = (fitted if fitted @ normal > 0 else -fitted), near
        if np.count_nonzero(near) < 3 or areas[near].sum() < LEAST_SHARE * areas.sum():
            continue
        for up in (normal, -normal):
            height = (vertices - middle) @ up
            if np.mean(height > -reach) < ON_ONE_SIDE or height.max() < 4 * reach:
                continue
            # About a point of the floor, neither the floor nor an opening on it adds to the volume.
            from_floor = corners - middle
            volume = np.einsum("ni,ni->", from_floor[:, 0], np.cross(from_floor[:, 1], from_floor[:, 2]))
            outward = normals if volume > 0 else -normals
            own = np.isin(component, [part for part in np.unique(component[near]) if near[component == part].all()])
            floor = near & ((outward @ up > FACING) | own)
            if areas[floor].sum() > LEAST_SHARE * areas.sum():
                return floor, (middle, up)
    return None

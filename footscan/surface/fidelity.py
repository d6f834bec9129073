"""Differences between a decimated mesh and the mesh it was made of."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from footscan.mesh.mesh import Mesh
from footscan.mesh.sampling import sample_surface
from footscan.mesh.sections import cut, cuttable
from footscan.surface.decimate import footprint_axes

STATIONS = (0.25, 0.50, 0.62, 0.75)
"""Shares of the length, from the heel, where girths are compared: behind the ankle's front, instep, waist, ball."""
SAMPLES = 100_000
"""Bound of time: points of each surface whose distance to the other is computed."""
EXTREMES_MM, GIRTHS_MM = 0.05, 0.1
"""Largest changes that decimation may cause; chosen by hand."""


class Fidelity(NamedTuple):
    """Differences in mm, all of them at least 0."""

    surface_max: float
    """Largest distance between the surfaces, of either to the other."""
    surface_mean: float
    extremes: float
    """Largest change of an end of the mesh along its axes, or of a section at `STATIONS` aside, above or below."""
    girths: float
    """Largest change of a tape's length around the sections at `STATIONS`."""

    @property
    def kept(self) -> bool:
        """True if extremes and girths changed by no more than `EXTREMES_MM` and `GIRTHS_MM`."""
        return self.extremes <= EXTREMES_MM and self.girths <= GIRTHS_MM


def fidelity(full: Mesh, decimated: Mesh) -> Fidelity:
    """Compare a mesh with its decimated form; both are in mm, in the same frame."""
    to_full = _distances(_points(decimated), full)
    to_decimated = _distances(_points(full), decimated)
    along, across = footprint_axes(full.vertices[np.unique(full.faces)])
    extremes, girths = zip(*(_profile(mesh, full, along, across) for mesh in (full, decimated)), strict=True)
    return Fidelity(
        float(max(to_full.max(), to_decimated.max())),
        float(max(to_full.mean(), to_decimated.mean())),
        float(np.abs(extremes[0] - extremes[1]).max()),
        float(np.abs(girths[0] - girths[1]).max()),
    )


def _profile(
    mesh: Mesh, full: Mesh, along: NDArray[np.float64], across: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the ends of `mesh` and of its sections at the stations of `full`, and the girths there; mm."""
    frame = np.column_stack([along, across, [0.0, 0.0, 1.0]])
    places = mesh.vertices[np.unique(mesh.faces)] @ frame
    ends, girths = [places.min(axis=0), places.max(axis=0)], []
    x = full.vertices @ along
    ready = cuttable(mesh.vertices, mesh.faces)
    for share in STATIONS:
        loops = cut(ready, along * (x.min() + share * np.ptp(x)), along)
        level = np.concatenate([np.zeros((0, 3)), *(loop.points for loop in loops)]) @ frame[:, 1:]
        ends += [level.min(axis=0), level.max(axis=0)] if len(level) else [np.zeros(2), np.zeros(2)]
        girths.append(float(ConvexHull(level).area) if len(level) else 0.0)  # in a plane, qhull's area is the perimeter
    return np.concatenate(ends), np.array(girths)


def _points(mesh: Mesh) -> NDArray[np.float64]:
    """Returns (N, 3) points spread evenly over a surface, and its vertices; mm."""
    even = sample_surface(mesh.vertices, mesh.faces, SAMPLES)
    return np.concatenate([mesh.vertices[np.unique(mesh.faces)], even])


def _distances(points: NDArray[np.float64], mesh: Mesh) -> NDArray[np.float64]:
    """Returns (N,) distances in mm of (N, 3) points to the surface."""
    from footscan.open3d_without_plots import o3d

    middle = mesh.vertices.mean(axis=0)  # single precision errs by 0.00001 mm at such distances from the middle
    tensor = o3d.core.Tensor.from_numpy
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(tensor((mesh.vertices - middle).astype(np.float32)), tensor(mesh.faces.astype(np.uint32)))
    distances = scene.compute_distance(tensor((points - middle).astype(np.float32)), nthreads=1)
    return np.asarray(distances.numpy(), np.float64)

"""Statistics of the distances of one shape from another."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.files import Shape
from footscan.mesh.mesh import Mesh
from footscan.mesh.rigid_transform import apply
from footscan.mesh.sampling import sample_surface, surface_area
from footscan.verify.distances import Distances, SearchedMesh, check_places, distances_to_cloud, distances_to_mesh
from footscan.verify.histogram import histogram
from footscan.verify.regions import REGIONS, FootRegions, foot_regions
from schemas.base.errors import RefusedInput
from schemas.quality import Comparison, Completeness, Figures, RegionFigures

SAMPLES = 200_000
"""Points that represent a mesh; on a foot, one per 0.4 mm²."""
WITHIN_MM = 1.0
"""Largest distance of a reference point that counts as scanned: half a travel step of 2 mm."""
ROUNDED = 0.01
"""Largest error of the length of a unit vector in a file; chosen by hand."""
CHUNK = 2**20
"""Bound of memory: distances that are converted to double precision at once."""

Normals = NDArray[np.floating]


def compare(
    a: Shape,
    b: Shape,
    *,
    normals_a: Normals | None = None,
    normals_b: Normals | None = None,
    classes: int | None = None,
    both: bool = False,
    searched_b: SearchedMesh | None = None,
) -> Comparison:
    """Compute the distances of the surface of `a`, or of its points if it is a cloud, from `b`; mm, in the same frame.

    Memory: the two shapes, a search tree, and about 20 bytes per point for distances in single precision and their
    percentiles. Everything else runs in blocks.

    Parameters
    ----------
    a, b : a mesh or a cloud
    normals_a, normals_b : (V, 3) outward unit vectors of a cloud, if known
        They give distances between clouds a sign: those of `b`, or else those of `a`.
    classes : number of classes of the histograms, > 0; default: no histograms
    both : True also compares `b` with `a`, which shows how complete `a` is (Seitz et al., "A comparison and
        evaluation of multi-view stereo reconstruction algorithms", CVPR 2006, doi:10.1109/CVPR.2006.19)
    searched_b : made from `b`, so that several comparisons share it

    Raises
    ------
    RefusedInput
        A shape is empty, has only triangles without area, or coordinates that are not finite; or `b` is a single point.
    """
    check_places(a[0], "shape")
    check_places(b[0], "reference")
    regions = foot_regions(b) or foot_regions(a)
    points = _points(a, "shape")
    if searched_b is None:
        distances = _distances(points, b, normals_b, normals_a)
    else:
        distances = Distances.of_signed(searched_b.signed_distances(points))
    histograms = []
    if classes is not None:
        histograms.append(histogram(distances.unsigned, classes, signed=False))
        if distances.signed is not None:
            histograms.append(histogram(distances.signed, classes, signed=True))
    return Comparison(
        **_figures(distances).model_dump(),
        regions=_by_region(points, distances, regions),
        histograms=histograms,
        completeness=_completeness(b, a, normals_b, normals_a, regions) if both else None,
    )


def vertex_distances(
    a: Shape, b: Shape, *, normals_a: Normals | None = None, normals_b: Normals | None = None
) -> Distances:
    """Compute the distances of the vertices of `a` from `b`; parameters and errors are those of `compare`."""
    return _distances(a[0], b, normals_b, normals_a)


def apart_mm(a: Shape, b: Shape) -> float:
    """Distance of the bounding boxes of two shapes, mm; 0 if they overlap.

    Examples
    --------
    >>> no_faces = np.zeros((0, 3), np.int32)
    >>> apart_mm((np.array([[0.0, 0, 0]]), no_faces), (np.array([[3.0, 4, 0]]), no_faces))
    5.0
    """
    gap = np.maximum(a[0].min(axis=0) - b[0].max(axis=0), b[0].min(axis=0) - a[0].max(axis=0))
    return float(np.linalg.norm(np.maximum(gap, 0)))


def moved(mesh: Mesh, transform: Sequence[Sequence[float]]) -> Mesh:
    """Move a mesh and its normals by a 4 x 4 `transform` without scale, such as that of a registration."""
    matrix = np.array(transform, np.float64)
    normals = None if mesh.normals is None else mesh.normals @ matrix[:3, :3].T
    return replace(mesh, vertices=apply(matrix, mesh.vertices), normals=normals)


def cloud_normals(mesh: Mesh) -> Normals | None:
    """Normals that give distances from or to a cloud a sign; None for a mesh, or if one is not a unit vector."""
    if len(mesh.faces) or mesh.normals is None or not len(mesh.normals):
        return None
    lengths = np.linalg.norm(mesh.normals, axis=1)
    return mesh.normals if abs(lengths.min() - 1) < ROUNDED and abs(lengths.max() - 1) < ROUNDED else None


def _points(shape: Shape, name: str) -> NDArray[np.float64]:
    vertices, faces = shape
    if not len(faces):
        return vertices
    if not surface_area(vertices, faces) > 0:
        raise RefusedInput(name, "has no triangle with an area, expected a mesh or a cloud")
    return sample_surface(vertices, faces, SAMPLES)


def _distances(points: NDArray[np.float64], b: Shape, normals: Normals | None, own: Normals | None) -> Distances:
    vertices, faces = b
    return distances_to_mesh(points, b) if len(faces) else distances_to_cloud(points, vertices, normals, own)


def _figures(distances: Distances) -> Figures:
    unsigned, signed = distances
    mean, std = _mean_and_std(unsigned)
    p50, p90, p95, p99 = np.percentile(unsigned, [50, 90, 95, 99]).tolist()
    signed_mean, signed_std = (None, None) if signed is None else _mean_and_std(signed)
    return Figures(
        points=len(unsigned),
        mean=mean,
        std=std,
        min=float(unsigned.min()),
        max=float(unsigned.max()),
        p50=p50,
        p90=p90,
        p95=p95,
        p99=p99,
        rms=float(np.hypot(mean, std)),
        signed_mean=signed_mean,
        signed_std=signed_std,
        signed_min=None if signed is None else float(signed.min()),
        signed_max=None if signed is None else float(signed.max()),
    )


def _mean_and_std(values: NDArray[np.float32]) -> tuple[float, float]:
    mean = float(np.mean(values, dtype=np.float64))
    squares = sum(
        float(np.sum(np.square(values[start : start + CHUNK].astype(np.float64) - mean)))
        for start in range(0, len(values), CHUNK)
    )
    return mean, float(np.sqrt(squares / len(values)))


def _by_region(points: NDArray[np.float64], distances: Distances, regions: FootRegions | None) -> list[RegionFigures]:
    if regions is None:
        return []
    region = regions.of(points)
    chosen = ((name, region == row) for row, name in enumerate(REGIONS))
    return [
        RegionFigures(
            region=name,
            **_figures(
                Distances(distances.unsigned[here], None if distances.signed is None else distances.signed[here])
            ).model_dump(),
        )
        for name, here in chosen
        if here.any()
    ]


def _completeness(
    b: Shape, a: Shape, normals_b: Normals | None, normals_a: Normals | None, regions: FootRegions | None
) -> Completeness:
    points = _points(b, "reference")
    try:
        distances = _distances(points, a, normals_a, normals_b)
    except RefusedInput as error:
        raise RefusedInput("shape", error.problem) from None  # here the shape is the reference
    return Completeness(
        **_figures(distances).model_dump(),
        within_mm=WITHIN_MM,
        within_share=float(np.mean(distances.unsigned <= WITHIN_MM)),
        regions=_by_region(points, distances, regions),
    )

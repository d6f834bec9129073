"""The surface beside Poisson's and a ball-pivoted one of other libraries.

    .venv/bin/python -m benchmarks.surface [SCAN [CALIBRATION]]

SCAN is a virtual scan that knows its truth. Each library gets the same fused cloud, with footscan's oriented normals.
"""

import shutil
import sys
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.compare import interleave, print_ratios
from footscan.cloud.points import coordinates, stripe_step
from footscan.mesh.formats.files import Shape, read_mesh
from footscan.mesh.sampling import sample_surface
from footscan.recordings.scans import read_scan
from footscan.surface.ball_pivoting import mesh_cloud
from footscan.surface.closed_surface import close_surface
from footscan.surface.quality import mesh_quality
from footscan.verify.compare import SAMPLES
from footscan.verify.distances import distances_to_mesh
from pipelines.archive.job import job_of_scan
from pipelines.archive.planning import draw_steps, plan_job
from pipelines.arrays import unpack
from pipelines.engine.actions.step import Output, Step, Success
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import Store
from schemas.parameters.surface import SurfaceParameters

DEFAULT = Path("demo/archive/P0001/demo-R")
THREADS = 2
ROUNDS = 3
TRIMMED = 0.01
"""Share of the vertices, the least dense, that Open3D's manual takes away from Poisson's surface."""
Floats = NDArray[np.float64]


class Cloud(NamedTuple):
    """What a surface is made of."""

    points: Floats
    normals: Floats
    camera: NDArray[np.uint8]
    step_mm: float


def main() -> None:
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    calibration = Path(sys.argv[2]) if len(sys.argv) > 2 else given.parents[2] / "calibration.json"
    with tempfile.TemporaryDirectory() as place:
        scan = Path(place) / "archive" / given.parent.name / given.name
        shutil.copytree(given, scan, ignore=shutil.ignore_patterns("*.zarr"))
        cloud, cut_mm = _fused_cloud(scan, calibration, Path(place) / "first")
        _compare_surfaces(cloud, cut_mm, read_mesh(read_scan(scan).truth or scan / "truth.stl"))


def _fused_cloud(scan: Path, calibration: Path, results: Path) -> tuple[Cloud, float]:
    """The cloud of a scan, and the Z at which footscan cuts the leg; infinite where it is closed at its top."""
    steps, store = _steps_to("surface", scan, calibration, results)
    found = {name.rpartition("/")[2]: data for name, data in _run(steps, store).items()}
    oriented, surface = unpack(found["orient"]), unpack(found["surface"])
    points = oriented["cloud"]
    cloud = Cloud(coordinates(points), oriented["normals"], points["camera"], stripe_step(points))
    return cloud, float(surface.get("cut_mm", np.inf))


def _compare_surfaces(cloud: Cloud, cut_mm: float, truth: Shape) -> None:
    runs = {
        "Open3D, Poisson, depth 8": partial(_poisson, cloud, 8, 0.0),
        "Open3D, Poisson, depth 8, trimmed": partial(_poisson, cloud, 8, TRIMMED),
        "Open3D, Poisson, depth 9": partial(_poisson, cloud, 9, 0.0),
        "Open3D, Poisson, depth 9, trimmed": partial(_poisson, cloud, 9, TRIMMED),
        "pymeshlab, ball pivoting, its own radius": partial(_pymeshlab, cloud, None),
        "pymeshlab, ball pivoting, radius 2.5 mm": partial(_pymeshlab, cloud, 2.5),
        "footscan, closed": partial(_closed, cloud),
        "footscan, ball_pivoting": partial(_pivoted, cloud),
    }
    below_mm = cut_mm - cloud.step_mm
    print(f"A cloud of {len(cloud.points)} points; distances in mm, of what is below Z = {below_mm:.1f} mm")
    print(f"  {'':<42}{'to the truth':>18}{'of the truth':>18}{'open':>8}{'non-man.':>9}{'parts':>6}{'faces':>9}")
    print(f"  {'':<42}{'mean':>9}{'p99':>9}{'mean':>9}{'p99':>9}{'edges':>8}{'edges':>9}")
    for name, run in runs.items():
        shape = run()
        to_truth, of_truth = (_distances(*pair, below_mm) for pair in ((shape, truth), (truth, shape)))
        figures = "".join(f"{figure(d):9.3f}" for d in (to_truth, of_truth) for figure in (np.mean, _p99))
        mesh = mesh_quality(*shape)
        counts = f"{mesh.open_edges:8d}{mesh.non_manifold_edges:9d}{mesh.components:6d}{mesh.triangles:9d}"
        print(f"  {name:<42}{figures}{counts}", flush=True)
    print_ratios("The surface of that cloud", interleave(runs, ROUNDS), 1, "surface")


def _poisson(cloud: Cloud, depth: int, trimmed: float) -> Shape:
    """As Open3D's manual has it; on one thread, since with several every run gives another mesh."""
    import open3d as o3d

    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))
    legacy.normals = o3d.utility.Vector3dVector(cloud.normals)
    mesh, densities = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(legacy, depth=depth, n_threads=1)
    if trimmed:
        mesh.remove_vertices_by_mask(np.asarray(densities) < np.quantile(densities, trimmed))
    return np.array(mesh.vertices), np.array(mesh.triangles)


def _pymeshlab(cloud: Cloud, radius_mm: float | None) -> Shape:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(cloud.points, v_normals_matrix=cloud.normals))
    radius = {} if radius_mm is None else {"ballradius": pymeshlab.PureValue(radius_mm)}
    meshes.generate_surface_reconstruction_ball_pivoting(**radius)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def _closed(cloud: Cloud) -> Shape:
    mesh = close_surface(*cloud, SurfaceParameters())
    return mesh.vertices, mesh.faces


def _pivoted(cloud: Cloud) -> Shape:
    return mesh_cloud(cloud.points, cloud.normals, cloud.step_mm, SurfaceParameters(method="ball_pivoting"))


def _distances(a: Shape, b: Shape, below_mm: float) -> NDArray[np.floating]:
    """Of places spread evenly over `a` to `b`, below a height: above it some cut the leg, and others let it bulge."""
    points = sample_surface(*a, SAMPLES)
    return distances_to_mesh(points[points[:, 2] < below_mm], b).unsigned


def _p99(values: NDArray[np.floating]) -> float:
    return float(np.percentile(values, 99))


def _steps_to(kind: str, scan: Path, calibration: Path, results: Path) -> tuple[list[Step], Store]:
    """The steps of a scan up to the one of a kind, and the store that they work on."""
    planned = plan_job(job_of_scan(scan, calibration, results))
    steps = draw_steps(planned.scans[0].scan, planned)
    wanted = {step.name for step in steps if step.kind == kind}
    for step in reversed(steps):
        if step.name in wanted:
            wanted |= {source.step for source in step.inputs.values() if isinstance(source, Output)}
    return [step for step in steps if step.name in wanted], planned.workspace.store


def _run(steps: Iterable[Step], store: Store) -> dict[str, bytes]:
    """What the steps come to, by their names."""
    found: dict[str, bytes] = {}
    for name, outcome in run_plan(
        make_plan(list(steps), store), store, pool=Threads(THREADS), on_step_end=lambda _: None
    ).items():
        data = store.get(outcome.digest) if isinstance(outcome, Success) else None
        if data is None:
            raise RuntimeError(f"{name}: {outcome}")
        found[name] = data
    return found


if __name__ == "__main__":
    main()

"""A scan of a block: its cloud, its fit, and the dimensions beside the true ones."""

from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.pose import camera_centres
from footscan.cloud.points import coordinates
from footscan.mesh.formats.files import read_shape
from footscan.mesh.sampling import sample_surface
from footscan.thesis.printed import BLOCK_MM, SCANNED_BLOCK_MM
from footscan.verify.shapes.cuboid import fit_cuboid
from footscan.verify.shapes.stripe_ends import Sights
from pipelines.archive.job import CACHE
from pipelines.arrays import unpack
from pipelines.engine.explain import inputs_of
from pipelines.engine.files.digest import sha256
from pipelines.engine.store.store import open_store
from schemas.base.errors import Finding, RefusedInput
from schemas.calibration import Calibration
from schemas.fits import CuboidDimension, CuboidFit, CuboidParameters

SAMPLES = 100_000
"""Number of points sampled on a mesh."""


def cloud_of(scan: Path) -> Path:
    """The file to read. Of a folder of results this is the cloud, which was measured; the mesh is derived from it."""
    if not scan.is_dir():
        return scan
    for name in ("cloud.ply", "foot.stl"):
        if (scan / name).exists():
            return scan / name
    raise RefusedInput(scan, "holds neither cloud.ply nor foot.stl, expected the results of a scan")


def points_of(file: Path) -> NDArray[np.float64]:
    """The points of a cloud, or points sampled on a mesh."""
    vertices, faces = read_shape(file)
    return sample_surface(vertices, faces, SAMPLES) if len(faces) else vertices


def _sights_of(cloud: Path) -> Sights | None:
    """The points of each camera before fusion, from the store above a cloud; None if they are not there."""
    folder = cloud.resolve().parent
    place = next((above / CACHE for above in folder.parents if (above / CACHE / "actions").is_dir()), None)
    if place is None or not cloud.exists():
        return None
    store = open_store(place)
    steps = {step: store.latest(f"{folder.parent.name}/{folder.name}/{step}") for step in ("clean", "cloud.ply")}
    rows = {step: store.row(latest.key) for step, latest in steps.items() if latest}
    clean, made = rows.get("clean"), rows.get("cloud.ply")
    if not (clean and clean.digest and made and made.digest == sha256(cloud.read_bytes())):
        return None
    cleaned, calibration = store.get(clean.digest), store.get(inputs_of(clean.image)["calibration"][1])
    if cleaned is None or calibration is None:
        return None
    points = unpack(cleaned)["points"]
    centres = camera_centres(Calibration.model_validate_json(calibration).cameras)
    return Sights(coordinates(points), points["camera"], centres)


def beside_nominal(
    fit: CuboidFit, nominal: tuple[float, float, float]
) -> list[tuple[float, float | None, CuboidDimension]]:
    """Each nominal dimension with the thesis's and the fitted one; the block may lie on any face."""

    def misfit(dimensions: tuple[CuboidDimension, ...]) -> float:
        return sum(abs(error_mm(found, true) or 0.0) for found, true in zip(dimensions, nominal, strict=True))

    best = min(permutations(fit.dimensions), key=misfit)
    thesis = SCANNED_BLOCK_MM if nominal == BLOCK_MM else (None, None, None)
    return list(zip(nominal, thesis, best, strict=True))


def error_mm(found: CuboidDimension, nominal: float) -> float | None:
    """Value minus the nominal one; None without a value."""
    return None if found.value_mm is None else found.value_mm - nominal


def fit_block(source: Path, parameters: CuboidParameters) -> CuboidFit:
    """Fit a cuboid to a cloud or mesh in mm; where it is a scan's cloud, also to what each camera saw.

    Raises
    ------
    Finding
        No cuboid is there.
    RefusedInput
        The file cannot be read.
    """
    try:
        return fit_cuboid(points_of(source), parameters, _sights_of(source))
    except Finding as error:
        raise Finding(f"{source}: {error}") from None

"""Accuracy of the stripe's points in a scan, held against the exact stripe of the foot that was filmed.

    .venv/bin/python -m benchmarks.exact_stripe [SCAN]

SCAN is a folder that the virtual scanner filmed with its standard settings; its truth.stl gives the exact stripe.
"""

import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.extraction import DEFAULT, Packets, extract, extract_plainly, load
from footscan.mesh.formats.files import read_mesh
from footscan.recordings.scans import read_scan
from footscan.virtual.filming.renderers import Shot
from footscan.virtual.filming.stripe_truth import write_stripe_truth
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN, Mesh
from schemas.parameters.simulation import SimulationSettings
from schemas.scan import Travel

CAMERAS = range(1, 9)
TRUE_FRAMES = 4
"""The exact stripe is worked out for one frame in so many."""
NEAR_PX = 4.0
"""A point this close to the exact stripe is a point of it; a true point with a found one this close is found."""
LOCAL_POINTS = 8
"""So many true points around a found one tell where the exact stripe runs."""


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    _compare_accuracy(folder, {camera: load(folder / f"cam{camera}.avi") for camera in CAMERAS})


def _compare_accuracy(folder: Path, films: dict[int, Packets]) -> None:
    truth = _exact_stripe(folder, len(films[1].frames))
    print(f"Against the exact stripe in one frame of {TRUE_FRAMES}, eight cameras")
    print(f"  {'':<20}{'rms px':>8}{'median px':>11}{'true found':>12}{'mirrored':>10}{'false':>8}")
    methods: dict[str, Callable[[Packets], NDArray[np.float64]]] = {
        "footscan": extract,
        "the plain method": partial(extract_plainly, every=TRUE_FRAMES),
    }
    for name, method in methods.items():
        parts = [_hold_against(method(films[camera]), truth[camera], camera) for camera in CAMERAS]
        errors, mirrored, found = (np.concatenate(part) for part in zip(*parts, strict=True))
        near = errors[errors <= NEAR_PX]
        false = np.isinf(errors) & ~mirrored
        print(
            f"  {name:<20}{np.sqrt(np.mean(near**2)):8.3f}{np.median(near):11.3f}{found.mean():12.2%}"
            f"{mirrored.mean():10.2%}{false.mean():8.2%}"
        )


class Held(NamedTuple):
    """Found points beside the exact stripe."""

    errors: NDArray[np.float64]
    """(N,) px across the stripe; infinite for points that are not near it."""
    mirrored: NDArray[np.bool_]
    """(N,) not near it, and below the glass: red light all the same, the foot's mirror image. Its height drops it."""
    found: NDArray[np.bool_]
    """For each true point, whether a found one is near."""


def _exact_stripe(folder: Path, frames: int) -> dict[int, NDArray[np.float64]]:
    """For each camera (N, 3) frame, i, j of the exact stripe where it is lit and seen."""
    vertices, faces = read_mesh(folder / "truth.stl")
    travel = read_scan(folder).document.travel or Travel(start_mm=0, step_mm=2)
    shots = [Shot(frame, travel.start_mm + travel.step_mm * frame, 0) for frame in range(0, frames, TRUE_FRAMES)]
    mesh = Mesh(vertices, faces.astype(np.int64))
    with tempfile.TemporaryDirectory() as place:
        write_stripe_truth(mesh, SKIN, shots, Path(place), SimulationSettings())
        return {
            camera: np.loadtxt(Path(place) / f"cam{camera}.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2))
            for camera in CAMERAS
        }


def _hold_against(points: NDArray[np.float64], truth: NDArray[np.float64], camera: int) -> Held:
    points = points[points[:, 0] % TRUE_FRAMES == 0]
    errors, found = np.full(len(points), np.inf), np.zeros(len(truth), np.bool_)
    for frame in np.unique(points[:, 0]):
        here, true = points[:, 0] == frame, truth[:, 0] == frame
        if np.count_nonzero(true) < LOCAL_POINTS:
            continue
        exact, centres = truth[true, 1:], points[here, 1:]
        distance, nearest = map(np.asarray, cKDTree(exact).query(centres, LOCAL_POINTS))
        across = _distance_across(centres, exact[nearest])
        errors[here] = np.where(distance[:, 0] <= NEAR_PX, across, np.inf)
        found[true] = np.asarray(cKDTree(centres).query(exact)[0]) <= NEAR_PX
    return Held(errors, np.isinf(errors) & (_height(points[:, 1:], camera) < 0.0), found)


def _height(pixels: NDArray[np.float64], camera: int) -> NDArray[np.float64]:
    """(N,) Z in mm at which the rays of (N, 2) pixels meet the laser plane."""
    origins, directions = standard_scanner().camera(camera).rays(pixels)
    return origins[:, 2] - origins[:, 0] / directions[:, 0] * directions[:, 2]


def _distance_across(centres: NDArray[np.float64], around: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of (N, 2) points from the straight lines through (N, K, 2) true points around each."""
    middle = around.mean(axis=1)
    spread = np.einsum("nki,nkj->nij", around - middle[:, None], around - middle[:, None])
    normal = np.linalg.eigh(spread)[1][:, :, 0]
    return np.asarray(np.abs(np.einsum("ni,ni->n", centres - middle, normal)))


if __name__ == "__main__":
    main()

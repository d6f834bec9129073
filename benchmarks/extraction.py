"""Extraction of the stripe: its time beside that of decoding, and both beside a plain method of library calls.

    .venv/bin/python -m benchmarks.extraction [SCAN]

SCAN is a folder that the virtual scanner filmed with its standard settings; its truth.stl gives the exact stripe.
"""

import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skimage.measure import label

from benchmarks.compare import interleave, print_ratios
from footscan.frames.film import decode_or_none, encoded_frames, open_film
from footscan.frames.image import Rgb
from footscan.stripe.film import extract_film
from footscan.surface.export import read_mesh
from footscan.virtual.renderers import Shot
from footscan.virtual.scene import SKIN, Mesh
from footscan.virtual.stripe_truth import write_stripe_truth
from pipelines.recorded import read_scan
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.simulation import SimulationSettings
from schemas.scan import Travel

DEFAULT = Path("demo/archive/P0001/demo-R")
CAMERAS = range(1, 9)
TRUE_FRAMES = 4
"""The exact stripe is worked out for one frame in so many."""
NEAR_PX = 4.0
"""A point this close to the exact stripe is a point of it; a true point with a found one this close is found."""
LOCAL_POINTS = 8
"""So many true points around a found one tell where the exact stripe runs."""


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    films = {camera: _load(folder / f"cam{camera}.avi") for camera in CAMERAS}
    _compare_times(films[1], films[2])
    _compare_accuracy(folder, films)


@dataclass(frozen=True)
class Packets:
    """A film's JPEG frames in memory: no disk is timed."""

    frames: list[bytes | None]
    shape: tuple[int, int, int]

    def decoded(self) -> Iterator[Rgb | None]:
        buffer = np.empty(self.shape, np.uint8)
        return (decode_or_none(frame, buffer) for frame in self.frames)


def _load(film: Path) -> Packets:
    opened = open_film(film)
    return Packets(list(encoded_frames(opened)), (opened.height, opened.width, 3))


def _decode(film: Packets) -> None:
    for _ in film.decoded():
        pass


def _extract(film: Packets) -> NDArray[np.float64]:
    """(N, 3): frame, i, j."""
    points = extract_film(film.decoded(), ExtractionParameters())
    return np.column_stack([points["frame"], points["i"], points["j"]])


def _extract_plainly(film: Packets) -> NDArray[np.float64]:
    """(N, 3): frame, i, j, by `plain_stripe`."""
    parts = [np.empty((0, 3))]
    for number, frame in enumerate(film.decoded()):
        if frame is not None:
            points = plain_stripe(frame)
            parts.append(np.column_stack([np.full(len(points), number), points]))
    return np.concatenate(parts)


def plain_stripe(image: Rgb, threshold: int = 24, smallest_px: int = 60) -> NDArray[np.float64]:
    """(N, 2) i, j: threshold of the red excess, connected components, the median of each column.

    Components of a few pixels are dropped. A component that is higher than wide is crossed row by row instead.
    """
    red, green, blue = (image[..., channel].astype(np.int16) for channel in range(3))
    labels = label(red - np.maximum(green, blue) >= threshold, connectivity=2)
    rows, columns = np.nonzero(labels)
    component = labels[rows, columns]
    large = np.bincount(component)[component] >= smallest_px
    rows, columns, component = rows[large], columns[large], component[large]
    if not len(rows):
        return np.empty((0, 2))
    height, width = _extent(component, rows), _extent(component, columns)
    upright = (height > width)[component]
    down = _medians(component[upright], rows[upright], columns[upright])
    across = _medians(component[~upright], columns[~upright], rows[~upright])
    return np.concatenate([down[:, ::-1], across])


def _extent(component: NDArray[np.integer], position: NDArray[np.integer]) -> NDArray[np.integer]:
    low, high = np.full(component.max() + 1, position.max()), np.zeros(component.max() + 1, position.dtype)
    np.minimum.at(low, component, position)
    np.maximum.at(high, component, position)
    return high - low


def _medians(
    component: NDArray[np.integer], line: NDArray[np.integer], position: NDArray[np.integer]
) -> NDArray[np.float64]:
    """(N, 2): each line (column or row) of each component, and the median position in it."""
    order = np.lexsort((position, line, component))
    component, line, position = component[order], line[order], position[order]
    first = np.flatnonzero(np.r_[len(line) > 0, (np.diff(line) != 0) | (np.diff(component) != 0)])
    count = np.diff(np.r_[first, len(line)])
    middle = (position[first + (count - 1) // 2] + position[first + count // 2]) / 2
    return np.column_stack([line[first], middle])


def _compare_times(one: Packets, other: Packets) -> None:
    count = len(one.frames)
    seconds = interleave(
        {
            "decoding alone": lambda: _decode(one),
            "decoding, and footscan's extraction": lambda: _extract(one),
            "decoding, and the plain method": lambda: _extract_plainly(one),
        },
        rounds=5,
    )
    print_ratios(f"One film of {count} frames, one thread", seconds, count, "frame")
    with ThreadPoolExecutor(2) as pool:
        seconds = interleave(
            {
                "decoding alone, two threads": lambda: list(pool.map(_decode, (one, other))),
                "decoding and extraction, two threads": lambda: list(pool.map(_extract, (one, other))),
                "decoding and extraction, one thread": lambda: list(map(_extract, (one, other))),
            }
        )
    print_ratios("Two films, a film a thread", seconds, count + len(other.frames), "frame")


def _compare_accuracy(folder: Path, films: dict[int, Packets]) -> None:
    truth = _exact_stripe(folder, len(films[1].frames))
    print(f"\nAgainst the exact stripe in one frame of {TRUE_FRAMES}, eight cameras")
    print(f"  {'':<24}{'rms px':>9}{'median px':>11}{'true points found':>20}{'false points':>15}")
    for name, method in (("footscan", _extract), ("the plain method", _extract_plainly)):
        parts = [_hold_against(method(films[camera]), truth[camera]) for camera in CAMERAS]
        errors = np.concatenate([part.errors for part in parts])
        near, found = np.abs(errors) <= NEAR_PX, np.concatenate([part.found for part in parts])
        rms, median = np.sqrt(np.mean(errors[near] ** 2)), np.median(np.abs(errors[near]))
        print(f"  {name:<24}{rms:9.3f}{median:11.3f}{found.mean():20.2%}{1 - near.mean():15.2%}")


@dataclass(frozen=True)
class Held:
    """Found points beside the exact stripe."""

    errors: NDArray[np.float64]
    """(N,) px across the stripe; infinite for points that are not near it."""
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


def _hold_against(points: NDArray[np.float64], truth: NDArray[np.float64]) -> Held:
    points = points[points[:, 0] % TRUE_FRAMES == 0]
    errors, found = np.full(len(points), np.inf), np.zeros(len(truth), np.bool_)
    for frame in np.unique(points[:, 0]):
        here, true = points[:, 0] == frame, truth[:, 0] == frame
        if np.count_nonzero(true) < LOCAL_POINTS:
            continue
        exact, centres = truth[true, 1:], points[here, 1:]
        distance, nearest = cKDTree(exact).query(centres, LOCAL_POINTS)
        across = _distance_across(centres, exact[nearest])
        errors[here] = np.where(distance[:, 0] <= NEAR_PX, across, np.inf)
        found[true] = cKDTree(centres).query(exact)[0] <= NEAR_PX
    return Held(errors, found)


def _distance_across(centres: NDArray[np.float64], around: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of (N, 2) points from the straight lines through (N, K, 2) true points around each."""
    middle = around.mean(axis=1)
    spread = np.einsum("nki,nkj->nij", around - middle[:, None], around - middle[:, None])
    normal = np.linalg.eigh(spread)[1][:, :, 0]
    return np.abs(np.einsum("ni,ni->n", centres - middle, normal))


if __name__ == "__main__":
    main()

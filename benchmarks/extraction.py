"""Extraction of the stripe: its time beside that of decoding, and both beside a plain method of library calls.

    .venv/bin/python -m benchmarks.extraction [SCAN]

SCAN is a folder that the virtual scanner filmed with its standard settings; its truth.stl gives the exact stripe.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing
from scipy.spatial import cKDTree
from skimage.measure import label

from benchmarks.compare import interleave, print_ratios
from footscan.frames.film import decode_or_none, encoded_frames, open_film
from footscan.frames.image import Rgb
from footscan.stripe.film import extract_film
from footscan.surface.export import read_mesh
from footscan.virtual.renderers import Shot
from footscan.virtual.scanner import standard_scanner
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


def _extract_plainly(film: Packets, every: int = 1) -> NDArray[np.float64]:
    """(N, 3): frame, i, j, by `plain_stripe`, of one frame in so many."""
    parts = [np.empty((0, 3))]
    for number, frame in enumerate(film.decoded()):
        if frame is not None and number % every == 0:
            points = plain_stripe(frame)
            parts.append(np.column_stack([np.full(len(points), number), points]))
    return np.concatenate(parts)


def plain_stripe(image: Rgb, threshold: int = 72, closed_px: int = 9, smallest_px: int = 60) -> NDArray[np.float64]:
    """(N, 2) i, j: threshold of the red excess, connected components, the median of each column.

    Gaps are closed, for a saturated stripe has a white core; components of a few pixels are dropped; one that is higher
    than wide is crossed row by row instead. Threshold and closing are the best ones for the demo's films.
    """
    red, green, blue = (image[..., channel].astype(np.int16) for channel in range(3))
    mask = (red - np.maximum(green, blue) >= threshold).view(np.uint8)
    labels = label(grey_closing(mask, size=(closed_px, closed_px)), connectivity=2)
    rows, columns = np.nonzero(labels)
    component = labels[rows, columns]
    large = np.bincount(component)[component] >= smallest_px
    rows, columns, component = rows[large], columns[large], component[large]
    if not len(rows):
        return np.empty((0, 2))
    upright = (_extent(component, rows) > _extent(component, columns))[component]
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
        rounds=3,
    )
    print_ratios(f"One film of {count} frames, one thread", seconds, count, "frame")
    with ThreadPoolExecutor(2) as pool:
        seconds = interleave(
            {
                "decoding alone, two threads": lambda: list(pool.map(_decode, (one, other))),
                "decoding and extraction, two threads": lambda: list(pool.map(_extract, (one, other))),
                "decoding and extraction, one thread": lambda: list(map(_extract, (one, other))),
            },
            rounds=4,
        )
    print_ratios("Two films, a film a thread", seconds, count + len(other.frames), "frame")


def _compare_accuracy(folder: Path, films: dict[int, Packets]) -> None:
    truth = _exact_stripe(folder, len(films[1].frames))
    print(f"\nAgainst the exact stripe in one frame of {TRUE_FRAMES}, eight cameras")
    print(f"  {'':<20}{'rms px':>8}{'median px':>11}{'true found':>12}{'mirrored':>10}{'false':>8}")
    methods: dict[str, Callable[[Packets], NDArray[np.float64]]] = {
        "footscan": _extract,
        "the plain method": partial(_extract_plainly, every=TRUE_FRAMES),
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

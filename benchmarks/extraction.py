"""What extracting a whole scan costs beside decoding it: time, memory, and the first call of a process.

    .venv/bin/python -m benchmarks.extraction [SCAN]

Each camera is a task, on a pool of two threads. Beside footscan's methods stands a plain one of library calls.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing
from skimage.measure import label

from benchmarks.compare import interleave, print_ratios
from footscan.frames.array import StoredFrames
from footscan.frames.film import open_film
from footscan.frames.image import Rgb, decode_or_none, pixel_buffer
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from footscan.recordings.scans import RecordedScan, read_scan
from footscan.stripe.film import extract_film
from schemas.base.image_size import ImageSize
from schemas.parameters.extraction import ExtractionParameters

DEFAULT = Path("demo/archive/P0001/demo-R")
THREADS = 2
ROUNDS = 3
PROCESSES = 5

_Camera = TypeVar("_Camera")

# ru_maxrss would do elsewhere, but on Linux a process inherits that of the one that started it.
MEMORY = """
import re, sys
from pathlib import Path
from footscan.frames.array import StoredFrames
from footscan.frames.reader import pixel_frames
from footscan.stripe.film import extract_film
from schemas.frames import FrameManifest
from schemas.parameters.extraction import ExtractionParameters
what, array, manifest = sys.argv[1:]
frames = pixel_frames(StoredFrames(Path(array), FrameManifest.model_validate_json(Path(manifest).read_bytes())))
if what == "decode":
    for frame in frames:
        pass
if what == "extract":
    extract_film(frames, ExtractionParameters())
print(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
FIRST_CALL = """
import sys, time
from pathlib import Path
from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.stripe.film import extract_film
from schemas.parameters.extraction import ExtractionParameters
film = open_film(Path(sys.argv[1]))
frames = [frame.copy() for frame in pixel_frames(film, range(film.count // 2, film.count // 2 + 3))]
for _ in range(2):
    start = time.perf_counter()
    extract_film(frames, ExtractionParameters())
    print(time.perf_counter() - start)
"""


def main() -> None:
    scan = read_scan(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT)
    films = [scan.film(camera) for camera in scan.document.cameras]
    _compare_methods([load(film) for film in films])
    with tempfile.TemporaryDirectory() as place:
        stored = _ingest(scan, Path(place))
        _compare_from_store(stored)
        _print_memory(stored[0], Path(place) / "manifest.json")
    _print_first_call(films[0])


@dataclass(frozen=True)
class Packets:
    """A film's JPEG frames in memory: no disk is timed."""

    frames: list[bytes | None]
    size: ImageSize

    def decoded(self) -> Iterator[Rgb | None]:
        buffer = pixel_buffer(*self.size)
        return (decode_or_none(frame, buffer) for frame in self.frames)


def load(film: Path) -> Packets:
    """The packets of a film."""
    opened = open_film(film)
    return Packets(list(opened.stored()), opened.size)


def extract(film: Packets, parameters: ExtractionParameters | None = None) -> NDArray[np.float64]:
    """(N, 3): frame, i, j; with footscan's defaults where there are no parameters."""
    points = extract_film(film.decoded(), parameters or ExtractionParameters())
    return np.column_stack([points["frame"], points["i"], points["j"]])


def extract_plainly(film: Packets, every: int = 1) -> NDArray[np.float64]:
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


def _compare_methods(films: list[Packets]) -> None:
    default = ExtractionParameters()
    methods = get_args(ExtractionParameters.model_fields["centre_method"].annotation)
    others = [method for method in methods if method != default.centre_method]
    tasks: dict[str, Callable[[Packets], object]] = {
        "decoding alone": _decode,
        f"decoding and extraction, {default.centre_method}": extract,
    }
    for method in others:
        parameters = ExtractionParameters.model_validate({"centre_method": method})
        tasks[f"decoding and extraction, {method}"] = partial(extract, parameters=parameters)
    tasks["decoding and the plain method"] = extract_plainly
    frames = sum(len(film.frames) for film in films)
    with ThreadPoolExecutor(THREADS) as pool:
        runs = {name: partial(_each, pool, task, films) for name, task in tasks.items()}
        title = f"{len(films)} films, {frames} frames, packets in memory, {THREADS} threads"
        print_ratios(title, interleave(runs, ROUNDS), frames, "frame")


def _each(pool: ThreadPoolExecutor, task: Callable[[_Camera], object], cameras: list[_Camera]) -> None:
    list(pool.map(task, cameras))


def _decode(film: Packets) -> None:
    for _ in film.decoded():
        pass


def _ingest(scan: RecordedScan, place: Path) -> list[StoredFrames]:
    arrays = {scan.film(camera): place / "frames.zarr" / f"cam{camera.id}" for camera in scan.document.cameras}
    return [StoredFrames(array, ingest_film(film, array)) for film, array in arrays.items()]


def _compare_from_store(cameras: list[StoredFrames]) -> None:
    frames = sum(camera.count for camera in cameras)
    with ThreadPoolExecutor(THREADS) as pool:
        runs = {
            "reading, checking digests, decoding": partial(_each, pool, _read, cameras),
            "the same, and extraction": partial(_each, pool, _read_and_extract, cameras),
        }
        title = f"The same frames from the Zarr store, {THREADS} threads"
        print_ratios(title, interleave(runs), frames, "frame")


def _read(camera: StoredFrames) -> None:
    for _ in pixel_frames(camera):
        pass


def _read_and_extract(camera: StoredFrames) -> None:
    extract_film(pixel_frames(camera), ExtractionParameters())


def _print_memory(camera: StoredFrames, manifest: Path) -> None:
    manifest.write_text(camera.manifest.model_dump_json())
    print(f"\nPeak memory of a process, one camera of {len(camera.manifest.frames)} frames")
    names = {"import": "imports alone", "decode": "reading and decoding", "extract": "the same, and extraction"}
    for what, name in names.items():
        [kilobytes] = _process(MEMORY, what, str(camera.path), str(manifest))
        print(f"  {name:<44}{kilobytes * 1024 / 1e6:9.1f} MB")


def _print_first_call(film: Path) -> None:
    """With a cache of compiled loops of its own, first empty, then filled."""
    print("\nExtraction of three frames in a new process")
    with tempfile.TemporaryDirectory() as cache:
        compiling = _process(FIRST_CALL, str(film), cache=cache)[0]
        times = np.array([_process(FIRST_CALL, str(film), cache=cache) for _ in range(PROCESSES)])
    print(f"  {'first, nothing compiled yet':<44}{1e3 * compiling:9.1f} ms")
    print(f"  {'first, compiled by another process':<44}{1e3 * np.median(times[:, 0]):9.1f} ms")
    print(f"  {'second':<44}{1e3 * np.median(times[:, 1]):9.1f} ms")


def _process(script: str, *arguments: str, cache: str | None = None) -> list[float]:
    """The numbers that a script prints in a process of its own."""
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": cache})
    command = [sys.executable, "-c", script, *arguments]
    ended = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return [float(line) for line in ended.stdout.split()]


if __name__ == "__main__":
    main()

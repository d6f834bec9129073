"""The frames' store beside the films that it was made from: bytes, and the time of reading.

.venv/bin/python -m benchmarks.storage [SCAN]
"""

import sys
import tempfile
import time
from math import prod
from pathlib import Path

import numpy as np
import zarr

from benchmarks.compare import interleave, print_ratios
from footscan.frames.array import StoredFrames
from footscan.frames.film import open_film
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import pixel_frames
from footscan.recordings.scans import read_scan
from schemas.frames import FrameManifest

DEFAULT = Path("demo/archive/P0001/demo-R")


def main() -> None:
    scan = read_scan(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT)
    films = {camera.id: scan.film(camera) for camera in scan.document.cameras}
    with tempfile.TemporaryDirectory() as place:
        arrays = {camera: Path(place) / "frames.zarr" / f"cam{camera}" for camera in films}
        start = time.perf_counter()
        manifests = {camera: ingest_film(film, arrays[camera]) for camera, film in films.items()}
        seconds = time.perf_counter() - start
        _print_sizes(films, Path(place), manifests, seconds)
        first = min(films)
        _compare_reading(films[first], arrays[first], manifests[first])


def _print_sizes(films: dict[int, Path], place: Path, manifests: dict[int, FrameManifest], seconds: float) -> None:
    film_bytes = sum(film.stat().st_size for film in films.values())
    store_bytes = sum(file.stat().st_size for file in place.rglob("*") if file.is_file())
    decoded_bytes = sum(len(m.frames) * prod(m.size) * 3 for m in manifests.values())
    frames = sum(len(m.frames) for m in manifests.values())
    print(f"{len(films)} films, {frames} frames, ingested in {seconds:.2f} s")
    for name, size in (("films", film_bytes), ("Zarr store", store_bytes), ("decoded frames", decoded_bytes)):
        print(f"  {name:<44}{size / 1e6:9.2f} MB   {size / film_bytes:7.4f} times the films")


def _compare_reading(film: Path, array: Path, manifest: FrameManifest) -> None:
    opened, frames = open_film(film), len(manifest.frames)

    def demultiplex() -> None:
        for _ in pixel_frames(opened):
            pass

    def read() -> None:
        for _ in pixel_frames(StoredFrames(array, manifest)):
            pass

    def read_by_zarr() -> None:
        pixels = zarr.open_array(str(array), mode="r")
        for number in range(frames):
            np.asarray(pixels[number])

    runs = {
        "film: demultiplexing and decoding": demultiplex,
        "store: checking digests and decoding": read,
        "store, by zarr.open: decoding": read_by_zarr,
    }
    print_ratios(f"All {frames} frames of a camera in order, files in memory", interleave(runs), frames, "frame")
    numbers = np.random.default_rng(1).permutation(frames)[:20]

    def pick_from_film() -> None:
        wanted = set(numbers.tolist())
        for number, _ in enumerate(pixel_frames(opened)):
            wanted.discard(number)
            if not wanted:
                break

    def pick_from_store() -> None:
        pixels = zarr.open_array(str(array), mode="r")
        for number in numbers:
            np.asarray(pixels[number])

    runs = {"film, read until the last of them": pick_from_film, "store, by zarr.open": pick_from_store}
    print_ratios(f"{len(numbers)} frames of {frames}, at random", interleave(runs), len(numbers), "frame")


if __name__ == "__main__":
    main()

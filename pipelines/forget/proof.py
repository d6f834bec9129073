"""The search for remains after an erasure, by name and digest."""

import os
from collections.abc import Collection, Iterator
from pathlib import Path

from footscan.frames.array import is_chunk_name
from footscan.recordings.scans import SCAN_FILE
from pipelines.engine.store.store import Store
from pipelines.forget.subject import Subject, digest_of, files_below

OF_A_SCAN = (SCAN_FILE, "measures.json")
"""A folder with one of these files is that of a scan or of its results."""
LARGE_BYTES = 32_000_000
"""Largest file that is searched for a name: a bound of time, chosen by hand. Copies of larger ones show by digest."""


def find_remains(
    subject: Subject,
    digests: Collection[str],
    folders: Collection[Path],
    store: Store,
    sizes: Collection[int],
    erased: Collection[str],
) -> list[str]:
    """Find files in folders and store with the subject's name in name or content, and copies of erased files.

    Parameters
    ----------
    digests : collection of str
        Digests of the files erased in archives and results.
    sizes : collection of int
        Sizes of these files, bytes: a file of another size cannot be a copy.
    erased : collection of str
        Digests and keys erased in the store.
    """
    remains = [str(file) for folder in folders for file in _remains(subject, digests, folder, sizes)]
    for name, _ in store.files.sizes(""):
        if name.startswith("runs/"):
            continue
        data = name.encode() + b"\0" + store.files.read(name)
        if subject.pattern.search(data) or name.rpartition("/")[2].removesuffix(".json") in erased:
            remains.append(store.files.path(name))
    return sorted(set(remains))


def _remains(subject: Subject, digests: Collection[str], folder: Path, sizes: Collection[int]) -> Iterator[Path]:
    for here, below, names in os.walk(folder):
        places = [Path(here, name) for name in (*below, *names)]
        yield from (place for place in places if subject.pattern.search(str(place.relative_to(folder)).encode()))
    for file in files_below(folder):
        if file.is_symlink() or not file.is_file() or is_chunk_name(file.name):
            continue
        size = file.stat().st_size
        # A blob in one of the folders is judged as a file of the store.
        is_shared = file.name in digests or _belongs_to_a_scan(file, folder)
        is_copy = size in sizes and not is_shared and digest_of(file) in digests
        if is_copy or (size <= LARGE_BYTES and subject.pattern.search(file.read_bytes())):
            yield file


def _belongs_to_a_scan(file: Path, root: Path) -> bool:
    """Return True if a file belongs to another scan or its results: two scans may have equal films and results."""
    folders = [folder for folder in file.parents if folder.is_relative_to(root)]
    return any((folder / name).is_file() for folder in folders for name in OF_A_SCAN)

"""Whether anything is left: a search for the name and the digests."""

import os
from collections.abc import Collection, Iterator
from pathlib import Path

from footscan.recordings.scans import SCAN_FILE
from pipelines.engine.store.store import Store
from pipelines.forget.subject import CHUNK, Subject, digest_of, files_below

OF_A_SCAN = (SCAN_FILE, "measures.json")
"""A folder that holds one of these is a scan's, or that of its results."""
LARGE_BYTES = 32_000_000
"""A film or a mesh of more is not searched for a name; that it is a copy is seen by its digest."""


def find_remains(
    subject: Subject,
    digests: Collection[str],
    folders: Collection[Path],
    store: Store,
    sizes: Collection[int],
    erased: Collection[str],
) -> list[str]:
    """Places in folders and store whose name or content bears the subject's name, or that are copies of theirs.

    Parameters
    ----------
    digests : of what was erased in archives and results.
    sizes : of the files that were erased: others cannot be copies of them.
    erased : digests and keys of what was erased in the store.
    """
    found = [str(file) for folder in folders for file in _remains(subject, digests, folder, sizes)]
    for name, _ in store.files.sizes(""):
        if name.startswith("runs/"):
            continue
        data = name.encode() + b"\0" + store.files.read(name)
        if subject.pattern.search(data) or name.rpartition("/")[2].removesuffix(".json") in erased:
            found.append(store.files.path(name))
    return sorted(set(found))


def _remains(subject: Subject, digests: Collection[str], folder: Path, sizes: Collection[int]) -> Iterator[Path]:
    for here, below, names in os.walk(folder):
        places = [Path(here, name) for name in (*below, *names)]
        yield from (place for place in places if subject.pattern.search(str(place.relative_to(folder)).encode()))
    for file in files_below(folder):
        if file.is_symlink() or not file.is_file() or CHUNK(file.name):
            continue
        size = file.stat().st_size
        is_shared = file.name in digests or _is_anothers(file, folder)  # a blob is judged in the store, as one of it
        is_copy = size in sizes and not is_shared and digest_of(file) in digests
        if is_copy or (size <= LARGE_BYTES and subject.pattern.search(file.read_bytes())):
            yield file


def _is_anothers(file: Path, root: Path) -> bool:
    """Whether a file is another scan's own, or of its results: equal films and results belong to both."""
    folders = [folder for folder in file.parents if folder.is_relative_to(root)]
    return any((folder / name).is_file() for folder in folders for name in OF_A_SCAN)

"""Results out of the content store into the folder where a person looks for them."""

from collections.abc import Mapping
from pathlib import Path

from pipelines.engine.atomic import write_atomically
from pipelines.engine.digest import FileDigests
from pipelines.engine.store import Store
from schemas.errors import DamagedError


def deliver(blobs: Mapping[str, str], store: Store, digests: FileDigests, folder: Path) -> None:
    """Write each blob under its file name into `folder`, where another file or none is there.

    Raises
    ------
    DamagedError
        Blobs are damaged, and have been set aside; all others were written.
    Fault
        A file cannot be written.
    """
    damaged: list[str] = []
    for name, digest in blobs.items():
        target = folder / name
        if target.is_file() and digests.of(target)[0] == digest:
            continue
        data = store.get(digest)
        if data is None:
            damaged.append(name)
        else:
            write_atomically(target, data)
    if damaged:
        raise DamagedError(f"{folder}: the content of {', '.join(damaged)} is damaged, expected what was stored")

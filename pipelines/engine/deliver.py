"""Results out of the content store into the folder where a person looks for them."""

from collections.abc import Mapping
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.store.store import Store
from schemas.base.errors import Fault


def deliver(blobs: Mapping[str, str], store: Store, digests: FileDigests, folder: Path) -> str | None:
    """Write each blob under its file name into `folder`, where another file or none is there.

    Returns
    -------
    problem : str or None
        Why it could not be done for one of them, in one line.
    """
    problem = None
    for name, digest in blobs.items():
        target = folder / name
        if target.is_file() and digests.of(target)[0] == digest:
            continue
        data = store.get(digest)
        if data is None:
            problem = f"{target}: its content is damaged in the store; run again to make it anew"
            continue  # so that all that is damaged is noticed at once
        try:
            write_atomically(target, data)
        except Fault as error:
            return str(error)
    return problem

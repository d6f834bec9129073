"""Check of who can write to a store: its results are trusted, so no other user should."""

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from pipelines.engine.store.store import Store

log = logging.getLogger("footscan.store")

FOLDERS = ("blobs", "actions", "latest", "packs", "pins", "runs")
"""Folders of a store."""


def warn_if_others_can_write(store: Store, group: int | None = None) -> None:
    """Log a warning, once for each store, if other users can replace its files.

    Digests show damage, but not a deliberate exchange. The rights of a store at a URL are unknown. Members of the
    workflow's `group` may write.
    """
    if store.folder is not None and hasattr(os, "geteuid"):
        _warn(store.folder, group)


@cache
def _warn(store: Path, group: int | None) -> None:
    for path in _folders(store):
        try:
            status = path.stat()
        except OSError:
            continue
        is_shared = status.st_gid == group
        if status.st_uid != os.geteuid() and not is_shared:
            log.warning("%s: belongs to another user, who can exchange results, expected your own store", path)
            return
        if status.st_mode & stat.S_IWOTH or (status.st_mode & stat.S_IWGRP and not is_shared):
            log.warning("%s: other users can write to it and so exchange results, expected 'chmod -R go-w'", path)
            return


def _folders(store: Path) -> Iterator[Path]:
    """The folder of a store, those in it, and their sub-folders, which hold only files."""
    yield store
    for folder in FOLDERS:
        yield store / folder
        with suppress(OSError), os.scandir(store / folder) as entries:
            yield from sorted(Path(entry.path) for entry in entries if entry.is_dir())

"""Who can write to a store: its results are taken for true, so nobody else should."""

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from functools import cache

from pipelines.engine.files.places import LocalFiles
from pipelines.engine.store.store import Store

log = logging.getLogger("footscan.store")

FOLDERS = ("", "blobs", "actions", "latest", "pins", "runs")


def warn_if_others_can_write(store: Store, group: int | None = None) -> None:
    """Say, once for a store, that users other than this one can exchange what is in it.

    A seal and a digest tell what was damaged, not what was made to match. Of a store behind a URL nothing is known.
    Members of a `group` that the workflow names are no others.
    """
    if isinstance(store.files, LocalFiles) and hasattr(os, "geteuid"):
        _warn(store.files, group)


@cache
def _warn(files: LocalFiles, group: int | None) -> None:
    for path in _folders(files):
        try:
            status = os.stat(path)  # noqa: PTH116 (as the store itself does: each of its files is reached so)
        except OSError:
            continue
        is_shared = status.st_gid == group
        if status.st_uid != os.geteuid() and not is_shared:
            log.warning("%s: belongs to another user, who can exchange results; expected a store of your own", path)
            return
        if status.st_mode & stat.S_IWOTH or (status.st_mode & stat.S_IWGRP and not is_shared):
            log.warning("%s: other users can write to it, and so exchange results; expected 'chmod -R go-w'", path)
            return


def _folders(files: LocalFiles) -> Iterator[str]:
    """The folders of a store, and those in them, which hold files alone."""
    for folder in FOLDERS:
        path = files.path(folder).rstrip("/")
        yield path
        if not folder:
            continue
        with suppress(OSError), os.scandir(path) as entries:
            yield from sorted(entry.path for entry in entries if entry.is_dir())

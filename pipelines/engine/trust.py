"""Who can write to a store: its results are taken for true, so nobody else should."""

import logging
import os
import stat
from functools import cache

from pipelines.engine.files import LocalFiles
from pipelines.engine.store import Store

log = logging.getLogger("footscan.store")

FOLDERS = ("", "blobs", "actions", "latest", "pins", "runs")
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def warn_if_others_can_write(store: Store) -> None:
    """Say, once for a store, that users other than this one can exchange what is in it.

    A seal and a digest tell what was damaged, not what was made to match. Of a store behind a URL nothing is known.
    """
    if isinstance(store.files, LocalFiles) and hasattr(os, "geteuid"):
        _warn(store.files)


@cache
def _warn(files: LocalFiles) -> None:
    for folder in FOLDERS:
        path = files.path(folder).rstrip("/")
        try:
            status = os.stat(path)  # noqa: PTH116 (as the store itself does: each of its files is reached so)
        except OSError:
            continue
        if status.st_uid != os.geteuid():
            log.warning("%s: belongs to another user, who can exchange results; expected a store of your own", path)
            return
        if status.st_mode & OTHERS_WRITE:
            log.warning("%s: other users can write to it, and so exchange results; expected 'chmod -R go-w'", path)
            return

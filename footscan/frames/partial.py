"""Folders under way: a hidden part with its maker's process in its name, renamed when it is whole, else swept up."""

import contextlib
import errno
import os
import shutil
import socket
import stat
import threading
from pathlib import Path


def partial_folder(folder: Path, name: str) -> Path:
    """Where what shall be called `name` is made, hidden in `folder`; one for each thread."""
    return folder / f".{name}.partial-{socket.gethostname()}-{threading.get_ident()}-{os.getpid()}"


def make_partial(partial: Path, place: Path) -> None:
    """Make a folder for what shall lie in the folder `place`: if that is shared with a group, so is what is made."""
    partial.mkdir()
    status = place.stat()
    if status.st_mode & stat.S_ISGID:
        os.chown(partial, -1, status.st_gid)
        partial.chmod(stat.S_IMODE(status.st_mode))


def move_into_place(partial: Path, place: Path) -> None:
    """Give `partial` the name `place`. A folder cannot be renamed onto another: the old one steps aside first.

    Others may make the same folder meanwhile; whoever comes last stays.
    """
    aside = partial.with_name(partial.name + ".old")
    while True:
        try:
            partial.rename(place)
            return
        except OSError as error:
            if error.errno not in {errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR}:
                raise
        with contextlib.suppress(FileNotFoundError):  # another was faster
            place.rename(aside)
            _remove(aside)


def sweep(folder: Path) -> None:
    """Remove the parts in `folder` that interrupted processes of this machine have left."""
    for part in folder.glob(f".*.partial-{socket.gethostname()}-*"):
        pid = part.name.removesuffix(".old").rpartition("-")[2]
        if pid.isdigit() and not Path(f"/proc/{pid}").exists() and Path("/proc/self").exists():
            shutil.rmtree(part, ignore_errors=True)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)

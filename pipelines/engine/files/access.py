"""Who can read what is written: its owner alone, or also the group that a workflow names.

The rights stand in the process's umask, which files and folders have from the moment they are made, those of libraries
and of child processes too. A group is passed on by the folders: what is made in one with the setgid bit gets its group.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from schemas.base.errors import Fault, RefusedInput

PRIVATE, SHARED = 0o077, 0o007
"""Umasks."""
FOLDER_MODE, FILE_MODE = 0o2770, 0o660
"""Of what a group shares."""


def keep_private() -> None:
    """From now on, what this process makes is its user's alone: folders 0700, files 0600."""
    os.umask(PRIVATE)


def group_number(name: str, workflow: Path) -> int:
    """The number of the group that a workflow names.

    Raises
    ------
    RefusedInput
        This machine has no such group, or this user is not in it.
    """
    try:
        import grp

        number = grp.getgrnam(name).gr_gid
    except (ImportError, KeyError, ValueError):
        raise RefusedInput(workflow, f"expected a group of this machine, found {name[:80]!r}", field="group") from None
    if os.geteuid() != 0 and number not in (os.getegid(), *os.getgroups()):
        raise RefusedInput(workflow, f"expected a group that you are in, found {name!r}", field="group")
    return number


def share(folders: Iterable[Path], group: int | None) -> None:
    """From now on, what is made in `folders`, which are made if missing, is the group's as well.

    Where one of them was not shared before, what is in it already is handed over, too.

    Raises
    ------
    Fault
        A folder cannot be made, or is another user's and not the group's.
    """
    if group is None:
        return
    for folder in folders:
        try:
            if not folder.exists():
                os.umask(PRIVATE)
                folder.mkdir(parents=True)
            if not _is_shared(folder, group):
                for path in _below(folder):
                    _hand_over(path, group)
                _hand_over(folder, group)  # last: an interrupted hand-over is done again
        except OSError as error:
            raise Fault(f"{folder}: cannot be shared with its group ({error.strerror or error})") from None
    os.umask(SHARED)


def _is_shared(folder: Path, group: int) -> bool:
    status = folder.stat()
    return status.st_gid == group and stat.S_IMODE(status.st_mode) == FOLDER_MODE


def _below(folder: Path) -> Iterator[Path]:
    for here, folders, files in os.walk(folder):
        yield from (Path(here, name) for name in (*folders, *files))


def _hand_over(path: Path, group: int) -> None:
    if path.is_symlink():
        return
    os.chown(path, -1, group)
    path.chmod(FOLDER_MODE if path.is_dir() else FILE_MODE)

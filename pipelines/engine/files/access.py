"""Access rights of written files: for the owner only, or also for the group that a workflow names.

The umask of the process sets the rights of files and folders from the moment they are made, also in libraries and
child processes. Folders pass on their group: a file made in a folder with the setgid bit gets the group of the folder.
"""

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from schemas.base.errors import Fault, RefusedInput

PRIVATE, SHARED = 0o077, 0o007
"""Umasks: access for the owner, or for owner and group (POSIX)."""
FOLDER_MODE, FILE_MODE = 0o2770, 0o660
"""Modes of folders and files that a group shares; 0o2000 is the setgid bit (POSIX)."""


def keep_private() -> None:
    """Set the umask for private files: from now on new folders have mode 0700, new files 0600."""
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
    """Share `folders` and all that is made in them from now on with a group; missing folders are made.

    If a folder was not shared before, its present content is given to the group as well.

    Raises
    ------
    Fault
        A folder cannot be made, or belongs to another user and not to the group.
    """
    if group is None:
        return
    for folder in folders:
        try:
            if not folder.exists():
                before = os.umask(PRIVATE)
                try:
                    folder.mkdir(parents=True)
                finally:
                    os.umask(before)
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

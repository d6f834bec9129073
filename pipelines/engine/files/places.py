"""Places of a store: a folder of this machine, or any URL that fsspec supports."""

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cache, partial
from operator import itemgetter
from pathlib import Path
from typing import Any, Protocol

from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import Fault, RefusedInput, one_line

LOCAL = ("file", "local")
"""Protocols of fsspec for this machine. They are not used, since fsspec does not write atomically there."""
ABSENT = (FileNotFoundError, NotADirectoryError, IsADirectoryError)
"""Errors that any kind of store raises for a missing file; see `RemoteFiles` for all others."""

DIGESTS = ("ETag", "etag", "md5Hash")
"""Metadata of a file in object stores that change with its content."""
TIMES = ("mtime", "created", "LastModified", "modify", "modificationTime")
"""Metadata of a file in other kinds of stores; the last two are FTP and WebHDFS."""
LISTINGS = 16
"""Folders of an object store that are listed side by side: waiting for one costs no more than for all. Chosen by hand.
"""


class Files(Protocol):
    """Files of a store, by names such as `blobs/ab/abcd`."""

    def path(self, name: str) -> str:
        """Path or URL of the file, for messages."""
        ...

    def read(self, name: str) -> bytes:
        """Content of the file; FileNotFoundError if it is missing, Fault or another OSError if it cannot be read."""
        ...

    def read_part(self, name: str, start: int, length: int) -> bytes:
        """Content of the file from byte `start` on, `length` bytes of it; errors as above."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """Write `data` atomically: a reader finds the old content or the new. Fault if it cannot be written."""
        ...

    def remove(self, name: str) -> None:
        """Remove the file, if it exists. Fault or an OSError if it cannot be removed."""
        ...

    def state(self, name: str) -> str | None:
        """Metadata of the file as text, which changes with the content. None if the file is missing; Fault if the store
        cannot tell."""
        ...

    def states(self, folder: str) -> dict[str, str]:
        """States of all files below a folder, by name. Fault as above."""
        ...

    def written(self, name: str) -> float | None:
        """Time of the last change of content or name, s since 1970; None if the file is missing or the store has no
        times. Fault as above."""
        ...

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        """Names and sizes in bytes of the files below a folder, in order. Fault if they cannot be listed."""
        ...


@dataclass(frozen=True)
class LocalFiles:
    """A folder of this machine."""

    root: str

    def path(self, name: str) -> str:
        """See `Files`, as for all methods below."""
        return f"{self.root}/{name}"

    def read(self, name: str) -> bytes:
        with open(self.path(name), "rb") as file:  # noqa: PTH123 (a Path costs as much as the reading)
            return file.read()

    def read_part(self, name: str, start: int, length: int) -> bytes:
        with open(self.path(name), "rb") as file:  # noqa: PTH123 (as above)
            file.seek(start)
            return file.read(length)

    def write(self, name: str, data: bytes) -> None:
        write_atomically(Path(self.path(name)), data)

    def remove(self, name: str) -> None:
        Path(self.path(name)).unlink(missing_ok=True)

    def state(self, name: str) -> str | None:
        try:
            status = os.stat(f"{self.root}/{name}")  # noqa: PTH116 (as above)
        except OSError:
            return None
        # ctime cannot be set back.
        return f"{status.st_size} {status.st_mtime_ns} {status.st_ctime_ns} {status.st_ino}"

    def states(self, folder: str) -> dict[str, str]:
        states = ((name, self.state(name)) for name, _ in self.sizes(folder))
        return {name: state for name, state in states if state is not None}

    def written(self, name: str) -> float | None:
        try:
            status = os.stat(self.path(name))  # noqa: PTH116 (as above)
        except OSError:
            return None
        return max(status.st_mtime, status.st_ctime)

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        top = Path(self.root)
        for here, below, names in os.walk(top / folder):
            below.sort()
            for name in sorted(names):
                file = Path(here, name)
                try:
                    yield file.relative_to(top).as_posix(), file.stat().st_size
                except FileNotFoundError:  # another run has just renamed it
                    continue


@dataclass(frozen=True)
class RemoteFiles:
    """A folder at a URL of fsspec. A file appears there as a whole, once it is written.

    Each kind of store has its own errors. Only `ABSENT` means that a file is missing. All others become a Fault, never
    an OSError, which `Store.get` takes for a miss: the content of a store that is offline or refuses is unknown. If
    such a store were taken for empty, an archive would be computed anew, and 'cache gc' would see no run under way.
    Therefore the command ends with one line, and the next run continues. Requests are not repeated here: the libraries
    below fsspec do so as their kind of store needs it.
    """

    url: str

    def path(self, name: str) -> str:
        return f"{self.url.rstrip('/')}/{name}"

    def read(self, name: str) -> bytes:
        with self._file_system(name, "read") as (system, inside):
            return bytes(system.cat_file(inside))

    def read_part(self, name: str, start: int, length: int) -> bytes:
        with self._file_system(name, "read") as (system, inside):
            return bytes(system.cat_file(inside, start=start, end=start + length))

    def write(self, name: str, data: bytes) -> None:
        try:
            with self._file_system(name, "written") as (system, inside):
                system.makedirs(inside.rpartition("/")[0], exist_ok=True)
                system.pipe_file(inside, data)
        except FileNotFoundError as error:  # no such bucket, or a file in place of a folder
            raise Fault(f"{self.path(name)}: cannot be written ({error})") from None

    def remove(self, name: str) -> None:
        with suppress(FileNotFoundError), self._file_system(name, "removed") as (system, inside):
            system.rm_file(inside)

    def state(self, name: str) -> str | None:
        try:
            with self._file_system(name, "looked up") as (system, inside):
                info = system.info(inside)
        except FileNotFoundError:
            return None
        return _state(info)

    def states(self, folder: str) -> dict[str, str]:
        return {name: _state(info) for name, info in self._below(folder)}

    def written(self, name: str) -> float | None:
        with (
            suppress(FileNotFoundError),
            self._file_system(name, "looked up") as (system, inside),
            suppress(NotImplementedError),
        ):
            return float(system.modified(inside).timestamp())
        return None

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        for name, info in sorted(self._below(folder), key=itemgetter(0)):
            yield name, int(info["size"])

    def _below(self, folder: str) -> list[tuple[str, dict[str, Any]]]:
        """Names and metadata of the files below a folder."""
        with self._file_system(folder, "listed") as (system, inside):
            start = len(inside.removesuffix(folder).rstrip("/")) + 1
            found, folders = [], [inside]
            # Others, as FTP, have one connection.
            with ThreadPoolExecutor(LISTINGS if system.async_impl else 1) as threads:
                while folders:
                    below = [entry for entries in threads.map(partial(_listed, system), folders) for entry in entries]
                    folders = [entry["name"].rstrip("/") for entry in below if entry["type"] == "directory"]
                    found += [(entry["name"][start:], entry) for entry in below if entry["type"] != "directory"]
        return found

    @contextmanager
    def _file_system(self, name: str, done: str) -> Iterator[tuple[Any, str]]:
        """Give the file system and the path in it. Errors become FileNotFoundError or a Fault that names what was not
        `done`."""
        system, root = _open(self.url)
        try:
            system.invalidate_cache()  # fsspec caches listings, but other processes write there too
            yield system, f"{root.rstrip('/')}/{name}".rstrip("/")
        except ABSENT as error:
            raise FileNotFoundError(_error_text(error)) from None
        except Exception as error:  # each kind of store has its own errors
            raise Fault(f"{self.path(name)}: cannot be {done} ({_error_text(error)})") from None


def open_files(place: Path | str) -> Files:
    """The files of a store at a path, or at a URL.

    Raises
    ------
    RefusedInput
        The URL is not valid for a store, or the library for its protocol is not installed.
    Fault
        The store cannot be reached.
    """
    if isinstance(place, Path) or "://" not in place:
        return LocalFiles(str(place))
    protocol, _, path = place.partition("://")
    if protocol in LOCAL:
        if not Path(path).is_absolute():
            raise RefusedInput(place, f"expected {protocol}:// and a path from the root, as {protocol}:///srv/store")
        return LocalFiles(path)
    _open(place)  # a wrong URL is refused here, before the first request
    return RemoteFiles(place)


@cache
def _open(url: str) -> tuple[Any, str]:
    """The file system of a URL and the path in it; opened once in each process, since connections cannot be pickled."""
    if not url.partition("://")[2].strip("/"):
        raise RefusedInput(url, "names no place, expected PROTOCOL://BUCKET/FOLDER or the like")
    from fsspec.core import url_to_fs
    from fsspec.implementations.local import LocalFileSystem

    try:
        system, root = url_to_fs(url)
    except (ImportError, ValueError, TypeError) as error:  # missing library, unknown protocol, incomplete URL
        problem = one_line(": ".join(str(cause) for cause in (error, error.__cause__) if cause))
        raise RefusedInput(url, f"expected a place that fsspec reaches ({problem})") from None
    except Exception as error:  # as in `RemoteFiles`; some file systems connect here
        raise Fault(f"{url}: cannot be opened ({_error_text(error)})") from None
    if isinstance(system, LocalFileSystem):  # the default of fsspec without a protocol
        raise RefusedInput(url, "names no protocol, expected PROTOCOL://BUCKET/FOLDER or the like")
    return system, str(root)


def _listed(system: Any, folder: str) -> list[dict[str, Any]]:
    """The metadata of what a folder holds.

    fsspec's own `find` and `walk` leave out the folders that they could not list (2026.9).
    """
    try:
        listed: list[dict[str, Any]] = system.ls(folder, detail=True)
    except ABSENT:
        return []
    # An object store may have an empty object with the name of a folder.
    return [entry for entry in listed if entry["name"].rstrip("/") != folder]


def _state(info: Mapping[str, Any]) -> str:
    """A file's metadata as text, the same from a listing and from a request for the file alone.

    S3 lists times in milliseconds and gives those of one file in seconds; others list seconds since 1970, not dates.
    """
    facts = DIGESTS if any(info.get(fact) for fact in DIGESTS) else TIMES
    found = [info.get(fact) for fact in ("size", *facts)]
    return " ".join(str(fact.timestamp() if isinstance(fact, datetime) else fact) for fact in found)


def _error_text(error: Exception) -> str:
    """Type and message of an error; the message alone may be empty or just a path."""
    return one_line(f"{type(error).__name__}: {error}").removesuffix(":")

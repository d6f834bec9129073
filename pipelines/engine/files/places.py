"""Where a store lies: a folder of this machine, or any place that fsspec reaches."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import Fault, RefusedInput, one_line

LOCAL = ("file", "local")
"""fsspec's names for this machine, where it would write into files that others may be reading."""
ABSENT = (FileNotFoundError, NotADirectoryError, IsADirectoryError)
"""What any kind of store raises where no file of a name is; see `RemoteFiles` for all else."""

FACTS = ("size", "ETag", "etag", "md5Hash", "mtime", "created", "LastModified", "modify", "modificationTime")
"""What kinds of store tell of a file: object stores a digest, others a time; the last two are FTP's and WebHDFS's."""


class Files(Protocol):
    """Files of a store, by names such as `blobs/ab/abcd`."""

    def path(self, name: str) -> str:
        """How a person would name the file."""
        ...

    def read(self, name: str) -> bytes:
        """Its content; FileNotFoundError where there is none, Fault or another OSError where it cannot be had."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """Puts `data` there at once: a reader meets the old content or the new. Fault where it cannot."""
        ...

    def remove(self, name: str) -> None:
        """Removes the file, if it is there. Fault or an OSError where it cannot."""
        ...

    def state(self, name: str) -> str | None:
        """What is known of the file without reading it: a change of content changes it. None where there is none;
        Fault where that cannot be known."""
        ...

    def written(self, name: str) -> float | None:
        """When the file got its content or its name, s since 1970; None where there is none, or nobody tells. Fault as
        above."""
        ...

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        """The files below a folder, each with its size in bytes, in order. Fault where they cannot be listed."""
        ...


@dataclass(frozen=True)
class LocalFiles:
    """A folder of this machine."""

    root: str

    def path(self, name: str) -> str:
        """See `Files`, as all below."""
        return f"{self.root}/{name}"

    def read(self, name: str) -> bytes:
        with open(self.path(name), "rb") as file:  # noqa: PTH123 (a Path costs as much as the reading)
            return file.read()

    def write(self, name: str, data: bytes) -> None:
        write_atomically(Path(self.path(name)), data)

    def remove(self, name: str) -> None:
        Path(self.path(name)).unlink(missing_ok=True)

    def state(self, name: str) -> str | None:
        try:
            found = os.stat(f"{self.root}/{name}")  # noqa: PTH116 (as above)
        except OSError:
            return None
        # Of these, ctime cannot be set back.
        return f"{found.st_size} {found.st_mtime_ns} {found.st_ctime_ns} {found.st_ino}"

    def written(self, name: str) -> float | None:
        try:
            found = os.stat(self.path(name))  # noqa: PTH116 (as above)
        except OSError:
            return None
        return max(found.st_mtime, found.st_ctime)

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        top = Path(self.root)
        for here, below, names in os.walk(top / folder):
            below.sort()
            for name in sorted(names):
                file = Path(here, name)
                try:
                    yield file.relative_to(top).as_posix(), file.stat().st_size
                except FileNotFoundError:  # another run has just given it its name
                    continue


@dataclass(frozen=True)
class RemoteFiles:
    """A place that fsspec reaches by its URL; there a file appears as a whole, once it is written.

    Each kind of store has errors of its own. Only what says that no file is there counts as such. All else is a Fault,
    never an OSError, which `Store.get` takes for a miss: of a server that is away, or that refuses, nothing is known.
    Were its store taken for empty, an archive would be computed anew, and 'cache gc' would see no run under way. So who
    cannot be told what is there ends with one line, and the next run goes on. Nothing is tried twice here: the
    libraries below fsspec do so, each as its kind of store needs it.
    """

    url: str

    def path(self, name: str) -> str:
        return f"{self.url.rstrip('/')}/{name}"

    def read(self, name: str) -> bytes:
        with self._asked(name, "read") as (system, inside):
            return bytes(system.cat_file(inside))

    def write(self, name: str, data: bytes) -> None:
        try:
            with self._asked(name, "written") as (system, inside):
                system.makedirs(inside.rpartition("/")[0], exist_ok=True)
                system.pipe_file(inside, data)
        except FileNotFoundError as error:  # no such bucket, or a file in a folder's stead
            raise Fault(f"{self.path(name)}: cannot be written ({error})") from None

    def remove(self, name: str) -> None:
        with suppress(FileNotFoundError), self._asked(name, "removed") as (system, inside):
            system.rm_file(inside)

    def state(self, name: str) -> str | None:
        try:
            with self._asked(name, "looked up") as (system, inside):
                found = system.info(inside)
        except FileNotFoundError:
            return None
        return " ".join(str(found.get(fact)) for fact in FACTS)

    def written(self, name: str) -> float | None:
        with (
            suppress(FileNotFoundError),
            self._asked(name, "looked up") as (system, inside),
            suppress(NotImplementedError),
        ):
            return float(system.modified(inside).timestamp())
        return None

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        with self._asked(folder, "listed") as (system, inside):
            found = sorted(_below(inside, system))
        start = len(inside.removesuffix(folder).rstrip("/")) + 1
        for path, size in found:
            yield path[start:], size

    @contextmanager
    def _asked(self, name: str, done: str) -> Iterator[tuple[Any, str]]:
        """The file system and the name in it, for what is `done` there; FileNotFoundError, or a Fault that says why."""
        system, root = _open(self.url)
        try:
            system.invalidate_cache()  # of listings, by which fsspec answers: others write there, too
            yield system, f"{root.rstrip('/')}/{name}".rstrip("/")
        except ABSENT as error:
            raise FileNotFoundError(_words(error)) from None
        except Exception as error:  # each kind of store has errors of its own
            raise Fault(f"{self.path(name)}: cannot be {done} ({_words(error)})") from None


def open_files(place: Path | str) -> Files:
    """The files of a store at a path, or at a URL.

    Raises
    ------
    RefusedInput
        No store can lie at this URL, or the library is not installed that reaches it.
    Fault
        Nothing answers there.
    """
    if isinstance(place, Path) or "://" not in place:
        return LocalFiles(str(place))
    protocol, _, path = place.partition("://")
    if protocol in LOCAL:
        if not Path(path).is_absolute():
            raise RefusedInput(place, f"expected {protocol}:// and a path from the root, as {protocol}:///srv/store")
        return LocalFiles(path)
    _open(place)  # so that it is refused before anything is asked of it
    return RemoteFiles(place)


@cache
def _open(url: str) -> tuple[Any, str]:
    """The file system at a URL and the place in it; once in a process, for connections do not travel to another."""
    if not url.partition("://")[2].strip("/"):
        raise RefusedInput(url, "names no place, expected PROTOCOL://BUCKET/FOLDER or the like")
    from fsspec.core import url_to_fs
    from fsspec.implementations.local import LocalFileSystem

    try:
        system, root = url_to_fs(url)
    except (ImportError, ValueError, TypeError) as error:  # no library, no such protocol, a part is missing
        problem = one_line(": ".join(str(one) for one in (error, error.__cause__) if one))
        raise RefusedInput(url, f"expected a place that fsspec reaches ({problem})") from None
    except Exception as error:  # as in `RemoteFiles`; some connect at once
        raise Fault(f"{url}: cannot be opened ({_words(error)})") from None
    if isinstance(system, LocalFileSystem):  # which fsspec takes where no protocol is named
        raise RefusedInput(url, "names no protocol, expected PROTOCOL://BUCKET/FOLDER or the like")
    return system, str(root)


def _below(folder: str, system: Any) -> Iterator[tuple[str, int]]:
    """All files below a folder, by their full names, each with its size.

    fsspec's own `find` and `walk` leave out the folders that they could not list (2026.9).
    """
    try:
        listed = system.ls(folder, detail=True)
    except ABSENT:
        return
    for entry in listed:
        path = entry["name"].rstrip("/")
        if path == folder:  # an object store may have an empty object in the name of a folder
            continue
        if entry["type"] == "directory":
            yield from _below(path, system)
        else:
            yield path, int(entry["size"])


def _words(error: Exception) -> str:
    """The kind of an error and what it says, which for some is nothing, or just a path."""
    return one_line(f"{type(error).__name__}: {error}").removesuffix(":")

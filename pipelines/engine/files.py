"""Where a store lies: a folder of this machine, or any place that fsspec reaches."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from pipelines.engine.atomic import write_atomically
from schemas.errors import Fault, RefusedInput, one_line

LOCAL = ("file", "local")
"""fsspec's names for this machine, where it would write into files that others may be reading."""


class Files(Protocol):
    """Files of a store, by names such as `blobs/ab/abcd`."""

    def path(self, name: str) -> str:
        """How a person would name the file."""
        ...

    def read(self, name: str) -> bytes:
        """Its content; FileNotFoundError, or another OSError, where it cannot be had."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """Puts `data` there at once: a reader meets the old content or the new. Fault where it cannot."""
        ...

    def remove(self, name: str) -> None:
        """Removes the file, if it is there."""
        ...

    def state(self, name: str) -> str | None:
        """What is known of the file without reading it: a change of content changes it. None where there is none."""
        ...

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        """The files below a folder, each with its size in bytes, in order."""
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
    """A place that fsspec reaches by its URL; there a file appears as a whole, once it is written."""

    url: str

    def path(self, name: str) -> str:
        return f"{self.url.rstrip('/')}/{name}"

    def read(self, name: str) -> bytes:
        return bytes(self._system.cat_file(self._inside(name)))

    def write(self, name: str, data: bytes) -> None:
        try:
            self._system.makedirs(self._inside(name).rpartition("/")[0], exist_ok=True)
            self._system.pipe_file(self._inside(name), data)
        except Exception as error:  # each kind of store has errors of its own
            raise Fault(f"{self.path(name)}: cannot be written ({one_line(str(error))})") from None

    def remove(self, name: str) -> None:
        if self._system.exists(self._inside(name)):
            self._system.rm_file(self._inside(name))

    def state(self, name: str) -> str | None:
        try:
            found = self._system.info(self._inside(name))
        except (FileNotFoundError, NotADirectoryError):
            return None
        # Each kind of store tells what it has: an object store a digest, others a time.
        told = (found.get(fact) for fact in ("size", "ETag", "etag", "md5Hash", "mtime", "created", "LastModified"))
        return " ".join(str(fact) for fact in told)

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        self._system.invalidate_cache()
        found = self._system.find(self._inside(folder), detail=True)
        start = len(self._inside("")) + (not self._inside("").endswith("/"))
        for path in sorted(found):
            yield path[start:], int(found[path]["size"])

    @cached_property
    def _place(self) -> tuple[Any, str]:
        from fsspec.core import url_to_fs

        try:
            system, root = url_to_fs(self.url)
        except (ImportError, ValueError) as error:
            raise RefusedInput(self.url, f"expected a place that fsspec reaches ({one_line(str(error))})") from None
        return system, str(root)

    @property
    def _system(self) -> Any:
        return self._place[0]

    def _inside(self, name: str) -> str:
        return f"{self._place[1].rstrip('/')}/{name}".rstrip("/")


def open_files(place: Path | str) -> Files:
    """The files of a store at a path, or at a URL."""
    if isinstance(place, Path) or "://" not in place:
        return LocalFiles(str(place))
    protocol, _, path = place.partition("://")
    return LocalFiles(path) if protocol in LOCAL else RemoteFiles(place)

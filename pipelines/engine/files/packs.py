"""Small files of a store in packs: the rows of ten thousand scans are a hundred files, not half a million.

A file is written by itself, so that a crash loses nothing and many runs may write side by side. Once there are many,
they are gathered into packs that never change, as Git does with its objects (gitformat-pack(5)). A file that lies by
itself counts before one in a pack, and a later pack counts before an earlier one.

A pack begins with a table of its files (`ENTRY`); their contents follow. Its name is
`packs/FOLDER/NUMBER-FILES-DIGEST`: its place in the order of packs, the number of its files, the digest of its table.
"""

import logging
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby, takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipelines.engine.files.digest import sha256
from pipelines.engine.files.names import BLOBS, LATEST, ROWS, file_name, split_name
from pipelines.engine.files.places import Files, RemoteFiles

log = logging.getLogger("footscan.store")

PACKED = (ROWS, LATEST)
"""Folders whose files are packed."""
FOLDER = "packs"
"""Folder of the packs, one folder in it for each of `PACKED`."""
MANY = 4096
"""Number of files by themselves from which they are packed. Chosen by hand: a folder of so many is listed in 10 ms."""
PACK_BYTES = 8_000_000
"""Size up to which a pack is filled: a bound of what one removal writes anew. Chosen by hand."""
TRIES = 3
"""How often a file is looked for while other processes merge packs. Chosen by hand."""

ENTRY = np.dtype([("digest", "V32"), ("offset", "<u8"), ("length", "<u4"), ("written", "<f8")])
"""An entry of the table: digest in the file's name, place of its content behind the table, bytes, and the time when the
file was written, s since 1970."""

Table = NDArray[np.void]
_PACK = re.compile(rf"{FOLDER}/\w+/(\d+)-(\d+)-([0-9a-f]{{64}})").fullmatch


class _File(NamedTuple):
    """A file to be packed."""

    digest: bytes
    """In its name"""
    written: float
    """s since 1970"""
    data: bytes


class _Pack(NamedTuple):
    """A pack of which the table was read."""

    name: str
    state: str | None
    """Of its file, see `Files.state`"""
    table: Table
    """(N,) of `ENTRY`"""

    @property
    def number(self) -> int:
        """Its place in the order of packs."""
        return int(self.name.rpartition("/")[2].partition("-")[0])

    @property
    def bytes(self) -> int:
        """Size of what it holds."""
        return int(self.table["length"].sum())

    def span(self, number: int) -> tuple[int, int]:
        """Place of the content of a file, by its number in the table, and its length, bytes."""
        entry = self.table[number]
        return self.table.nbytes + int(entry["offset"]), int(entry["length"])


class _Packed(NamedTuple):
    """A file in a pack."""

    pack: _Pack
    number: int
    """In its table"""

    @property
    def state(self) -> str:
        """See `Files.state`."""
        return f"{self.number} in {self.pack.state}"


class _Index:
    """What the packs of one folder hold.

    Parameters
    ----------
    listed : names of all packs that are there, in their order
    packs : those whose tables are sound
    """

    def __init__(self, listed: Sequence[str] = (), packs: Sequence[_Pack] = ()) -> None:
        self.listed, self.packs = list(listed), list(packs)
        self.files: dict[bytes, _Packed] = {}
        """By the digest in its name, each in the latest pack that has it"""
        for pack in packs:
            digests = pack.table["digest"].tolist()
            self.files |= {digest: _Packed(pack, number) for number, digest in enumerate(digests)}


@dataclass(frozen=True)
class PackedFiles:
    """The files of a place, of which small ones may lie in packs; see `Files`."""

    place: Files
    _indexes: dict[str, _Index] = field(default_factory=dict, compare=False, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return PackedFiles, (self.place,)  # other processes read the tables themselves

    def path(self, name: str) -> str:
        """See `Files`, as for all methods up to `pack`."""
        return self.place.path(name)

    def read(self, name: str) -> bytes:
        with suppress(FileNotFoundError):
            return self.place.read(name)
        for _ in range(TRIES):
            if (found := self._find(name)) is None:
                break
            with suppress(FileNotFoundError):
                return self.place.read_part(found.pack.name, *found.pack.span(found.number))
            self._indexes.clear()  # another process has merged the pack with others
        raise FileNotFoundError(self.path(name))

    def write(self, name: str, data: bytes) -> None:
        self.place.write(name, data)

    def remove(self, name: str) -> None:
        self.remove_all([name])

    def state(self, name: str) -> str | None:
        state = self.place.state(name)
        if state is None and (found := self._find(name)) is not None:
            state = found.state
        return state

    def snapshot(self) -> "Snapshot":
        """Rows and blobs as they are at present, for many of them."""
        states = self.place.states(ROWS)
        if isinstance(self.place, RemoteFiles):
            states |= self.place.states(BLOBS)
        return Snapshot(self, self._listed_anew(ROWS).files, states)

    def written(self, name: str) -> float | None:
        written = self.place.written(name)
        if written is None and (found := self._find(name)) is not None:
            written = float(found.pack.table["written"][found.number])
        return written

    def sizes(self, folder: str) -> Iterator[tuple[str, int]]:
        inside = f"{folder}/" if folder else ""
        packed = [name for name in PACKED if f"{name}/".startswith(inside) or inside.startswith(f"{name}/")]
        if not packed:
            yield from self.place.sizes(folder)
            return
        sizes = {}
        for one in packed:
            for digest, file in self._listed_anew(one).files.items():
                if (name := file_name(one, digest.hex())).startswith(inside):
                    sizes[name] = int(file.pack.table["length"][file.number])
        sizes |= {name: size for name, size in self.place.sizes(folder) if not _PACK(name)}
        yield from sorted(sizes.items())

    def many_by_themselves(self) -> list[str]:
        """Names of the small files that lie by themselves, of folders with `MANY` of them or more."""
        by_folder = [[name for name, _ in self.place.sizes(folder) if split_name(name)] for folder in PACKED]
        return [name for names in by_folder if len(names) >= MANY for name in names]

    def pack(self, names: Iterable[str]) -> None:
        """Gather small files that lie by themselves into packs."""
        for folder, group in groupby(names, key=lambda name: name.partition("/")[0]):
            self._gather(folder, list(group))

    def remove_all(self, names: Iterable[str]) -> None:
        """Remove files, if they exist; each pack that holds some of them is written anew, once."""
        digests: dict[str, set[bytes]] = {}
        for name in names:
            self.place.remove(name)
            if (parts := _split(name)) is not None:
                digests.setdefault(parts[0], set()).add(parts[1])
        for folder, removed in digests.items():
            for pack in self._listed_anew(folder).packs:
                if removed.isdisjoint(pack.table["digest"].tolist()):
                    continue
                if kept := [file for file in self._files_of(pack) if file.digest not in removed]:
                    self._write_pack(folder, pack.number, kept)
                self.place.remove(pack.name)
            self._indexes.pop(folder, None)

    def damaged_packs(self) -> list[str]:
        """Names of the packs whose tables are damaged: nobody can tell what they hold."""
        indexes = [self._listed_anew(folder) for folder in PACKED]
        return [name for index in indexes for name in set(index.listed) - {pack.name for pack in index.packs}]

    def _find(self, name: str) -> _Packed | None:
        if (parts := _split(name)) is None:
            return None
        folder, digest = parts
        index = self._indexes.get(folder)
        found = None if index is None else index.files.get(digest)
        return found or self._listed_anew(folder).files.get(digest)  # another process may have packed it meanwhile

    def _listed_anew(self, folder: str) -> _Index:
        """The index of a folder; tables of packs that were not there before are read."""
        index = self._indexes.get(folder)
        listed = sorted(name for name, _ in self.place.sizes(f"{FOLDER}/{folder}") if _PACK(name))
        if index is None or index.listed != listed:
            before = {} if index is None else {pack.name: pack for pack in index.packs}
            packs = [before.get(name) or self._read_table(name) for name in listed]
            index = self._indexes[folder] = _Index(listed, [pack for pack in packs if pack is not None])
        return index

    def _read_table(self, name: str) -> _Pack | None:
        match = _PACK(name)
        assert match is not None
        try:
            state, table = self.place.state(name), self.place.read_part(name, 0, int(match[2]) * ENTRY.itemsize)
        except FileNotFoundError:  # another process has merged it with others
            return None
        except OSError:
            table = b""
        if sha256(table) != match[3]:
            log.warning("%s: damaged, what it holds will be made again", self.path(name))
            return None
        return _Pack(name, state, np.frombuffer(table, ENTRY))

    def _files_of(self, pack: _Pack) -> list[_File]:
        data = self.place.read(pack.name)
        spans = [pack.span(number) for number in range(len(pack.table))]
        return [
            _File(entry["digest"].tobytes(), float(entry["written"]), data[start : start + length])
            for entry, (start, length) in zip(pack.table, spans, strict=True)
        ]

    def _gather(self, folder: str, names: Sequence[str]) -> None:
        states = {name: self.place.state(name) for name in names}
        packs = self._listed_anew(folder).packs
        number = packs[-1].number + 1 if packs else 1
        # The last ones alone: an earlier one must stay before what lies between.
        merged = [*takewhile(lambda pack: pack.bytes < PACK_BYTES / 2, reversed(packs))][::-1]
        files = {file.digest: file for pack in merged for file in self._files_of(pack)}
        digests = {name: parts[1] for name in names if (parts := _split(name)) is not None}
        for name, digest in digests.items():
            with suppress(FileNotFoundError):
                file = _File(digest, self.place.written(name) or time.time(), self.place.read(name))
                files[file.digest] = file
        ends = np.cumsum([len(file.data) for file in files.values()])
        for part in np.split(np.array([*files], object), np.flatnonzero(np.diff(ends // PACK_BYTES)) + 1):
            self._write_pack(folder, number, [files[digest] for digest in part])
            number += 1
        for pack in merged:
            self.place.remove(pack.name)
        for name, state in states.items():
            if self.place.state(name) == state:  # not written again meanwhile
                self.place.remove(name)

    def _write_pack(self, folder: str, number: int, files: Sequence[_File]) -> None:
        table = np.zeros(len(files), ENTRY)
        lengths = [len(file.data) for file in files]
        for column, values in (
            ("digest", np.frombuffer(b"".join(file.digest for file in files), ENTRY["digest"])),
            ("offset", np.cumsum([0, *lengths[:-1]])),
            ("length", lengths),
            ("written", [file.written for file in files]),
        ):
            table[column] = values
        head = table.tobytes()
        name = f"{FOLDER}/{folder}/{number:08}-{len(files)}-{sha256(head)}"
        self.place.write(name, head + b"".join(file.data for file in files))
        self._indexes.pop(folder, None)


@dataclass(frozen=True)
class Snapshot:
    """Rows and blobs as they were when it was taken.

    Rows that lie by themselves are few, and the others are in packs: none has to be looked for. Blobs of a store at a
    URL were listed, instead of a request for each, and its packs are read as a whole.
    """

    files: PackedFiles
    packed: Mapping[bytes, _Packed]
    """Rows in packs, by the digest in their name"""
    states: Mapping[str, str]
    """Of what was listed, see `Files.state`"""
    _packs: dict[str, bytes] = field(default_factory=dict)

    def state(self, name: str) -> str | None:
        """See `Files`."""
        known = self.states.get(name)
        if known is None and (found := self._in_pack(name)) is not None:
            return found.state
        is_listed = isinstance(self.files.place, RemoteFiles) or name.startswith(f"{ROWS}/")
        return known if is_listed or known is not None else self.files.place.state(name)

    def read(self, name: str) -> bytes:
        """See `Files`."""
        found = None if name in self.states else self._in_pack(name)
        if found is None or not isinstance(self.files.place, RemoteFiles):
            return self.files.read(name)
        if (data := self._packs.get(found.pack.name)) is None:
            try:
                data = self._packs[found.pack.name] = self.files.place.read(found.pack.name)
            except FileNotFoundError:  # another process has merged the pack with others
                return self.files.read(name)
        start, length = found.pack.span(found.number)
        return data[start : start + length]

    def _in_pack(self, name: str) -> _Packed | None:
        parts = _split(name)
        return self.packed.get(parts[1]) if parts is not None and parts[0] == ROWS else None


def in_batches(names: Sequence[str], size: int) -> Iterator[Sequence[str]]:
    """Split names into batches for `PackedFiles.remove_all`, in their order.

    Names of files that may lie in packs, one behind the other, are one batch, so that no pack is written twice.

    >>> row = f"actions/aa/{64 * 'a'}.json"
    >>> [len(batch) for batch in in_batches([row, row, row, "blobs/a", "blobs/b", "blobs/c"], 2)]
    [3, 2, 1]
    """
    for is_packed, group in groupby(names, key=lambda name: _split(name) is not None):
        batch = list(group)
        step = len(batch) if is_packed else size
        yield from (batch[start : start + step] for start in range(0, len(batch), step))


def _split(name: str) -> tuple[str, bytes] | None:
    """Folder and digest of a file that may lie in a pack; None for another file."""
    parts = split_name(name)
    return None if parts is None or parts[0] not in PACKED else (parts[0], bytes.fromhex(parts[1]))

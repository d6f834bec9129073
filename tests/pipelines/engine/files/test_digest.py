"""Digests of files: only a changed file is read again."""

import json
import os
import time
from pathlib import Path

import pytest

from pipelines.engine.files import digest, file_digests
from pipelines.engine.files.digest import SETTLED_NS, FileState, file_state, sha256
from pipelines.engine.files.file_digests import FileDigests
from schemas.base.errors import RefusedInput


@pytest.fixture
def film(tmp_path: Path) -> Path:
    path = tmp_path / "film.avi"
    path.write_bytes(b"frames")
    return path


@pytest.fixture
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """All files count as settled."""
    monkeypatch.setattr(digest, "SETTLED_NS", -(10**18))


def remembered(memory: Path) -> dict[str, str]:
    return {path: known for path, _, known in json.loads(memory.read_bytes())["rows"]} if memory.exists() else {}


def test_digest_of_bytes_and_files(film: Path, tmp_path: Path) -> None:
    # FIPS 180-2, appendix B.1
    assert sha256(b"abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert FileDigests(tmp_path / "m").of(film) == (sha256(b"frames"), file_state(film))


@pytest.mark.usefixtures("settled")
def test_unchanged_file_is_not_read_again(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digests = FileDigests(tmp_path / "files.json")
    digests.of(film)
    digests.save()
    again = FileDigests.load(tmp_path / "files.json")
    monkeypatch.setattr(Path, "open", lambda *_: pytest.fail("read again"))
    assert again.of(film) == digests.of(film) == (sha256(b"frames"), file_state(film))


@pytest.mark.usefixtures("settled")
def test_digests_keep_their_owners_seal_when_others_are_forgotten(film: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept.avi"
    kept.write_bytes(b"more frames")
    digests = FileDigests.load(tmp_path / "files.json", b"secret")
    for path in (film, kept):
        digests.of(path)
    digests.forget(lambda path, _: path == str(film))
    again = FileDigests.load(tmp_path / "files.json", b"secret")
    assert set(again._digests) == {str(kept)}


@pytest.mark.usefixtures("settled")
def test_changed_byte_with_its_time_put_back_is_noticed(film: Path, tmp_path: Path) -> None:
    digests = FileDigests(tmp_path / "files.json")
    before = film.stat()
    digests.of(film)
    time.sleep(0.02)  # longer than the file system's tick
    with film.open("r+b") as file:
        file.write(b"F")
    os.utime(film, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = film.stat()
    assert (after.st_size, after.st_mtime_ns, after.st_ino) == (before.st_size, before.st_mtime_ns, before.st_ino)
    assert digests.of(film)[0] == sha256(b"Frames")


@pytest.mark.usefixtures("settled")
def test_exchanged_file_is_noticed(film: Path, tmp_path: Path) -> None:
    digests = FileDigests(tmp_path / "files.json")
    digests.of(film)
    before = film.stat()
    other = tmp_path / "other"
    other.write_bytes(b"Frames")
    os.utime(other, ns=(before.st_atime_ns, before.st_mtime_ns))
    other.replace(film)
    assert digests.of(film)[0] == sha256(b"Frames")


def test_young_files_are_not_remembered(film: Path, tmp_path: Path) -> None:
    memory = tmp_path / "files.json"
    digests = FileDigests(memory)
    digests.of(film)
    os.utime(film, ns=(0, 0))  # an old time stamp does not make it old
    digests.of(film)
    os.utime(film, ns=(0, time.time_ns() + 10**12))  # nor does one of the future
    digests.of(film)
    digests.save()
    assert remembered(memory) == {}
    film.write_bytes(b"others")
    assert digests.of(film)[0] == sha256(b"others")


def test_settled_files_are_remembered(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digests = FileDigests(tmp_path / "files.json")
    later = time.time_ns() + SETTLED_NS + 10**9
    monkeypatch.setattr(time, "time_ns", lambda: later)
    digests.of(film)
    digests.save()
    assert remembered(tmp_path / "files.json") == {str(film): sha256(b"frames")}


@pytest.mark.parametrize(
    "memory",
    [b"", b"\xff", b"{}", b"null", b"[1]", b'[["a", [1, 2], "b"]]', b'[[["a"], [1, 2, 3, 4], "b"]]', b"[" * 100_000],
)
def test_damaged_memory_is_forgotten(film: Path, tmp_path: Path, memory: bytes) -> None:
    path = tmp_path / "files.json"
    path.write_bytes(memory)
    assert FileDigests.load(path).of(film)[0] == sha256(b"frames")


def test_file_that_is_being_written_is_refused(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_digests, "file_state", lambda _: FileState(3, 0, 0, 0))
    with pytest.raises(RefusedInput, match=r"film\.avi: is being written to, expected a finished file$"):
        FileDigests(tmp_path / "files.json").of(film)


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    digests = FileDigests(tmp_path / "files.json")
    with pytest.raises(RefusedInput, match=r"missing: no such file$"):
        digests.of(tmp_path / "missing")
    with pytest.raises(RefusedInput, match=r"cannot be read \(Is a directory\)$"):
        digests.of(tmp_path)

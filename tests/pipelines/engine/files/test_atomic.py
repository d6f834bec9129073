"""Atomic writes: a reader finds the old content or the new."""

import os
import threading
from pathlib import Path

import pytest

from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import Fault


def test_writes_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "a/b/c"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(path.parent.iterdir()) == [path]


def test_a_link_stays_and_what_it_points_to_is_written(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder/file")
    for data in (b"first", b"second"):
        write_atomically(tmp_path / "link", data)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "folder/file").read_bytes() == data


def test_devices_and_pipes_are_written_into(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_atomically(pipe, b"data")
    reader.join(10)
    assert read == [b"data"]
    assert pipe.is_fifo()
    link = tmp_path / "link"
    link.symlink_to("/dev/full")  # never by its own name: a mistake here would cost the machine its device
    with pytest.raises(Fault, match=r"cannot be written \(No space left"):
        write_atomically(link, b"data")
    assert link.is_char_device()


def test_refusal_of_the_disk_is_a_fault_and_leaves_no_part(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder/full").mkdir(parents=True)
    for path in (tmp_path / "file/x", tmp_path / "folder", tmp_path / ("x" * 300)):
        with pytest.raises(Fault, match=r"cannot be written \("):
            write_atomically(path, b"data")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_interruption_leaves_the_old_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    path = tmp_path / "a"
    write_atomically(path, b"old")

    def interrupted(*_: Path) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", interrupted)
        with pytest.raises(error):
            write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_no_reader_meets_a_part(tmp_path: Path) -> None:
    path, contents = tmp_path / "a", [bytes([value]) * 100_000 for value in range(4)]
    write_atomically(path, contents[0])
    writers = [
        threading.Thread(target=lambda data=data: [write_atomically(path, data) for _ in range(30)])
        for data in contents
    ]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert path.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [path]

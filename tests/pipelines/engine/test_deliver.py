"""Results out of the store into a folder."""

from pathlib import Path

import pytest

from pipelines.engine.deliver import deliver
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.store.store import Store, blob_name, open_store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


@pytest.fixture
def digests(tmp_path: Path) -> FileDigests:
    return FileDigests(tmp_path / "files.json")


def test_writes_what_is_missing_or_differs_and_nothing_else(tmp_path: Path, store: Store, digests: FileDigests) -> None:
    blobs = {name: store.put(name.encode()) for name in ("a", "b", "c")}
    folder = tmp_path / "results"
    assert deliver(blobs, store, digests, folder) is None
    before = (folder / "a").stat().st_ino
    (folder / "b").write_bytes(b"changed")
    (folder / "c").unlink()
    (folder / "notes").write_bytes(b"a person's own")
    assert deliver(blobs, store, digests, folder) is None
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        "a": b"a", "b": b"b", "c": b"c", "notes": b"a person's own",
    }  # fmt: skip
    assert (folder / "a").stat().st_ino == before


def test_damaged_content_is_said(tmp_path: Path, store: Store, digests: FileDigests) -> None:
    digest = store.put(b"foot")
    store.files.write(blob_name(digest), b"feet")
    problem = deliver({"foot.stl": digest}, store, digests, tmp_path / "results")
    assert problem is not None
    assert problem.startswith(f"{tmp_path / 'results/foot.stl'}: ")
    assert not (tmp_path / "results/foot.stl").exists()


def test_folder_that_cannot_be_written_is_said(tmp_path: Path, store: Store, digests: FileDigests) -> None:
    (tmp_path / "results").write_text("in the way")
    problem = deliver({"foot.stl": store.put(b"foot")}, store, digests, tmp_path / "results")
    assert problem is not None
    assert "foot.stl: cannot be written" in problem

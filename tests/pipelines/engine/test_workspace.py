"""A workspace: results out of the store into a folder."""

from pathlib import Path

import pytest

from pipelines.engine.files.names import blob_name
from pipelines.engine.workspace import Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "store")


def test_writes_what_is_missing_or_differs_and_nothing_else(tmp_path: Path, workspace: Workspace) -> None:
    blobs = {name: workspace.store.put(name.encode()) for name in ("a", "b", "c")}
    folder = tmp_path / "results"
    assert workspace.deliver(blobs, folder) is None
    before = (folder / "a").stat().st_ino
    (folder / "b").write_bytes(b"changed")
    (folder / "c").unlink()
    (folder / "notes").write_bytes(b"a person's own")
    assert workspace.deliver(blobs, folder) is None
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        "a": b"a", "b": b"b", "c": b"c", "notes": b"a person's own",
    }  # fmt: skip
    assert (folder / "a").stat().st_ino == before


def test_damaged_content_is_said(tmp_path: Path, workspace: Workspace) -> None:
    digest = workspace.store.put(b"foot")
    workspace.store.files.write(blob_name(digest), b"feet")
    problem = workspace.deliver({"foot.stl": digest}, tmp_path / "results")
    assert problem is not None
    assert problem.startswith(f"{tmp_path / 'results/foot.stl'}: ")
    assert not (tmp_path / "results/foot.stl").exists()


def test_folder_that_cannot_be_written_is_said(tmp_path: Path, workspace: Workspace) -> None:
    (tmp_path / "results").write_text("in the way")
    problem = workspace.deliver({"foot.stl": workspace.store.put(b"foot")}, tmp_path / "results")
    assert problem is not None
    assert "foot.stl: cannot be written" in problem

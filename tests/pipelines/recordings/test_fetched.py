"""An archive in an object store: fetched once, and again where it has changed."""

import json
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fsspec.implementations.memory import MemoryFileSystem

from pipelines.cli.main import run_command
from pipelines.recordings.fetched import FetchedArchive
from schemas.base.errors import RefusedInput


@pytest.fixture
def remote(done: Any) -> Iterator[Any]:
    """A finished archive whose films now lie in a store; results and cache stay."""
    place = f"memory://{uuid.uuid4().hex}"
    memory, films = MemoryFileSystem(), done.root / "archive"
    for file in films.rglob("*"):
        if file.is_file() and ".zarr" not in str(file):
            memory.pipe_file(f"{place}/{file.relative_to(films)}", file.read_bytes())
    memory.pipe_file(f"{place}/P0002/S1/scan.yaml", b"format: footscan.scan/1\n")
    films.rename(done.root / "elsewhere")
    done.workflow.write_text(done.workflow.read_text().replace("archive: archive", f"archive: {place}"))
    done.place = place
    yield done
    memory.rm(place, recursive=True)


def fetched(remote: Any, name: str) -> list[Path]:
    return list((remote.root / "results/.footscan/archive").glob(f"*/{name}"))


def test_films_are_fetched_and_their_results_known(remote: Any, capsys: pytest.CaptureFixture[str]) -> None:
    before = (remote.results / "foot.stl").read_bytes()
    assert run_command(["run", str(remote.workflow), "--only", "P0001", "--json"]) == 0
    # The films are the same, so that only their frames are made again.
    assert json.loads(capsys.readouterr().out)["ran"] == 2
    assert (remote.results / "foot.stl").read_bytes() == before
    [film] = fetched(remote, "P0001/S1/cam1.avi")
    state = film.stat().st_mtime_ns
    assert run_command(["run", str(remote.workflow), "--only", "P0001"]) == 0
    assert (capsys.readouterr().err.splitlines()[0], film.stat().st_mtime_ns) == ("0 of 21 steps to run", state)


def test_a_changed_film_is_fetched_again_and_a_gone_one_removed(remote: Any) -> None:
    archive = FetchedArchive(remote.place, remote.root / "cache")
    archive.fetch_documents()
    (archive.folder / "P0001/S1/cam1.avi").parent.mkdir(parents=True, exist_ok=True)
    assert not (archive.folder / "P0001/S1/cam1.avi").exists()
    memory = MemoryFileSystem()
    memory.pipe_file(f"{remote.place}/P0002/S1/scan.yaml", b"format: footscan.scan/2\n")
    memory.rm(f"{remote.place}/P0001/S1/scan.yaml")
    again = FetchedArchive(remote.place, remote.root / "cache")
    again.fetch_documents()
    assert (again.folder / "P0002/S1/scan.yaml").read_text() == "format: footscan.scan/2\n"
    assert not (again.folder / "P0001/S1/scan.yaml").exists()


def test_what_cannot_be_opened_is_refused(remote: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(RefusedInput, match="archive: cannot be opened"):
        FetchedArchive("nothing://feet", remote.root / "cache")
    assert run_command(["run", str(remote.workflow), "--watch"]) == 2
    assert "--watch: does not look into memory://" in capsys.readouterr().err
    assert run_command(["forget", "P0001", "--workflow", str(remote.workflow), "--yes"]) in (0, 1)
    said = "".join(capsys.readouterr())
    assert f"{remote.place} is not erased from" in said

"""Faults of the machine: one line, exit status 3, and nothing half-written."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from footscan.frames.shard import ShardWriter
from tests.helpers.stored_frames import frame_bytes

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
Results = Callable[[Path], dict[str, bytes]]


@pytest.fixture
def fill_disk(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """From now on, files with this text in their path are written to the half, and then the disk is full."""
    write_bytes = Path.write_bytes

    def fill(where: str) -> None:
        def write(path: Path, data: bytes) -> int:
            if where not in str(path):
                return write_bytes(path, data)
            write_bytes(path, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

        monkeypatch.setattr(Path, "write_bytes", write)

    return fill


def partials(folder: Path) -> list[Path]:
    return [file for file in folder.rglob("*") if "partial" in file.name]


def test_full_disk_while_results_are_delivered(
    footscan: Footscan,
    mistake: Mistake,
    bench: Path,
    results: Results,
    fill_disk: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = results(bench)
    (bench / "results/P0001/small/measures.json").unlink()
    fill_disk("measures.json")
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 3
    assert "measures.json: cannot be written (No space left on device)" in mistake(done)
    assert partials(bench) == []
    assert not (bench / "results/P0001/small/measures.json").exists()
    monkeypatch.undo()
    assert footscan("run", bench / "workflow.yaml").returncode == 0
    assert results(bench) == before


def test_full_disk_while_steps_run(
    footscan: Footscan,
    mistake: Mistake,
    bench: Path,
    results: Results,
    fill_disk: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Never cached: with room on the disk the next run ends well."""
    before = results(bench)
    workflow = (bench / "workflow.yaml").read_text()
    (bench / "workflow.yaml").write_text(workflow + "parameters: {outliers: {shortest: 2}}\n")
    fill_disk(".footscan/blobs")
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 3
    assert "No space left on device" in mistake(done)
    assert results(bench) == before
    assert partials(bench) == []
    monkeypatch.undo()
    assert footscan("run", bench / "workflow.yaml").returncode == 0


def test_full_disk_while_films_become_frames(footscan: Footscan, fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add = ShardWriter.add

    def fill(shard: ShardWriter, number: int, data: bytes) -> None:
        add(shard, number, data[: len(data) // 2] if number == 30 else data)
        if number == 30:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(ShardWriter, "add", fill)
    done = footscan("ingest", fresh / "archive/P0001/small")
    scan = fresh / "archive/P0001/small"
    assert done.returncode == 3
    assert len(done.stderr.splitlines()) == 8  # a line for each camera
    assert all("cannot be written (No space left on device)" in line for line in done.stderr.splitlines())
    assert not list((scan / "frames.zarr").glob("cam*"))
    assert partials(fresh) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("calibrate", "chart", "capture/chart.csv", "--out"),
        ("measure", "results/P0001/small/foot.stl", "--out"),
        ("extract", "frame.jpg", "--out"),
    ],
    ids=["calibrate", "measure", "extract"],
)
def test_full_disk_at_a_written_file(
    footscan: Footscan,
    bench: Path,
    fill_disk: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
) -> None:
    (bench / "frame.jpg").write_bytes(frame_bytes(bench / "archive/P0001/small/frames.zarr/cam1", 40))
    monkeypatch.chdir(bench)
    Path("out").write_text("what was there before")
    fill_disk(".out.")
    done = footscan(*arguments, "out")
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == "footscan: out: cannot be written (No space left on device)"
    assert Path("out").read_text() == "what was there before"
    assert partials(bench) == []


def test_results_folder_that_is_a_file(footscan: Footscan, fresh: Path) -> None:
    (fresh / "results").write_text("notes")
    done = footscan("run", fresh / "workflow.yaml")
    assert done.returncode in {2, 3}
    told = [line for line in done.stderr.splitlines() if line.startswith("footscan: ")]
    assert all(str(fresh / "results") in line for line in told)  # of the scan, and of the table of all
    assert len(told) == 2
    assert (fresh / "results").read_text() == "notes"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_results_folder_that_may_not_be_written(footscan: Footscan, mistake: Mistake, fresh: Path) -> None:
    (fresh / "results").mkdir(mode=0o500)
    done = footscan("run", fresh / "workflow.yaml")
    assert done.returncode in {2, 3}
    assert "cannot be written (Permission denied)" in mistake(done)

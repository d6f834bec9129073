"""Links in an archive: a link that leads out of it is refused, and its target is not changed."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from footscan.frames.shard import SHARD
from footscan.recordings.scans import read_scan
from pipelines.cli.main import run_command
from schemas.base.errors import RefusedInput
from tests.helpers.stored_frames import frame_bytes

LEAVES = "leaves the archive, expected a path inside it"


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder outside the archive, with files that are somebody's own."""
    folder = tmp_path / "elsewhere"
    (folder / "cam5").mkdir(parents=True)
    (folder / "cam1").write_text("a file of mine")
    (folder / "cam5/letter.txt").write_text("mine, too")
    return folder


def content(folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): file.read_text() for file in folder.rglob("*") if file.is_file()}


def frames(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr").symlink_to(elsewhere)


def array(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr").mkdir()
    (archive.scan / "frames.zarr/cam1").symlink_to(elsewhere / "cam5")


def manifest(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr/cam1").mkdir(parents=True)
    (archive.scan / "frames.zarr/cam1/zarr.json").symlink_to(elsewhere / "cam1")


def chunk(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr/cam1").mkdir(parents=True)
    (archive.scan / "frames.zarr/cam1" / SHARD).symlink_to(elsewhere / "cam1")


def group(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr").mkdir()
    (archive.scan / "frames.zarr/zarr.json").symlink_to(elsewhere / "cam1")


def dangling(archive: Any, elsewhere: Path) -> None:
    (archive.scan / "frames.zarr").symlink_to(elsewhere / "not there yet")


@pytest.mark.parametrize("link", [frames, array, manifest, chunk, group, dangling])
@pytest.mark.parametrize("command", ["ingest", "run"])
def test_a_link_among_the_frames_that_leads_out_is_refused(
    archive: Any,
    elsewhere: Path,
    link: Callable[[Any, Path], None],
    command: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    link(archive, elsewhere)
    before = content(elsewhere)
    status = run_command([command, str(archive.workflow if command == "run" else archive.scan)])
    messages = capsys.readouterr().err
    assert status in {1, 2}
    assert LEAVES in messages
    assert str(archive.scan / "scan.yaml") in messages
    assert "frames" in messages
    assert content(elsewhere) == before
    assert not (elsewhere / "not there yet").exists()


def test_a_link_that_stays_inside_is_followed(archive: Any) -> None:
    place = archive.root / "archive/large-disk"
    place.mkdir()
    (archive.scan / "frames.zarr").symlink_to(place)
    ends, ran = archive.run()
    assert ends[0].problem is None
    assert "ingest-1" in ran
    assert (place / "cam1/zarr.json").is_file()
    assert (archive.scan / "frames.zarr").is_symlink()
    assert archive.run()[1] == set()


@pytest.mark.parametrize("kind", ["file", "foreign", "folder"])
def test_nothing_is_removed_that_footscan_did_not_write(
    archive: Any, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    place = archive.scan / "frames.zarr/cam1"
    mine = place if kind == "file" else place / ("notes.txt" if kind == "foreign" else "below/0.0.0.0")
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    assert run_command(["ingest", str(archive.scan)]) == 3
    assert "footscan did not write" in capsys.readouterr().err or kind == "file"
    assert mine.read_text() == "mine"
    moved = archive.root / "moved"
    place.rename(moved)
    assert archive.run()[0][0].problem is None  # nothing of it was remembered


def test_an_array_that_was_damaged_or_left_half_written_is_replaced(done: Any) -> None:
    place = done.scan / "frames.zarr/cam1"
    (place / "zarr.json").unlink()
    (place / "7.renumbered").write_bytes(b"left over")
    ends, ran = done.run()
    assert (ends[0].problem, ran) == (None, {"ingest-1"})
    assert not (place / "7.renumbered").exists()


def film_of_images(archive: Any, jpeg: Path) -> Path:
    folder = Path(archive.scan / "images")
    folder.mkdir()
    for number in range(3):
        shutil.copy(jpeg, folder / f"{number}.jpg")
    document = archive.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cam1.avi", "images"))
    return folder


@pytest.fixture
def jpeg(done: Any, archive: Any) -> Path:
    """A frame, outside the archive."""
    place = archive.root / "frame.jpg"
    place.write_bytes(frame_bytes(done.scan / "frames.zarr/cam1", 3))
    return Path(place)


def test_an_image_that_is_a_link_out_of_the_archive_is_refused(archive: Any, jpeg: Path) -> None:
    folder = film_of_images(archive, jpeg)
    read_scan(archive.scan, archive.root / "archive")
    (folder / "1.jpg").unlink()
    (folder / "1.jpg").symlink_to(jpeg)
    with pytest.raises(RefusedInput, match=r"file of camera 1: 'P0001/S1/images/1\.jpg': '1\.jpg' leaves the archive"):
        read_scan(archive.scan, archive.root / "archive")


def test_an_image_that_is_a_link_inside_is_followed(archive: Any, jpeg: Path) -> None:
    folder = film_of_images(archive, jpeg)
    shutil.copy(jpeg, archive.root / "archive/blank.jpg")
    (folder / "1.jpg").unlink()
    (folder / "1.jpg").symlink_to("../../../blank.jpg")
    scan = read_scan(archive.scan, archive.root / "archive")
    assert scan.film(scan.document.cameras[0]) == folder.resolve()


def test_a_circle_of_links_among_the_images_is_refused(archive: Any, jpeg: Path) -> None:
    folder = film_of_images(archive, jpeg)
    (folder / "3.jpg").symlink_to("3.jpg")
    with pytest.raises(RefusedInput, match="leads nowhere"):
        read_scan(archive.scan, archive.root / "archive")

"""The page of an archive is written only if its content changes, even if files are missing."""

import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.archive.page import FILES, PAGE, write_archive_page
from pipelines.archive.running import ScanEnd
from schemas.base.errors import Fault


@pytest.fixture
def ends(done: Any) -> list[ScanEnd]:
    scans, _ = done.run()
    return [*scans, ScanEnd(str(done.scan), done.scan, None, "scan.yaml: line 2, expected a side", "refused")]


def rows(folder: Path) -> list[str]:
    return re.findall("<tr data.*?</tr>", (folder / PAGE).read_text(), re.DOTALL)


def test_a_row_leads_to_its_scan_and_shows_it(ends: list[ScanEnd], done: Any) -> None:
    results = done.root / "results"
    write_archive_page(ends, results)
    refused, good = rows(results)
    assert 'href="P0001/S1/report.html"' in good
    assert (results / "P0001/S1/report.html").is_file()
    assert 'data-side="right"' in good
    [picture] = re.findall('img src="([^"]+)"', good)
    assert (results / picture).read_bytes().startswith(b"\x89PNG")
    assert "expected a side" in refused
    assert "href" not in refused


def test_what_it_shows_already_is_not_written_again(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_archive_page(ends, tmp_path)
    [picture] = (tmp_path / FILES).iterdir()
    for file in (tmp_path / PAGE, picture):
        os.utime(file, (0, 0))
    write_archive_page([replace(end, was_cached=not end.was_cached) for end in ends], tmp_path)
    assert (tmp_path / PAGE).stat().st_mtime == 0
    write_archive_page(ends[:1], tmp_path)
    assert len(rows(tmp_path)) == 1
    assert picture.stat().st_mtime == 0, "a picture that is there is not drawn again"


def test_a_thumbnail_that_no_scan_has_any_more_goes(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_archive_page(ends, tmp_path)
    assert len(list((tmp_path / FILES).iterdir())) == 1
    write_archive_page(ends[1:], tmp_path)
    assert list((tmp_path / FILES).iterdir()) == []


@pytest.mark.parametrize("spoilt", ["measures.json", "quality.json", "foot.ply"])
@pytest.mark.parametrize("how", ["gone", "torn"])
def test_a_scan_of_which_a_file_is_lost_keeps_its_row(
    ends: list[ScanEnd], done: Any, tmp_path: Path, spoilt: str, how: str
) -> None:
    moved = Path(shutil.copytree(done.results, tmp_path / "moved"))
    (moved / spoilt).unlink()
    if how == "torn":
        (moved / spoilt).write_bytes(b'{"format": ')
    write_archive_page([replace(ends[0], folder=moved), ends[1]], tmp_path)
    _, row = rows(tmp_path)
    assert 'data-scan="S1"' in row
    assert "<img" not in row


def test_a_run_of_the_whole_archive_writes_it(done: Any) -> None:
    from pipelines.cli.main import run_command

    assert run_command(["run", str(done.workflow)]) == 0
    page = done.root / "results" / PAGE
    assert len(rows(page.parent)) == 1
    page.write_text("<!-- 0 -->")
    assert run_command(["run", str(done.workflow)]) == 0
    assert len(rows(page.parent)) == 1


def test_a_folder_that_cannot_be_written_is_a_fault(ends: list[ScanEnd], tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(Fault, match="cannot be written"):
        write_archive_page(ends[1:], tmp_path / "taken")


def test_no_scan_is_an_empty_page(tmp_path: Path) -> None:
    write_archive_page([], tmp_path)
    assert rows(tmp_path) == []

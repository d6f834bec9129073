"""`footscan thesis` refuses what it cannot write to, before it films anything."""

from pathlib import Path

import pytest

from pipelines.cli.main import run_command


def test_a_folder_that_is_a_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis").write_text("mine")

    assert run_command(["thesis", "--folder", str(tmp_path / "thesis")]) == 2

    assert capsys.readouterr().err.endswith("--folder: is a file, expected a folder for films, results and the page\n")
    assert (tmp_path / "thesis").read_text() == "mine"

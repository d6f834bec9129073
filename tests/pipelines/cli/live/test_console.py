"""`footscan console`, as far as it ends before a scanner is opened."""

from pathlib import Path

import pytest

from pipelines.cli.main import run_command


def test_without_a_token_only_this_computer_reaches_the_scanner(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.yaml"
    assert run_command(["console", "--host", "0.0.0.0", "--no-token", "--rig", str(rig)]) == 2
    said = capsys.readouterr().err
    assert "--no-token: leaves the scanner open to the network, expected it with loopback alone" in said
    assert said.count("\n") == 1

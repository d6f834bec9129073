"""The suite in its small form: the code as it is measures the coarse virtual foot as the accepted baseline says."""

import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_nothing_is_worse_than_accepted(
    footscan: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    done = footscan("regress", ROOT / "regression/small.yaml", "--out", tmp_path, "--junit", tmp_path / "junit.xml")
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert 'failures="0"' in (tmp_path / "junit.xml").read_text(encoding="utf-8")

"""The page that shows which step of a run ran when and where."""

import re
from pathlib import Path
from typing import Any

import pytest

from pipelines.archive.profile import Profile, profile_page
from pipelines.cli.archive.run import run
from pipelines.engine.actions.step import Output, Step, Success
from pipelines.engine.pool import StepEnd
from schemas.base.errors import RefusedInput


def ended(kind: str, started: float, seconds: float, worker: str, *after: str) -> StepEnd:
    step = Step("P1/S1", kind, "pipelines.steps.ingest", None, {name: Output(f"P1/S1/{name}") for name in after})
    return StepEnd(step, Success("0"), True, seconds, started=started, worker=worker)


def test_bars_stand_where_and_as_long_as_the_steps_ran() -> None:
    page = profile_page([ended("b", 104.0, 1.0, "two", "a"), ended("a", 101.0, 2.0, "one")])
    assert "4.00 s" in page
    assert "38 %" in page  # 3 of 2 x 4 seconds
    bars = [(float(x), float(width)) for x, width in re.findall(r'<rect x="([^"]+)"[^>]*width="([^"]+)"', page)]
    assert bars[:2] == [(130.0, 435.0), (782.5, 217.5)]
    assert bars[2:] == bars[:2]  # the second chart
    assert 'd="M565.0 27.0H782.5"' in page  # b waited from the end of a to its start


def test_names_are_escaped_and_a_run_without_steps_has_a_page() -> None:
    assert "<script>alert" not in profile_page([ended("<script>alert(1)", 1.0, 1.0, "one")])
    assert "No step ran" in profile_page([])


def test_cached_steps_are_left_out() -> None:
    profile = Profile()
    profile.on_step_end(StepEnd(ended("a", 1.0, 1.0, "one").step, Success("0"), False, 0.1, started=1.0))
    assert profile.ends == []


def test_the_command_writes_it(archive: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "profile.html"
    assert run(archive.workflow, profile=[str(page)]) == 0
    text = page.read_text()
    assert all(f">{name}</text>" in text for name in ("ingest-1", "extract-1", "surface", "measure", "report"))
    capsys.readouterr()


@pytest.mark.parametrize(
    ("place", "watch"), [("folder.html", False), ("missing/profile.html", False), ("profile.html", True)]
)
def test_what_cannot_be_written_is_refused_before_anything_runs(
    archive: Any, tmp_path: Path, place: str, watch: bool
) -> None:
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(RefusedInput, match="--profile"):
        run(archive.workflow, profile=[str(tmp_path / place)], watch=watch)
    assert not archive.results.exists()

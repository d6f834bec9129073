"""The conversation of `footscan calibrate film` and `morning`, on a stand-in that shows frames of a capture."""

import io
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from standing_scanner import StandingStandIn

from pipelines.cli.calibrate import film
from pipelines.cli.main import run_command
from pipelines.live.calibrating.guide import Guide
from pipelines.live.calibrating.settings import GuideSettings
from pipelines.live.rig_file import read_rig, write_rig
from pipelines.recordings.captures import read_capture

Talk = Callable[..., tuple[int, str, str]]


@pytest.fixture
def glass(filmed_capture: Path) -> StandingStandIn:
    return StandingStandIn(filmed_capture)


@pytest.fixture
def talk(
    glass: StandingStandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Talk:
    """Status and output of a command, whose input are these lines."""
    write_rig(tmp_path / "rig.yaml", glass.rig)

    @contextmanager
    def guide(*_: Any, **__: Any) -> Iterator[Guide]:
        settings = GuideSettings(tmp_path / "captures", tmp_path / "rig.yaml", glass.capture.reference)
        yield Guide(glass, settings, glass.put)

    def run(*arguments: str, lines: tuple[str, ...] = ()) -> tuple[int, str, str]:
        monkeypatch.setattr(film.sys, "stdin", io.StringIO("".join(f"{line}\n" for line in lines)))
        capsys.readouterr()
        status = run_command(["calibrate", *arguments])
        said = capsys.readouterr()
        return status, said.out, said.err

    monkeypatch.setattr(film, "_guide", guide)
    return run


def test_without_questions_a_scanner_is_calibrated_and_checked(talk: Talk, tmp_path: Path) -> None:
    status, out, err = talk("film", "--yes", "--json")
    assert status == 0, err
    told = json.loads(out)
    assert (told["step"], told["taken"]) == ("used", [0, 1, 2])
    assert Path(told["outcome"]["file"]) == Path(read_rig(tmp_path / "rig.yaml").calibration or "")
    assert len(read_capture(Path(told["capture"])).reference.placements_mm) == 3
    assert "Placement 3 is good." in err
    assert (Path(told["capture"]) / "coverage.svg").read_text().startswith("<svg ")
    status, out, err = talk("morning", "--yes", "--json")
    assert (status, json.loads(out)["outcome"]["is_well"]) == (0, True), err


def test_without_questions_a_wrong_placement_ends_with_status_1(talk: Talk, glass: StandingStandIn) -> None:
    glass.covered = {5}
    status, _, err = talk("film", "--yes")
    assert status == 1
    assert "! no stripe in camera 5" in err


def test_a_conversation_that_is_left_and_gone_on_with(talk: Talk, tmp_path: Path) -> None:
    status, _, err = talk("film", lines=("x", "", "", "2", "7", "q"))
    assert status == 1
    assert "'x': expected one of the keys above" in err
    assert "Placement 2 of 3" in err
    assert "footscan: placement: expected 1 to 3, found 7" in err
    status, _, err = talk("film", lines=("", "", "", "", "", "", "f", "u", "q"))
    assert status == 0, err
    assert "An interrupted session of" in err
    assert read_rig(tmp_path / "rig.yaml").calibration is not None
    assert len(list((tmp_path / "captures").iterdir())) == 1


def test_the_end_of_the_input_keeps_what_is_filmed(talk: Talk, tmp_path: Path) -> None:
    assert talk("film", lines=("", ""))[0] == 1
    [session] = (tmp_path / "captures").iterdir()
    assert len(list((session / "cam1").iterdir())) == 1
    assert talk("film", lines=("d",))[0] == 1
    assert list((tmp_path / "captures").iterdir()) == []


def test_a_check_without_a_calibration_is_refused(talk: Talk) -> None:
    status, _, err = talk("morning", "--yes")
    assert status == 2
    assert "calibration: names none that could be checked" in err

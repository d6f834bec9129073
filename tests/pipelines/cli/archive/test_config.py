"""`footscan config`: every mistake has its place and a sentence that helps; every value says where it is from."""

import json
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.main import run_command

RIGHT = """\
format: footscan.workflow/1
archive: archive
results: results
workers: 2
parameters:
  extraction:
    red_threshold: 20
    centre_method: gravity
    ridge_px: 2.5
  outliers:
    z_mm: [-1, 100]
  surface:
    method: closed
"""

MISTAKES = [
    # original text, replacement, line and column, expected message
    ("format: footscan.workflow/1", "format: footscan.workflow/9", 1, 9, "footscan.workflow/1"),
    ("format: footscan.workflow/1", "", 2, 1, "format: is missing"),
    ("format:", "fromat:", 1, 1, "did you mean 'format'?"),
    ("archive: archive", "archive: ''", 2, 10, "at least 1 character"),
    ("archive: archive", "archive: nowhere", 2, 10, "no such folder"),
    ("archive: archive", "archiv: archive", 2, 1, "did you mean 'archive'?"),
    ("archive: archive", "archive: {a: b}", 2, 1, "valid list"),
    ("archive: archive", "archive: [archive, b]", 2, 20, "archive.1: no such folder"),
    ("archive: archive", "archive: archive\ncalibration: no.json", 3, 14, "no such file"),
    ("archive: archive", "archive: archive\ncalibrations: [{file: no.json}]", 3, 23, "no such file"),
    ("archive: archive", "archive: archive\ncalibrations: [{file: a, since: May}]", 3, 33, "valid date"),
    ("results: results", "", 1, 1, "results: is missing"),
    ("results: results", "results:", 3, 9, "valid string"),
    ("workers: 2", "workers: 0", 4, 10, "greater than or equal to 1, found '0'"),
    ("workers: 2", "workers: 257", 4, 10, "less than or equal to 256"),
    ("workers: 2", "workers: two", 4, 10, "valid integer"),
    ("workers: 2", "workers: 2.5", 4, 10, "valid integer"),
    ("workers: 2", "worker: 2", 4, 1, "did you mean 'workers'?"),
    ("workers: 2", "red_threshold: 20", 4, 1, "did you mean 'parameters.extraction.red_threshold'?"),
    ("workers: 2", "cache: ''", 4, 8, "expected a folder or a URL"),
    ("parameters:", "parameter:", 5, 1, "did you mean 'parameters'?"),
    ("  extraction:", "  extracton:", 6, 3, "did you mean 'extraction'?"),
    ("red_threshold: 20", "red_treshold: 20", 7, 5, "did you mean 'red_threshold'?"),
    ("red_threshold: 20", "red_threshold: 255", 7, 20, "less than or equal to 254, found '255'"),
    ("red_threshold: 20", "red_threshold: 20px", 7, 20, "a number stands without a unit"),
    ("red_threshold: 20", "red_threshold: [20]", 7, 20, "valid integer"),
    ("red_threshold: 20", "faintest_contrast: 13", 6, 3, "at most smallest_contrast"),
    ("centre_method: gravity", "centre_method: gravty", 8, 20, "did you mean 'gravity'?"),
    ("ridge_px: 2.5", "ridge_px: 2,5", 9, 15, "the decimal mark is a point"),
    ("ridge_px: 2.5", "ridge_px: nan", 9, 15, "finite number"),
    ("z_mm: [-1, 100]", "z_mm: [100, -1]", 10, 3, "z_mm"),
    ("z_mm: [-1, 100]", "z_mm: [-1, high]", 11, 16, "valid number"),
    ("z_mm: [-1, 100]", "z_mm: -1", 11, 11, "z_mm"),
    ("method: closed", "method: close", 13, 13, "did you mean 'closed'?"),
    ("method: closed", "extraction: 1", 13, 5, "unknown field"),
]
NO_YAML = [
    ("workers: 2", "\tworkers: 2", "line 4, column 1"),
    ("workers: 2", "workers: 2\nworkers: 3", "line 5, column 1: 'workers' is listed twice"),
    ("z_mm: [-1, 100]", "z_mm: [-1, 100", "line 12, column 10"),
    ("ridge_px: 2.5", "ridge_px: *same", "line 9, column 15: alias 'same'"),
]


@pytest.fixture
def workflow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "archive").mkdir()
    path = Path("workflow.yaml")
    path.write_text(RIGHT)
    return path


def checked(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    assert run_command(["config", "check", "--json"]) == 2
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.parametrize(("right", "wrong", "line", "column", "expected"), MISTAKES)
def test_a_mistake_has_its_place(
    workflow: Path, capsys: pytest.CaptureFixture[str], right: str, wrong: str, line: int, column: int, expected: str
) -> None:
    assert RIGHT.count(right) == 1
    workflow.write_text(RIGHT.replace(right, wrong))
    found = checked(capsys)
    place = next(mistake for mistake in found if expected in f"{mistake['field']}: {mistake['problem']}")
    assert (place["line"], place["column"]) == (line, column)


@pytest.mark.parametrize(("right", "wrong", "expected"), NO_YAML)
def test_a_text_that_is_no_yaml(
    workflow: Path, capsys: pytest.CaptureFixture[str], right: str, wrong: str, expected: str
) -> None:
    workflow.write_text(RIGHT.replace(right, wrong))
    assert run_command(["config", "check"]) == 2
    assert f"workflow.yaml: {expected}" in capsys.readouterr().err


def test_all_mistakes_are_told_in_the_order_of_the_file(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = RIGHT.replace("workers: 2", "worker: 2").replace("gravity", "gravty").replace("ridge_px: 2.5", "ridge: 2.5")
    workflow.write_text(text)
    assert run_command(["config", "check"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" ")[0] for line in lines] == ["workflow.yaml:4:1:", "workflow.yaml:8:20:", "workflow.yaml:9:5:"]


@pytest.mark.parametrize("command", [("run",), ("run", "--watch"), ("plan",), ("tune",), ("config", "show")])
def test_every_command_tells_all_mistakes_at_once(
    workflow: Path, capsys: pytest.CaptureFixture[str], command: tuple[str, ...]
) -> None:
    text = RIGHT.replace("workers: 2", "worker: 2").replace("gravity", "gravty").replace("ridge_px: 2.5", "ridge: 2.5")
    workflow.write_text(text)
    assert run_command([*command]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "footscan: workflow.yaml: worker: unknown field, did you mean 'workers'? (line 4, column 1)",
        "footscan: workflow.yaml: parameters.extraction.centre_method: input should be 'threshold-median', 'gravity', "
        "'gaussian', 'ridge' or 'fir', found 'gravty', did you mean 'gravity'? (line 8, column 20)",
        "footscan: workflow.yaml: parameters.extraction.ridge: unknown field, did you mean 'ridge_px'? "
        "(line 9, column 5)",
        "footscan: workflow.yaml: 3 mistakes, see 'footscan config check workflow.yaml'",
    ]


def test_all_that_is_not_there_is_told_with_a_missing_archive(
    workflow: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    workflow.write_text(RIGHT.replace("archive: archive", "archive: [archive, a, b]\ncalibration: no.json"))
    assert run_command(["run"]) == 2
    lines = [line.removeprefix("footscan: workflow.yaml: ") for line in capsys.readouterr().err.splitlines()]
    assert [line.partition(":")[0] for line in lines] == [
        "archive.1", "archive.2", "calibration", "3 mistakes, see 'footscan config check workflow.yaml'"
    ]  # fmt: skip
    assert lines[2].endswith("found 'no.json' (line 3, column 14)")


@pytest.mark.usefixtures("workflow")
def test_nothing_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["config", "check"]) == 0
    assert capsys.readouterr().out == "workflow.yaml: nothing is wrong\n"


@pytest.mark.usefixtures("workflow")
def test_every_value_says_where_it_is_from(capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["--set", "extraction.gap_px=4.5", "--set", "outliers.z_mm=[-2, 90]"]
    assert run_command(["config", "show", "--json", *settings]) == 0
    values = {value["name"]: (value["value"], value["from"]) for value in json.loads(capsys.readouterr().out)}
    assert values["archive"] == (["archive"], "workflow.yaml:2")
    assert values["cache"] == (None, "default")
    assert values["parameters.extraction.red_threshold"] == (20, "workflow.yaml:7")
    assert values["parameters.extraction.saturation"] == (245, "default")
    assert values["parameters.extraction.gap_px"] == (4.5, "--set")
    assert values["parameters.outliers.z_mm"] == ([-2, 90], "--set")
    assert values["parameters.surface.method"] == ("closed", "workflow.yaml:13")


@pytest.mark.usefixtures("workflow")
@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("extraction.red_treshold=3", "--set: extraction.red_treshold: unknown field, did you mean 'red_threshold'?"),
        ("extracton.red_threshold=3", "--set: extracton: unknown field, did you mean 'extraction'?"),
        ("extraction.red_threshold=", "--set: extraction.red_threshold: input should be a valid integer"),
        ("red_threshold=3", "--set: red_threshold: unknown field, did you mean 'extraction.red_threshold'?"),
        ("extraction.red_threshold.x=3", "--set: extraction.red_threshold.x: red_threshold holds no parameters"),
        ("outliers.z_mm=[1", "--set: outliers.z_mm: line 1, column 3"),
        ("extraction", "--set: expected NAME=VALUE, found 'extraction'"),
    ],
)
def test_wrong_settings(capsys: pytest.CaptureFixture[str], setting: str, expected: str) -> None:
    assert run_command(["config", "show", "--set", setting]) == 2
    assert expected in capsys.readouterr().err


def test_a_profile_is_an_origin(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile = "profiles: {night: {parameters: {extraction: {gap_px: 4.5}, surface: {grid_steps: 0.7}}}}"
    workflow.write_text(f"{RIGHT}{profile}\n")
    asked = ["config", "show", "--json", "--profile", "night", "--set", "surface.grid_steps=0.8"]
    assert run_command(asked) == 0
    values = {value["name"]: (value["value"], value["from"]) for value in json.loads(capsys.readouterr().out)}
    assert values["parameters.extraction.gap_px"] == (4.5, "profile night")
    assert values["parameters.surface.grid_steps"] == (0.8, "--set")
    assert values["parameters.extraction.red_threshold"][1] == "workflow.yaml:7"

"""`footscan regress`: exit statuses, what is printed and what is written."""

import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from pipelines.cli.main import run_command
from pipelines.regression.history import append
from pipelines.regression.report.junit import junit_xml
from schemas.base.yaml_files import read_yaml
from schemas.regression import NightEnded, Suite

Regress = Callable[..., tuple[int, str, list[str]]]
ROOT = Path(__file__).parents[3]
SUITE = """\
format: footscan.suite/1
timed_passes: 0
sets:
  foot: {scan: archive/P0001/S1, calibration: calibration.json}
"""


@pytest.fixture
def regress(capsys: pytest.CaptureFixture[str]) -> Regress:
    """Exit status, standard output and the lines of standard error of `footscan regress ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["regress", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err.splitlines()

    return run


@pytest.fixture(scope="module")
def accepted(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("accepted") / "home"
    shutil.copytree(pristine, root)
    (root / "suite.yaml").write_text(SUITE)
    assert run_command(["regress", str(root / "suite.yaml"), "--accept", "first", "--by", "ann"]) == 0
    return root


@pytest.fixture
def root(accepted: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(accepted, tmp_path / "home"))


def test_same_worse_and_accepted(root: Path, regress: Regress) -> None:
    suite = root / "suite.yaml"
    status, printed, told = regress(suite)
    assert (status, printed) == (0, f"Report: {root}/nights/index.html\n")
    assert [line.split(":")[0] for line in told] == ["foot"]

    suite.write_text(
        SUITE.replace("calibration.json", "calibration.json, parameters: {extraction: {red_threshold: 60}}")
    )
    junit = root / "junit.xml"
    status, printed, told = regress(suite, "--junit", junit)
    assert status == 1
    assert "foot: first extract-1, extract-5: its result differs (parameter red_threshold changed: 18 → 60)" in printed
    xml = ET.parse(junit).getroot()
    assert int(xml.get("failures", "0")) == len(xml.findall(".//failure")) > 0
    assert xml.find(".//testcase[@name='points.stripe']/failure") is not None

    assert regress(suite, "--accept", "a threshold of 60 is better", "--by", "bob")[0] == 0
    assert 'reason: "a threshold of 60 is better"' in (root / "baseline.yaml").read_text()
    found = json.loads(regress(suite, "--json")[1])
    assert (found["status"], found["sets"][0]["first"]) == (0, [])
    assert {figure["verdict"] for figure in found["sets"][0]["figures"]} == {"same"}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--accept", ""), "--accept: expected why the new figures are right, found nothing"),
        (("--accept", " \n"), "--accept: expected why the new figures are right, found nothing"),
        (("--by", "ann"), "--by: goes with --accept"),
        (("--check-last", "soon"), "--check-last: expected an age such as 26h, 90m or 2d, found 'soon'"),
        (("--check-last", "1h", "--accept", "x"), "--check-last: runs nothing"),
    ],
)
def test_wrong_use(root: Path, regress: Regress, arguments: tuple[str, ...], told: str) -> None:
    before = (root / "baseline.yaml").read_bytes()
    status, printed, lines = regress(root / "suite.yaml", *arguments)
    assert (status, printed, len(lines)) == (2, "", 1)
    assert lines[0].startswith(f"footscan: {told}")
    assert (root / "baseline.yaml").read_bytes() == before


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("format: footscan.suite/1\n", "expected sets, worlds or both"),
        (SUITE.replace("scan:", "scn:"), "sets.foot.scn: unknown field, did you mean 'scan'? (line 4, column 10)"),
        (SUITE.replace("timed_passes: 0", "tolerances: {'time.*': lots}"), "tolerances.time.*"),
        (SUITE.replace("scan: archive/P0001/S1, ", ""), "sets.foot: expected either scan or virtual"),
    ],
)
def test_a_suite_that_breaks_its_format(tmp_path: Path, regress: Regress, text: str, told: str) -> None:
    (tmp_path / "suite.yaml").write_text(text)
    status, printed, lines = regress(tmp_path / "suite.yaml")
    assert (status, printed, len(lines)) == (2, "", 1)
    assert told in lines[0]


def test_a_night_that_did_not_run(root: Path, regress: Regress) -> None:
    suite, page = root / "suite.yaml", root / "nights/index.html"
    status, printed, told = regress(suite, "--check-last", "1h")
    assert (status, printed, told) == (0, "the last night ended 0.0 h ago, with status 0\n", [])
    assert json.loads(regress(suite, "--check-last", "1h", "--json")[1])["fresh"] is True

    history = root / "nights/history.jsonl"
    history.unlink()
    append(root / "nights", NightEnded(night="1", time=datetime.now(UTC) - timedelta(hours=30), status=0, sets={}))
    status, printed, _ = regress(suite, "--check-last", "26h")
    assert (status, printed) == (1, "the last night ended 30.0 h ago, expected one within 26.0 h\n")
    assert page.read_text().count("the last night ended 30.0 h ago") == 1
    regress(suite, "--check-last", "1d")
    assert page.read_text().count("the last night ended 30.0 h ago") == 1
    assert regress(suite)[0] == 0
    assert "30.0 h ago" not in page.read_text()


def test_the_line_of_a_crontab(root: Path) -> None:
    line = f"cd {root} && {sys.executable} -m pipelines.cli regress suite.yaml --junit night.xml >> nights.log 2>&1"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    assert subprocess.run(["sh", "-c", line], env=environment, check=False).returncode == 0
    assert (root / "nights.log").read_text().endswith(f"Report: {root}/nights/index.html\n")
    check = f"cd {root} && {sys.executable} -m pipelines.cli regress suite.yaml --check-last 26h"
    assert subprocess.run(["sh", "-c", check], env=environment, check=False, capture_output=True).returncode == 0


@pytest.mark.parametrize("name", ["suite.yaml", "small.yaml"])
def test_the_suites_of_the_project_keep_their_format(name: str) -> None:
    suite = read_yaml(ROOT / "regression" / name, Suite)
    assert all(data_set.virtual is not None for data_set in suite.sets.values())
    assert name != "suite.yaml" or any(one.virtual and one.virtual.laser_off for one in suite.sets.values())


def test_names_are_data_in_the_xml() -> None:
    from pipelines.regression.report.result import JudgedFigure, JudgedSet, NightResult

    figure = JudgedFigure("a<b", None, 1.0, 0.0, "less", None, "missing")
    sets = [JudgedSet("<set>", "broken & \x00 bent", [figure])]
    xml = junit_xml(NightResult("s", datetime(2026, 11, 20, tzinfo=UTC), "footscan", sets, [], []))
    root = ET.fromstring(xml)
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("2", "1", "1")
    assert [case.get("name") for case in root.iter("testcase")] == ["run", "a<b"]

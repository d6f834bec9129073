"""`footscan sizes`, `footscan pair`, `footscan change` and `footscan lasts`: what they print and refuse."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pipelines.cli.main import run_command

Run = Callable[..., tuple[int, str, list[str]]]
RIGHT = {"foot_length": 270.0, "foot_breadth": 100.0, "ball_length": 199.8, "ball_girth": 255.0, "instep_girth": 258.0}
LEFT = RIGHT | {"foot_length": 266.0, "ball_girth": 261.0}
LASTS = """\
last,length_mm,ball_girth_mm,instep_girth_mm
good,282,257,255
tight,282,240,255
wide,283,265,255
"""


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Exit status, standard output and the lines of standard error of `footscan ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return status, said.out, said.err.splitlines()

    return run


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Both feet of a patient, the right one twice; another patient's left foot; a surface that is no foot."""
    for name, side, measures in (
        ("P0001/2026-05-20-R", "right", RIGHT | {"foot_length": 266.0}),
        ("P0001/2026-11-20-R", "right", RIGHT),
        ("P0001/2026-11-20-L", "left", LEFT),
        ("P0002/2026-11-20-L", "left", LEFT),
        ("P0001/block", "unknown", {}),
    ):
        document = {
            "format": "footscan.measures/1",
            "unit": "mm",
            "side": side,
            "measures": {name: {"value": value, "unit": "mm", "status": "ok"} for name, value in measures.items()},
            "finding": None if measures else "it is a block",
        }
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "measures.json").write_text(json.dumps(document))
    (tmp_path / "lasts").mkdir()
    (tmp_path / "lasts/winter.csv").write_text(LASTS)
    return tmp_path


def test_sizes_of_a_foot(run: Run, results: Path) -> None:
    status, out, err = run("sizes", results / "P0001/2026-11-20-R", "--json")
    assert (status, err) == (0, [])
    document = json.loads(out)
    assert document["foot"] | {"source": ""} == {
        "source": "",
        "patient": "P0001",
        "scan": "2026-11-20-R",
        "side": "right",
        "date": "2026-11-20",
    }
    found = {one["system"]: one["size"] for one in document["sizes"]}
    expected = {"mondopoint": "270/100", "eu": "42.5", "uk": "9", "us_men": "10", "us_women": "11.5", "japan": "27"}
    assert expected.items() <= found.items()
    assert {one["system"]: one["width"] for one in document["widths"]}["us"] == "D"
    assert "for reference only" in document["caution"]
    status, out, _ = run("sizes", results / "P0001/2026-11-20-R/measures.json", "--for", "men")
    assert status == 0
    row = next(line for line in out.splitlines() if " US men " in line)
    assert [cell.strip() for cell in row.split("│")[1:5]] == ["US men", "10", "9.89", "0.5, up beyond 0.25"]
    assert "US women" not in out
    assert "reference only" in out


def test_a_surface_that_is_no_foot_has_no_sizes(run: Run, results: Path) -> None:
    status, out, err = run("sizes", results / "P0001/block")
    assert (status, err) == (0, [])
    assert "nothing was measured: it is a block" in out
    assert {one["size"] for one in json.loads(run("sizes", results / "P0001/block", "--json")[1])["sizes"]} == {None}


def test_the_table_can_be_printed_edited_and_used(run: Run, results: Path) -> None:
    status, text, _ = run("sizes", "--show-table")
    assert status == 0
    copy = results / "mine.yaml"
    copy.write_text(text.replace("allowance_mm: 40/3 ", "allowance_mm: 0 "))
    document = json.loads(run("sizes", results / "P0001/2026-11-20-R", "--table", copy, "--json")[1])
    assert {one["system"]: one["size"] for one in document["sizes"]}["eu"] == "40.5"
    assert json.loads(run("sizes", "--show-table", "--table", copy, "--json")[1])["sizes"]["eu"]["allowance_mm"] == 0
    copy.write_text(text.replace("zero: 25 ", "zero: none ").replace("zero: 25\n", "zero: none\n"))
    status, out, [line] = run("sizes", results / "P0001/2026-11-20-R", "--table", copy)
    assert (status, out) == (2, "")
    assert line.startswith(f"footscan: {copy}: sizes.uk.zero: ")


def test_a_pair(run: Run, results: Path) -> None:
    left, right = results / "P0001/2026-11-20-L", results / "P0001/2026-11-20-R"
    status, out, err = run("pair", left, right, "--json")
    assert (status, err) == (0, [])
    document = json.loads(out)
    assert (document["decided_by"]["foot_length"], document["decided_by"]["ball_girth"]) == ("right", "left")
    assert document["rows"][0]["difference"] == 4.0
    assert document["notes"] == []
    assert {one["system"]: one["width"] for one in document["sizes"]["widths"]}["japan_men"] == "EE"
    status, out, _ = run("pair", left, right)
    assert status == 0
    assert "foot_length by the right foot" in out


def test_mixed_up_feet_are_refused(run: Run, results: Path) -> None:
    left, right, other = (results / name for name in ("P0001/2026-11-20-L", "P0001/2026-11-20-R", "P0002/2026-11-20-L"))
    for arguments, said in (
        (("pair", right, left), f"{right}: is a right foot, expected the left one first"),
        (("pair", left, other, "--any-patient"), f"{other}: is a left foot, expected a right one"),
        (("pair", left, left), f"{left}: is given twice, expected another measurement"),
        (("change", right, right / "measures.json"), f"{right / 'measures.json'}: is given twice"),
        (("change", right, left), f"{left}: is a left foot, expected a right one as {right} is"),
        (
            ("lasts", left, other, "--any-patient", "--lasts", results / "lasts"),
            f"{other}: expected one foot, or a left and a right",
        ),
    ):
        status, out, [line] = run(*arguments)
        assert (status, out) == (2, "")
        assert line.startswith(f"footscan: {said}")
    status, _, [line] = run("pair", other, right)
    assert (status, line) == (
        2,
        f"footscan: {right}: is of patient P0001, expected P0002 as {other} is (--any-patient takes it all the same)",
    )
    status, out, _ = run("pair", other, right, "--any-patient", "--json")
    assert (status, json.loads(out)["notes"]) == (0, ["of two patients: P0002 and P0001"])


def test_change_over_time(run: Run, results: Path) -> None:
    earlier, later = results / "P0001/2026-05-20-R", results / "P0001/2026-11-20-R"
    status, out, err = run("change", earlier, later, "--json")
    assert (status, err) == (0, [])
    document = json.loads(out)
    assert document["days"] == 184
    rows = {row["measure"]: row for row in document["rows"]}
    assert (rows["foot_length"]["difference"], rows["foot_length"]["significant"]) == (4.0, True)
    assert (rows["ball_girth"]["difference"], rows["ball_girth"]["significant"]) == (0.0, False)
    status, out, _ = run("change", earlier, later)
    assert status == 0
    assert "184 days" in out
    status, _, [line] = run("change", later, earlier)
    assert (status, line) == (2, f"footscan: {later}: is of 2026-11-20, expected the earlier one first (2026-05-20)")


def test_a_patients_folder_stands_for_the_latest_scans(run: Run, results: Path) -> None:
    patient = results / "P0001"
    left, right = patient / "2026-11-20-L", patient / "2026-11-20-R"
    status, out, err = run("pair", patient, "--json")
    assert (status, err) == (0, [f"{patient}: not taken: block"])
    assert out == run("pair", left, right, "--json")[1]
    assert (
        run("lasts", patient, "--lasts", results / "lasts", "--json")[1]
        == (run("lasts", left, right, "--lasts", results / "lasts", "--json")[1])
    )
    status, out, _ = run("change", patient, "--json")
    one = run("change", patient / "2026-05-20-R", right, "--json")[1]
    assert (status, json.loads(out)) == (0, {"changes": [json.loads(one)]})
    status, out, _ = run("change", patient)
    assert (status, "P0001/2026-05-20-R to P0001/2026-11-20-R, 184 days" in out) == (0, True)


def test_a_folder_that_is_no_patients_is_refused(run: Run, results: Path) -> None:
    for arguments, said in (
        (
            ("pair", results / "P0001/2026-11-20-R"),
            "RIGHT: is missing, expected measures.json, or the folder of a scan",
        ),
        (("change", results / "P0001/2026-11-20-R"), "LATER: is missing, expected measures.json, or the folder of a"),
        (("pair", results), "RIGHT: is missing, expected measures.json"),
        (("pair", results / "P0003"), f"{results / 'P0003'}: no such file or folder, expected measures.json"),
        (("pair", results / "P0002"), f"{results / 'P0002'}: has no day with measures of both feet"),
        (("change", results / "P0002"), f"{results / 'P0002'}: has no foot with measures of two days"),
        (("sizes", results / "P0002"), f"{results / 'P0002'}: is the folder of a patient, expected one of its scans:"),
    ):
        status, out, [line] = run(*arguments)
        assert (status, out) == (2, "")
        assert line.startswith(f"footscan: {said}")


def test_measures_that_were_written_by_hand(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "tape.json"
    for reading, found in (("262.7", "262.7"), ("true", "True")):
        file.write_text(f'{{"format": "footscan.measures/1", "measures": {{"foot_length": {reading}}}}}')
        assert run("sizes", file) == (
            2,
            "",
            [f'footscan: {file}: measures.foot_length: expected fields, such as {{"value": 262.7}}, found {found!r}'],
        )


def test_lasts_for_a_foot_and_for_a_pair(run: Run, results: Path) -> None:
    left, right = results / "P0001/2026-11-20-L", results / "P0001/2026-11-20-R"
    status, out, err = run("lasts", right, "--lasts", results / "lasts", "--json")
    assert (status, err) == (0, [])
    document = json.loads(out)
    assert [(one["rank"], one["name"]) for one in document["lasts"]] == [(1, "good"), (2, "wide"), (None, "tight")]
    assert document["lasts"][1]["score"] == 64.0  # 10 mm wider, 2 are allowed
    assert document["missing"] == ["right: no waist_girth was measured", "right: no heel_girth was measured"]
    pair = json.loads(run("lasts", left, right, "--lasts", results / "lasts", "--json")[1])
    assert [one["name"] for one in pair["lasts"]] == ["good", "wide", "tight"]
    assert (pair["lasts"][1]["worse"], pair["lasts"][1]["score"]) == ("right", 64.0)
    comfort = json.loads(
        run("lasts", right, "--lasts", results / "lasts/winter.csv", "--purpose", "comfort", "--json")[1]
    )
    assert comfort["lasts"][1]["score"] == 16.0
    status, out, _ = run("lasts", left, right, "--lasts", results / "lasts", "--most", 1)
    assert status == 0
    assert "good" in out
    assert "wide" not in out
    assert "2 of 3 lasts can be worn; out: 1" in out
    assert "tight: left ball_girth minus the foot's is -21.0 mm, expected at least -12" in out


def test_a_bad_row_of_lasts_is_refused(run: Run, results: Path) -> None:
    table = results / "lasts/winter.csv"
    table.write_text(LASTS.replace("240", "24.0"))
    status, out, lines = run("lasts", results / "P0001/2026-11-20-R", "--lasts", results / "lasts")
    assert (status, out) == (2, "")
    assert lines == [f"footscan: {table}: row 3, column ball_girth_mm: expected mm from 80 to 600, found '24.0'"]
    status, _, lines = run("lasts", results / "P0001/block", "--lasts", results / "lasts")
    assert status == 2
    table.write_text(LASTS)
    status, _, lines = run("lasts", results / "P0001/2026-11-20-R", "--lasts", results / "lasts", "--purpose", "ski")
    assert (status, lines) == (2, ["footscan: purpose: expected one of everyday, dress, comfort, found 'ski'"])


def test_wrong_use_is_told_in_one_line(run: Run, results: Path) -> None:
    assert run("sizes") == (
        2,
        "",
        ["footscan: FOOT: is missing, expected measures.json, or the folder of a scan's results"],
    )
    status, _, [line] = run("sizes", results)
    assert (status, line) == (2, f"footscan: {results / 'measures.json'}: no such file")
    status, _, [line] = run("lasts", results / "P0001/2026-11-20-R")
    assert status == 2
    assert "--lasts" in line


def test_nothing_heavy_is_imported(results: Path) -> None:
    """Neither for the command's start nor for the sizes themselves."""
    script = (
        "import sys; from pipelines.cli.main import run_command; "
        "assert not {'footscan.sizing', 'schemas.sizes'} & sys.modules.keys(); "
        f"assert run_command(['sizes', {str(results / 'P0001/2026-11-20-R')!r}, '--json']) == 0; "
        "heavy = {'numpy', 'scipy', 'numba', 'open3d', 'matplotlib'} & sys.modules.keys(); assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", script], check=True, stdout=subprocess.DEVNULL)

"""Landmarks and choices that a person made beside a scan are inputs of its steps, and outlast a change of the rest."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from footscan.mesh.formats.files import read_file
from pipelines.cli.main import run_command

MEASURED = {"measure", "sizes.json", "quality.json", "report"}


def measures(archive: Any) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((archive.results / "measures.json").read_bytes())
    return document


def place(document: dict[str, Any], name: str) -> list[float]:
    """A landmark of measures.json, mm, in the frame of the mesh."""
    point: list[float] = document["landmarks"][name]["point"]
    return list(point)


def set_landmark(archive: Any, point: list[float], **more: Any) -> Path:
    file: Path = archive.scan / "landmarks.yaml"
    placed = {"instep_point": [round(one, 3) for one in point]}
    file.write_text(yaml.safe_dump({"format": "footscan.landmarks/1", "landmarks": placed, **more}))
    return file


def choose(archive: Any, **choices: Any) -> Path:
    file: Path = archive.scan / "choices.yaml"
    file.write_text(yaml.safe_dump({"format": "footscan.choices/1", **choices}))
    return file


def test_a_landmark_holds(done: Any, capsys: pytest.CaptureFixture[str]) -> None:
    before = measures(done)
    point = place(before, "instep_point")
    point[0] += 8.0
    vertices = read_file(done.results / "foot.ply").vertices
    point = vertices[((vertices - point) ** 2).sum(axis=1).argmin()].tolist()
    file = set_landmark(done, point)
    assert done.plan()[1]["measure"] == "input landmarks changed"
    assert run_command(["why", "P0001/S1", "measure", "--workflow", str(done.workflow)]) == 0
    assert "instep_point" in capsys.readouterr().out
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, MEASURED)
    after = measures(done)
    assert after["landmarks"]["instep_point"]["method"] == "manual"
    changed = {name for name, one in after["measures"].items() if one != before["measures"][name]}
    uses_it = {name for name, one in after["measures"].items() if "instep point" in one["definition"]}
    assert {"instep_length", "instep_girth_min"} <= changed <= uses_it
    assert run_command(["trace", str(done.results / "measures.json"), "--json"]) == 0
    assert str(file) in capsys.readouterr().out

    done.set_parameters("{surface: {grid_steps: 0.7}}")
    [scan], _ = done.run()
    again = measures(done)
    assert (scan.problem, again["landmarks"]["instep_point"]["method"]) == (None, "manual")
    assert place(again, "instep_point") == pytest.approx(point, abs=1e-3)


def test_who_and_when_change_no_measure(done: Any) -> None:
    point = place(measures(done), "instep_point")
    set_landmark(done, point)
    done.run()
    set_landmark(done, point, decided={"instep_point": {"by": "dr-k", "at": "2026-11-27T10:00:00Z"}})
    assert done.plan()[1] == {}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("format: footscan.landmarks/1\nlandmarks: {toe_9_tip: [1, 2, 3]}\n", "landmarks.toe_9_tip: unknown field"),
        (
            "format: footscan.landmarks/1\nlandmarks: {pternion: [0, 0, 900]}\n",
            "mm from the surface, expected a point of it in mm",
        ),
    ],
)
def test_a_wrong_landmark_is_refused(done: Any, text: str, problem: str) -> None:
    (done.scan / "landmarks.yaml").write_text(text)
    [scan], _ = done.run()
    assert (scan.kind, problem in scan.problem, "landmarks.yaml" in scan.problem) == ("refused", True, True)


def test_choices_reach_measures_sizes_exports_and_report(done: Any) -> None:
    choose(
        done, axis="brannock", posture="standing", people="women", systems=["eu", "uk"], exports=["obj", "glb"],
        notes="Bunion on the right.\nSee <last year>.",
    )  # fmt: skip
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {*MEASURED, "foot.obj", "foot.glb"})
    assert (measures(done)["axis"], measures(done)["posture"]) == ("brannock", "standing")
    sizes = json.loads((done.results / "sizes.json").read_bytes())
    assert {one["system"] for one in sizes["sizes"]} == {"eu", "uk"}
    assert read_file(done.results / "foot.obj").vertices.shape == read_file(done.results / "foot.ply").vertices.shape
    report = (done.results / "report.html").read_text()
    assert "Bunion on the right." in report
    assert "See &lt;last year&gt;." in report
    assert scan.digests.keys() >= {"foot.obj", "foot.glb", "sizes.json"}
    choose(done)
    [scan], ran = done.run()
    assert ran == set()  # the results without choices are still known
    assert measures(done)["axis"] != "brannock"


def test_exports_of_a_workflow(done: Any) -> None:
    done.workflow.write_text(f"{done.workflow.read_text()}exports: [3mf]\n")
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {"foot.3mf"})
    assert (done.results / "foot.3mf").read_bytes()[:2] == b"PK"


def test_a_table_of_sizes_of_ones_own(done: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["sizes", "--show-table"]) == 0
    table = capsys.readouterr().out
    (done.root / "sizes.yaml").write_text(table)
    done.workflow.write_text(f"{done.workflow.read_text()}size_table: sizes.yaml\n")
    assert done.plan()[1] == {}
    (done.root / "sizes.yaml").write_text(table.replace("label: EU", "label: Europe", 1))
    assert set(done.plan()[1]) == {"sizes.json", "report"}

"""The public interface for scripts: its arrays are those of a run, and the examples of its page run."""

import doctest
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checked import made_check

import footscan
from footscan.mesh.formats.files import read_file
from pipelines.archive.table import write_results_table
from pipelines.calibration_check import store_check
from schemas.base.errors import Finding, RefusedInput
from schemas.measures import Measures

PAGE = Path(__file__).parents[2] / "docs/python.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_arrays_are_those_of_a_run(done: Any) -> None:
    scan = footscan.open_scan(done.scan, done.root / "calibration.json")
    cloud = read_file(done.results / "cloud.ply").vertices
    found = np.column_stack([scan.cloud[axis] for axis in "xyz"])
    assert np.array_equal(np.float32(found), np.float32(cloud))
    surface = read_file(done.results / "foot.ply")
    assert np.array_equal(np.float32(scan.mesh.vertices), np.float32(surface.vertices))
    assert np.array_equal(scan.mesh.faces, surface.faces)
    delivered = Measures.model_validate_json((done.results / "measures.json").read_bytes())
    if delivered.finding is None:
        assert scan.measures == delivered
    else:
        with pytest.raises(Finding, match=re.escape(delivered.finding)):
            _ = scan.measures


def test_a_check_of_the_calibration_is_known(done: Any) -> None:
    calibration = done.root / "calibration.json"
    assert footscan.open_scan(done.scan, calibration).calibration_check is None
    store_check(calibration, made_check(calibration, "2026-11-24T08:00:00+01:00", {1: 0.03, 5: 0.41}))
    scan = footscan.open_scan(done.scan, calibration)
    assert scan.calibration_check is not None
    assert scan.measures.doubts == [scan.calibration_check.doubt]
    assert scan.measures.measures["foot_length"].status == "uncertain"
    done.run()
    assert scan.measures == Measures.model_validate_json((done.results / "measures.json").read_bytes())


def test_frames_and_points(done: Any) -> None:
    scan = footscan.open_scan(done.scan, done.root / "calibration.json")
    frames = list(scan.frames(scan.cameras[0]))
    assert {frame.shape for frame in frames if frame is not None} == {(480, 640, 3)}
    assert [len(scan.stripes[camera]) for camera in scan.cameras] == [len(scan.points[c]) for c in scan.cameras]


def test_what_is_not_there_is_refused(done: Any) -> None:
    with pytest.raises(RefusedInput, match=r"calibration: names no calibration, expected one"):
        footscan.open_scan(done.scan)
    scan = footscan.open_scan(done.scan, done.root / "calibration.json")
    with pytest.raises(RefusedInput, match="has no camera 99, expected one of "):
        scan.frames(99)
    with pytest.raises(RefusedInput, match=r"results.parquet: no such file, expected the results of"):
        footscan.results(done.root / "nowhere")


def test_the_page(done: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """On the small archive: its scan instead of the demo's, and the mean foot as the mesh of a scanner."""
    from footscan.mesh.formats.stl import stl_of
    from footscan.mesh.mesh import Mesh
    from footscan.virtual.foot.foot import make_foot

    write_results_table(done.run()[0], done.root / "results")
    monkeypatch.chdir(done.root)
    foot = make_foot(resolution_mm=4.0)
    mesh = Mesh(foot.vertices, foot.faces)
    Path("foot.stl").write_bytes(stl_of(mesh))
    names = {"footscan": footscan}
    for example in EXAMPLES:
        scan = example.replace("archive/demo/right", "archive/P0001/S1").replace("[3]", "[5]")
        if "scan.measures" in scan:  # two cameras see no whole foot
            scan = scan.replace("scan.measures", "footscan.measure('foot.stl')")
        exec(scan, names)
    printed = capsys.readouterr().out
    assert "mm ok" in printed
    assert "'foot_length': 26" in printed
    assert "['scan', 'status'" in printed


def test_docstrings_examples_run() -> None:
    assert doctest.testmod(import_module("footscan.measure.any_mesh")).failed == 0


def test_a_mesh_in_several_forms() -> None:
    from footscan.virtual.foot.foot import make_foot

    foot = make_foot(resolution_mm=4.0)
    as_arrays = footscan.measure((foot.vertices, foot.faces), side="right")
    assert footscan.measure((foot.vertices / 10, foot.faces), side="right").measures.keys() == as_arrays.measures.keys()
    with pytest.raises(AttributeError, match="no attribute 'open_scam'"):
        _ = footscan.open_scam  # type: ignore[attr-defined]

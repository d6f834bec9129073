"""The table of results has one row for each scan, as CSV and as Parquet."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.csv
import pytest
from pyarrow import parquet

from pipelines.archive.running import ScanEnd
from pipelines.archive.table import CSV, PARQUET, write_results_table
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE
from schemas.scan import Scan


def rows(folder: Path) -> list[dict[str, Any]]:
    with (folder / CSV).open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def ends(done: Any) -> list[ScanEnd]:
    scans, _ = done.run()
    return [*scans, ScanEnd("P0002/S1", done.scan, None, "cam3.avi: truncated, with a comma", "refused")]


def test_rows_hold_measures_quality_versions_and_digests(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(ends, tmp_path)
    good, bad = rows(tmp_path)
    folder = ends[0].folder
    assert folder is not None
    measures = json.loads((folder / "measures.json").read_bytes())["measures"]
    for name, measure in measures.items():
        value = good[name if measure["unit"] == "1" else f"{name}_{measure['unit']}"]
        assert value == ("" if measure["value"] is None else repr(measure["value"]))
    quality = json.loads((folder / "quality.json").read_bytes())
    assert int(good["cloud_points"]) == quality["cloud_points"]
    assert int(good["stripe_points"]) == sum(camera["points"] for camera in quality["cameras"])
    assert int(good["mesh_open_edges"]) == quality["mesh"]["open_edges"]
    assert good["software"] == SOFTWARE
    assert good["foot.stl_sha256"] == sha256((folder / "foot.stl").read_bytes())
    assert (good["scan"], good["status"], good["problem"]) == ("P0001/S1", "done", "")
    assert (bad["scan"], bad["status"], bad["problem"]) == ("P0002/S1", "refused", ends[1].problem)
    assert set(bad.values()) == {"P0002/S1", "refused", ends[1].problem, ""}


def test_each_measure_has_its_status_and_uncertainty_and_each_scan_what_it_rests_on(
    ends: list[ScanEnd], tmp_path: Path
) -> None:
    write_results_table(ends, tmp_path)
    good, _ = rows(tmp_path)
    folder = ends[0].folder
    assert folder is not None
    measures = json.loads((folder / "measures.json").read_bytes())
    assert {measure["status"] for measure in measures["measures"].values()} > {"ok"}
    for name, measure in measures["measures"].items():
        suffix = "" if measure["unit"] == "1" else f"_{measure['unit']}"
        sd = measure["uncertainty"]
        assert (good[f"{name}_status"], good[f"{name}_sd{suffix}"]) == (
            measure["status"],
            "" if sd is None else repr(sd),
        )
    quality = json.loads((folder / "quality.json").read_bytes())
    assert good["warnings"] == " | ".join(quality["scan_warnings"]) != ""
    assert (good["calibration_file"], good["calibration_software"]) == (
        quality["calibration"]["name"], quality["calibration"]["software"]
    )  # fmt: skip
    assert good["posture"] == measures["posture"] == "unknown"
    assert len(good["parameters_sha256"]) == 64


def test_what_says_how_far_to_trust_stands_after_the_columns_of_old(ends: list[ScanEnd], tmp_path: Path) -> None:
    """Also where the first scan has none of them: others may read columns by their place."""
    write_results_table([ends[1], ends[0]], tmp_path)
    names = list(rows(tmp_path)[0])
    added = {"scanner", "date", "posture", "patient", "sex", "age", "parameters_sha256", "warnings"}
    added |= {f"calibration_{name}" for name in ("file", "created", "software")}
    added |= {name for name in names if name.startswith(("size_", "width_"))}
    added |= {name for name in names if name.endswith("_status") or "_sd_" in name or name.endswith("_sd")}
    assert names[: len(names) - len(added)] == [name for name in names if name not in added]
    assert names[:5] == ["scan", "status", "problem", "side", "foot_length_mm"]


@pytest.fixture
def mixed(ends: list[ScanEnd], tmp_path: Path) -> list[ScanEnd]:
    """A scan that was measured, one that is no foot, one with a second calibration, and one that was refused."""
    done, refused = ends
    assert done.folder is not None
    changes: dict[str, dict[str, dict[str, Any]]] = {
        "S2": {"measures.json": {"measures": {}, "finding": "no foot"}, "quality.json": {"scan_warnings": None}},
        "S3": {
            "measures.json": {"posture": "half_weight"},
            "quality.json": {
                "scan_warnings": ['Camera 3, "left": it moved. Calibrate anew.', "=1+1 is no formula here."],
                "calibration": {
                    "name": "b.json", "sha256": "b" * 64, "created": "2026-11-20T08:00:00Z", "software": "footscan 9"
                },
            },
        },
    }  # fmt: skip
    made = []
    for name, files in changes.items():
        folder = Path(shutil.copytree(done.folder, tmp_path / "mixed" / name))
        for file, changed in files.items():
            document = json.loads((folder / file).read_bytes())
            (folder / file).write_text(json.dumps(document | changed))
        made.append(replace(done, scan=f"P0001/{name}", folder=folder))
    document = Scan.model_validate(
        {
            "format": "footscan.scan/1", "patient": "P0001", "scan": "S3", "side": "right", "scanner": "left-room",
            "date": "2026-11-20", "cameras": [{"id": 1, "file": "a.avi", "positions": "a.csv"}],
        }
    )  # fmt: skip
    finding = replace(made[0], problem="no foot", kind="finding")
    return [refused, finding, done, replace(made[1], document=document)]


def test_csv_and_parquet_read_back_equal(mixed: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(mixed, tmp_path)
    table = parquet.read_table(tmp_path / PARQUET)
    options = pyarrow.csv.ConvertOptions(
        column_types=table.schema, strings_can_be_null=True, quoted_strings_can_be_null=True, null_values=[""]
    )
    parse = pyarrow.csv.ParseOptions(newlines_in_values=True)
    assert pyarrow.csv.read_csv(tmp_path / CSV, convert_options=options, parse_options=parse).equals(table)
    assert [table["status"].to_pylist(), table["problem"].to_pylist()[:2]] == [
        ["refused", "finding", "done", "done"], [mixed[0].problem, "no foot"]
    ]  # fmt: skip
    assert len(set(table["calibration_sha256"].to_pylist())) == 3, "two calibrations, and none"
    last = {name: table[name].to_pylist()[-1] for name in ("scanner", "date", "posture", "calibration_created")}
    assert last == {
        "scanner": "left-room", "date": "2026-11-20", "posture": "half_weight",
        "calibration_created": "2026-11-20T08:00:00Z",
    }  # fmt: skip
    assert "1+1" in table["warnings"].to_pylist()[-1]


def test_parquet_says_the_unit_of_every_number(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(ends, tmp_path)
    schema = parquet.read_schema(tmp_path / PARQUET)
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in schema}
    assert {name for name, unit in units.items() if not unit} == {
        field.name for field in schema if str(field.type) == "string"
    }
    expected = {
        "foot_length_mm": "mm", "foot_length_sd_mm": "mm", "ball_angle_deg": "deg", "ball_angle_sd_deg": "deg",
        "foot_volume_mm3": "mm3", "foot_surface_mm2": "mm2", "arch_index": "1", "arch_index_sd": "1",
        "mesh_filled_share": "1", "cloud_points": "1", "mesh_largest_hole_mm": "mm",
    }  # fmt: skip
    assert {name: units[name] for name in expected} == expected


def test_parquet_holds_the_same(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(ends, tmp_path)
    table = parquet.read_table(tmp_path / PARQUET).to_pylist()
    for of_parquet, of_csv in zip(table, rows(tmp_path), strict=True):
        assert {name: "" if cell is None else str(cell) for name, cell in of_parquet.items()} == of_csv


def test_a_columns_type_does_not_depend_on_what_is_in_it(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(ends[:1], tmp_path / "good")
    write_results_table(ends[1:], tmp_path / "bad")
    good, bad = (parquet.read_schema(tmp_path / name / PARQUET) for name in ("good", "bad"))
    assert [good.field(name).type for name in bad.names] == bad.types
    types = {name: str(good.field(name).type) for name in good.names}
    texts = {
        "scan",
        "status",
        "problem",
        "side",
        "software",
        "patient",
        "sex",
        "scanner",
        "date",
        "posture",
        "warnings",
    }
    texts |= {name for name in types if name.endswith(("_sha256", "_status"))}
    texts |= {name for name in types if name.startswith(("size_", "width_")) and not name.endswith("_unrounded")}
    texts |= {f"calibration_{name}" for name in ("file", "created", "software")}
    counts = {"age", "cameras", "frames_lost", "stripe_points", "cloud_points"}
    counts |= {"mesh_vertices", "mesh_triangles", "mesh_open_edges", "mesh_non_manifold_edges", "mesh_components"}
    counts |= {"mesh_holes"}
    assert types.keys() >= {"mesh_largest_hole_mm", "mesh_filled_share", "mesh_worst_triangles"}
    assert {name for name, kind in types.items() if kind == "string"} == texts
    assert {name for name, kind in types.items() if kind == "int64"} == counts
    assert {types[name] for name in types.keys() - texts - counts} == {"double"}


def test_what_is_there_is_not_written_again(ends: list[ScanEnd], tmp_path: Path) -> None:
    write_results_table(ends, tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    write_results_table(ends, tmp_path)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before
    write_results_table(ends[:1], tmp_path)
    assert len(rows(tmp_path)) == 1
    (tmp_path / PARQUET).unlink()
    write_results_table(ends[:1], tmp_path)
    assert parquet.read_table(tmp_path / PARQUET).num_rows == 1


def test_no_scan_is_an_empty_table(tmp_path: Path) -> None:
    write_results_table([], tmp_path)
    assert rows(tmp_path) == []
    assert parquet.read_table(tmp_path / PARQUET).num_rows == 0


def test_a_spreadsheet_computes_nothing(ends: list[ScanEnd], tmp_path: Path) -> None:
    """Folder and problem are text from outside; what is measured stays a number."""
    hostile = ScanEnd("=cmd|'/C calc'!A0", ends[0].source, None, "\t-2+3", "refused")
    write_results_table([ends[0], hostile], tmp_path)
    good, bad = rows(tmp_path)
    assert (bad["scan"], bad["problem"]) == ("'=cmd|'/C calc'!A0", "'\t-2+3")
    assert all(not cell.startswith("'") for cell in good.values())
    assert float(good["foot_length_mm"]) > 0

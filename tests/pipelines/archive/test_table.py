"""The table of results has one row for each scan, as CSV and as Parquet."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from pyarrow import parquet

from pipelines.archive.job import ScanEnd
from pipelines.archive.table import CSV, PARQUET, write_results_table
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE


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
    texts = {"scan", "status", "problem", "side", "software"} | {name for name in types if name.endswith("_sha256")}
    counts = {"cameras", "frames_lost", "stripe_points", "cloud_points"}
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

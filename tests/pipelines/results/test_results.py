"""`footscan results`: rows, statistics and the page of an archive of a thousand scans."""

import csv
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.csv
import pytest
from pyarrow import parquet

from pipelines.archive.running import ScanEnd
from pipelines.archive.table import write_results_table
from pipelines.cli.main import run_command
from schemas.scan import Scan
from tests.helpers.chromium import Opened, launched, needs_chromium

SCANS = 1000


def document_of(number: int) -> Scan:
    return Scan.model_validate(
        {
            "format": "footscan.scan/1", "patient": f"P{number // 2:04d}", "scan": f"S{number}",
            "side": ("left", "right")[number % 2], "scanner": ("A", "B")[number % 3 == 0], "date": "2026-11-20",
            "sex": ("female", "male", None)[number % 3], "age": 20 + number % 50,
            "cameras": [{"id": 1, "file": "a.avi", "positions": "a.csv"}],
        }
    )  # fmt: skip


@pytest.fixture(scope="module")
def archive(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a thousand scans: measured, uncertain, warned, failed, with two calibrations."""
    root = tmp_path_factory.mktemp("thousand")
    results, pattern = root / "results", finished / "results/P0001/S1"
    measured = json.loads((pattern / "measures.json").read_bytes())
    quality = json.loads((pattern / "quality.json").read_bytes())
    sizes = (pattern / "sizes.json").read_bytes()
    random = np.random.default_rng(5)
    ends = []
    for number in range(SCANS):
        document = document_of(number)
        name, folder = f"{document.patient}/{document.scan}", results / document.patient / document.scan
        if number % 50 == 49:
            ends.append(ScanEnd(name, folder, None, "cam1.avi: is cut off", "refused", document=document))
            continue
        folder.mkdir(parents=True)
        length = float(random.normal(255.0 + 10.0 * (number % 2), 10.0))
        status = "uncertain" if number % 10 == 0 else "ok"
        own = {**measured["measures"]["foot_length"], "value": length, "status": status}
        girth = {**measured["measures"]["ball_girth"], "value": 0.9 * length + float(random.normal(0.0, 2.0))}
        measures = measured["measures"] | {"foot_length": own, "ball_girth": {**girth, "status": "ok"}}
        (folder / "measures.json").write_text(json.dumps({**measured, "side": document.side, "measures": measures}))
        calibration = {**quality["calibration"], "sha256": ("a", "b")[number % 2] * 64}
        warned = {"scan_warnings": ["Camera 3, left: moved."] if number % 7 == 0 else None, "calibration": calibration}
        (folder / "quality.json").write_text(json.dumps({**quality, **warned}))
        (folder / "sizes.json").write_bytes(sizes)
        (folder / "report.html").write_text("<p>report</p>")
        ends.append(ScanEnd(name, folder, folder, None, None, document=document))
    write_results_table(ends, results)
    (root / "workflow.yaml").write_text("format: footscan.workflow/1\narchive: .\nresults: results\n")
    return root


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as chromium:
        yield chromium


@pytest.fixture
def ask(archive: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    def run(*arguments: object) -> Any:
        capsys.readouterr()
        status = run_command(["results", str(archive / "workflow.yaml"), *map(str, arguments), "--json"])
        said = capsys.readouterr()
        assert status == 0, said.err
        return json.loads(said.out) if said.out else None

    return run


def table(archive: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = parquet.read_table(archive / "results/results.parquet").to_pylist()
    return rows


def test_conditions_and_order(archive: Path, ask: Any) -> None:
    found = ask(
        "--where", "side=left", "--where", "foot_length>=260", "--sort", "-foot_length", "--columns", "scan,foot_length"
    )
    expected = [row for row in table(archive) if row["side"] == "left" and row["foot_length_mm"] >= 260.0]
    expected.sort(key=lambda row: -row["foot_length_mm"])
    assert found == [{"scan": row["scan"], "foot_length_mm": row["foot_length_mm"]} for row in expected]
    assert len(ask("--where", "status!=done")) == SCANS // 50
    assert {row["scan"] for row in ask("--where", "warnings~camera 3")} == {
        row["scan"] for row in table(archive) if row["warnings"]
    }
    assert len(ask("--where", "problem=")) == SCANS - SCANS // 50


def test_statistics_leave_out_what_is_not_ok(archive: Path, ask: Any) -> None:
    found = {(one["side"], one["sex"]): one for one in ask("--by", "side,sex", "--columns", "foot_length")}
    rows = [row for row in table(archive) if row["foot_length_mm"] is not None]
    assert len(found) == 6
    for (side, sex), one in found.items():
        group = [row for row in rows if (row["side"], row["sex"]) == (side, sex)]
        values = [row["foot_length_mm"] for row in group if row["foot_length_status"] == "ok"]
        assert (one["number"], one["left_out"]) == (len(values), len(group) - len(values))
        expected = [np.mean(values), np.std(values, ddof=1), *np.percentile(values, [5, 50, 95])]
        assert [one[name] for name in ("mean", "sd", "p5", "p50", "p95")] == pytest.approx(expected)
    ages = ask("--by", "age_group", "--columns", "foot_length", "--with-uncertain")
    assert [one["age_group"] for one in ages] == ["20-29", "30-39", "40-49", "50-59", "60-69"]
    assert sum(one["number"] for one in ages) == len(rows)


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--where", "foot_lenght>3"), "--where: no column 'foot_lenght', did you mean 'foot_length_mm'?"),
        (("--where", "foot_length>long"), "--where: foot_length_mm holds numbers, expected one, found 'long'"),
        (("--where", "side"), "--where: expected a column, one of = != < <= > >= ~ and a value"),
        (("--by", "side", "--columns", "scan"), "--columns: scan holds no numbers"),
        (("--out", "rows.xlsx"), "rows.xlsx: expected a name that ends in .csv or .parquet"),
        (("--page", "plot.png"), "--page: expected a name that ends in .html"),
        (
            ("--results", "nowhere"),
            "nowhere/results.parquet: no such file, expected the table that 'footscan run' writes",
        ),
    ],
)
def test_a_wrong_question_is_refused(
    archive: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], problem: str
) -> None:
    assert run_command(["results", str(archive / "workflow.yaml"), *arguments]) == 2
    assert capsys.readouterr().err.startswith(f"footscan: {problem}")


def test_csv_and_parquet_hold_the_same(ask: Any, tmp_path: Path) -> None:
    """Nothing is lost between them, of scans that failed, are uncertain, or carry warnings."""
    for suffix in ("csv", "parquet"):
        ask("--where", "side=right", "--out", tmp_path / f"rows.{suffix}")
    kept = parquet.read_table(tmp_path / "rows.parquet")
    assert kept.num_rows == SCANS // 2
    options = pyarrow.csv.ConvertOptions(
        column_types=kept.schema, strings_can_be_null=True, quoted_strings_can_be_null=True, null_values=[""]
    )
    assert pyarrow.csv.read_csv(tmp_path / "rows.csv", convert_options=options).equals(kept)
    assert kept.schema.field("foot_length_mm").metadata == {b"unit": b"mm"}
    with (tmp_path / "rows.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == SCANS // 2


def test_a_thousand_scans_are_answered_soon(archive: Path) -> None:
    """In a second on a quiet machine; a query that reads a thousand files takes far longer than what is allowed."""
    command = [Path(sys.executable).with_name("footscan"), "results", archive / "workflow.yaml", "--by", "side", "-q"]
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        seconds.append(time.perf_counter() - start)
    assert min(seconds) < 5.0


@needs_chromium
def test_the_page_draws_a_thousand_points(archive: Path, browser: Any, ask: Any) -> None:
    page_file = archive / "results/plot.html"
    ask("--page", page_file, "--columns", "foot_length,ball_girth")
    opened = Opened(browser.new_page(viewport={"width": 1200, "height": 900}), page_file.as_uri())
    page = opened.page
    measured = [row for row in table(archive) if row["foot_length_mm"] is not None]
    said = page.inner_text("#under")
    assert said.startswith(f"{len(measured)} scans, ")
    trusted = [row for row in measured if row["foot_length_status"] == row["ball_girth_status"] == "ok"]
    r = np.corrcoef([row["foot_length_mm"] for row in trusted], [row["ball_girth_mm"] for row in trusted])[0, 1]
    shown = re.search(r"correlation is ([\d.]+)", said)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(r, abs=1e-3)
    box = page.query_selector("#plot").bounding_box()
    milliseconds = page.evaluate(
        """() => {
            const canvas = document.getElementById("plot"), box = canvas.getBoundingClientRect();
            const start = performance.now();
            for (let k = 0; k < 20; k++) {
                const place = {clientX: box.left + box.width * (0.3 + 0.02 * k), clientY: box.top + box.height / 2};
                canvas.dispatchEvent(new PointerEvent("pointermove", place));
            }
            return (performance.now() - start) / 20;
        }"""
    )
    assert milliseconds < 200.0
    page.select_option("#colour", "side")
    assert [one.inner_text() for one in page.query_selector_all("#key span")] == ["left", "right"]
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for across in np.linspace(0.3, 0.9, 60):
        page.mouse.move(box["x"] + box["width"] * across, box["y"] + box["height"] * (1.0 - across))
        if "a click opens" in page.inner_text("#under"):
            break
    name = page.inner_text("#under").partition(":")[0]
    with page.context.expect_page() as clicked:
        page.mouse.down()
        page.mouse.up()
    assert clicked.value.url.endswith(f"{name}/report.html")
    opened.page.close()

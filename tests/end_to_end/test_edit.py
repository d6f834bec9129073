"""A landmark that a person moves in the browser holds, whatever is computed anew, and changes what depends on it."""

import json
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from signal import SIGINT
from typing import Any

import pytest
import yaml

from pipelines.console.console import Console
from tests.helpers.chromium import Opened, needs_chromium
from tests.helpers.served import console_stand_in, served

SCAN = "P0001/small"
BELOW_THE_SKIN_MM = 0.5


@contextmanager
def edited(bench: Path) -> Iterator[str]:
    """The address of `footscan edit`."""
    command = [Path(sys.executable).with_name("footscan"), "edit", SCAN]
    process = subprocess.Popen(command, cwd=bench, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    yield process.stdout.readline().strip().removesuffix("/")
    process.send_signal(SIGINT)
    said = process.communicate(timeout=60)[1]
    assert (process.returncode, said) == (0, f"{SCAN}: the page has ended\n")


def measures(bench: Path) -> Any:
    return json.loads((bench / "results" / SCAN / "measures.json").read_bytes())


def drag(page: Any, name: str, right: float) -> None:
    """Drag a landmark, which is seen from above, to the right by pixels."""
    page.click("[data-view=above]")
    page.wait_for_timeout(300)
    box = page.query_selector("#canvas").bounding_box()
    x, y = page.evaluate(
        """([label, width, height]) => {
            const data = document.getElementById("canvas").dataset, canvas = document.getElementById("canvas");
            const [x, y] = JSON.parse(data.landmarks)[label];
            const scale = Math.min(canvas.width, canvas.height * 1.25) / 65534 / 2;
            return [width / 2 + scale * x, height / 2 - scale * y];
        }""",
        [name, box["width"], box["height"]],
    )
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    for part in (0.25, 0.5, 0.75, 1.0):
        page.mouse.move(box["x"] + x + right * part, box["y"] + y)
    page.mouse.up()


@needs_chromium
def test_a_landmark_moved_in_the_browser_holds(bench: Path, footscan: Any, browser: Any) -> None:
    before = measures(bench)
    with edited(bench) as address:
        opened = Opened(browser.new_page(viewport={"width": 1300, "height": 900}), address)
        page = opened.page
        page.wait_for_selector("#viewer:not([hidden])")
        drag(page, "Instep point", 20.0)
        page.wait_for_selector("#busy:text('Not saved yet.')")
        shown = page.query_selector_all("#changes li")
        told = {line.inner_text().partition(":")[0] for line in shown}
        page.fill("#by", "Dr K")
        page.click("#save")
        page.wait_for_selector("#how-instep_point:text('set by a person (Dr K')")
        opened.is_clean()
    document = yaml.safe_load((bench / "archive" / SCAN / "landmarks.yaml").read_text())
    assert document["decided"]["instep_point"]["by"] == "Dr K"
    point = document["landmarks"]["instep_point"]
    after = measures(bench)
    assert after["landmarks"]["instep_point"]["point"] == pytest.approx(point, abs=BELOW_THE_SKIN_MM)
    # Of a landmark that a person has set, nothing scatters but the end that the measure starts from.
    assert after["measures"]["instep_length"]["uncertainty"] < 1.5
    changed = {name for name, one in after["measures"].items() if one["value"] != before["measures"][name]["value"]}
    depend = {name for name, one in before["measures"].items() if "instep point" in one["definition"]}
    assert changed == {name for name in depend if after["measures"][name]["value"] is not None}
    assert {name.replace("_", " ").capitalize() for name in changed} == told

    # Again from the films, with other parameters.
    (bench / "results/.footscan").rename(bench / "forgotten")
    workflow = bench / "workflow.yaml"
    workflow.write_text(f"{workflow.read_text()}\nparameters: {{surface: {{grid_steps: 0.75}}}}\n")
    assert footscan("run", workflow).returncode == 0
    assert measures(bench)["landmarks"]["instep_point"]["method"] == "manual"
    assert measures(bench)["landmarks"]["instep_point"]["point"] == pytest.approx(point, abs=1e-3)
    (bench / "archive" / SCAN / "landmarks.yaml").unlink()
    assert "input landmarks changed" in footscan("why", SCAN, "measure", "--workflow", workflow).stdout
    traced = footscan("trace", bench / "results" / SCAN / "measures.json", "--json").stdout
    assert "landmarks.yaml" in traced


def test_the_console_serves_the_page_of_its_scans(bench: Path) -> None:
    stand_in = console_stand_in(bench / "results")
    stand_in.calibration = bench / "calibration.json"
    with Console(stand_in, bench / "archive", bench / "results") as console, served(console) as address:
        with urllib.request.urlopen(f"{address}/edit/{SCAN}") as answer:
            assert f'data-name="{SCAN}"' in answer.read().decode()
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"{address}/edit/P0001/nobody")
        assert (refused.value.code, b"no such folder" in refused.value.read()) == (409, True)


def test_results_of_other_parameters_are_not_edited(bench: Path, footscan: Any) -> None:
    workflow = bench / "workflow.yaml"
    workflow.write_text(f"{workflow.read_text()}\nparameters: {{surface: {{grid_steps: 0.75}}}}\n")
    from pipelines.archive.editing import Edit, ScanEditor
    from pipelines.archive.job import job_of_workflow
    from schemas.base.errors import RefusedInput

    editor = ScanEditor(job_of_workflow(workflow), bench / "archive" / SCAN)
    with pytest.raises(RefusedInput, match="expected 'footscan run' first"):
        editor.tried(Edit())
    assert footscan("edit", "P0001/nobody", "--workflow", workflow).returncode == 2

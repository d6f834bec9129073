"""The page of a foot: what is known of a virtual one stands beside what was measured."""

import json
import re
from pathlib import Path

import pytest
from stand_in import deliver_made_up

from pipelines.console.pages.foot import foot_page
from schemas.known_measures import KnownMeasures


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for folder in ("archive/P1/S1", "results/P1/S1"):
        (tmp_path / folder).mkdir(parents=True)
    deliver_made_up(tmp_path / "results/P1/S1", "right")
    return tmp_path


def rows_of(home: Path) -> dict[str, list[str]]:
    """The cells of the table of measures, by the first of each row."""
    page = foot_page(home / "archive", home / "results", "P1", "S1")
    table = page[page.index('<div class="list">') :]
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)]
    plain = [[re.sub(r"<[^>]+>", "", cell) for cell in row] for row in rows]
    return {row[0]: row[1:] for row in plain}


def test_known_measures_stand_beside_the_measured_ones(home: Path) -> None:
    known = KnownMeasures(side="right", measures={"foot_length": 262.4, "ball_girth": 243.0})
    (home / "archive/P1/S1/known.json").write_text(known.model_dump_json())
    file = home / "results/P1/S1/measures.json"
    measures = json.loads(file.read_text())
    measures["measures"]["foot_length"]["uncertainty"] = 0.234
    file.write_text(json.dumps(measures))
    rows = rows_of(home)
    assert rows["Measure"][:4] == ["Value", "± sd", "Known", "Value minus known"]
    assert rows["Foot length"][:4] == ["262.0", "± 0.23", "262.4", "−0.4"]
    assert rows["Ball girth"][:4] == ["243.5", "", "243.0", "0.5"]
    assert rows["Ball length"][:4] == ["194.0", "", "–", "–"]


@pytest.mark.parametrize("content", [None, "{}", '{"side": "left", "measures": {"foot_length": 262.4}}'])
def test_without_known_measures_of_this_foot_there_is_no_such_column(home: Path, content: str | None) -> None:
    if content is not None:
        (home / "archive/P1/S1/known.json").write_text(content)
    assert rows_of(home)["Measure"] == ["Value", "± sd", "Unit", "Status"]

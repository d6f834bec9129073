import csv
import io
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import trimesh

from footscan.report.comparison.figures import figures_facts, histogram_plot
from footscan.report.comparison.page import comparison_page
from footscan.report.comparison.table import comparison_csv
from footscan.report.deviation import Deviation
from footscan.verify.register import Registration, Residuals
from schemas.quality import Comparison, Completeness, Histogram, RegionFigures

HOSTILE = '<script>alert(1)</script>&"foot".stl'
FIGURES: dict[str, Any] = {
    **{"points": 1234, "mean": 0.2, "std": 0.1, "rms": 0.3, "min": 0.0, "max": 1.5, "signed_mean": -0.05},
    **{"p50": 0.15, "p90": 0.4, "p95": 0.5, "p99": 0.9},
}
UNSIGNED = Histogram(signed=False, edges_mm=[0, 0.5, 1, 1.5], counts=[900, 0, 334], shares=[0.75, 0, 0.25])
RESIDUALS = Residuals.model_construct(rms=1.25, mean=1.0, median=0.75, inliers=0.5)
MESH = trimesh.creation.box(extents=(100, 60, 40))
SHOWN = Deviation(np.asarray(MESH.vertices), np.asarray(MESH.faces), np.full(8, 0.3), True, "left")


@pytest.fixture
def comparison() -> Comparison:
    return Comparison(
        **FIGURES,
        regions=[RegionFigures(region="heel", **FIGURES), RegionFigures(region="toes", **FIGURES)],
        histograms=[UNSIGNED, UNSIGNED.model_copy(update={"signed": True})],
        completeness=Completeness(
            **FIGURES, within_mm=1.0, within_share=0.9375, regions=[RegionFigures(region="ball", **FIGURES)]
        ),
    )


class Words(HTMLParser):
    """Words of a page, and separately its headings; fails at a wrong end tag."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open, self.headings, self.words = list[str](), list[str](), list[str]()
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, _attributes: object) -> None:
        if tag not in {"meta", "input", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            (self.headings if self.open[-1] == "h2" else self.words).append(data.strip())


def test_what_is_known_stands_on_the_page(comparison: Comparison) -> None:
    moved = comparison.model_copy(update={"transform": np.eye(4).tolist()})
    registration = Registration.model_construct(
        transform=np.eye(4).tolist(),
        before=RESIDUALS,
        after=RESIDUALS.model_copy(update={"rms": 0.125}),
        runner_up=None,
        starts=24,
        agreeing=20,
        stiffness=0.1,
        verdict="same shape",
    )
    page = Words(comparison_page("scan.stl", "truth.stl", moved, SHOWN, registration))
    assert page.headings == ["Distances", "Registration", "Surface", "Regions of the foot", "Classes", "Completeness"]
    for expected in ("0.200 mm", "1.500 mm", "−0.050 mm", "93.8 %", "Heel", "Ball", "0.125", "1.250", "75.00"):
        assert expected in page.words, expected
    assert "Left side (lateral)" in page.words


def test_what_is_not_known_is_left_out() -> None:
    plain = Comparison(**FIGURES | {"signed_mean": None})
    cloud = SHOWN._replace(faces=np.zeros((0, 3), np.int32), side=None, signed=False)
    page = comparison_page("a", "b", plain, cloud, None)
    assert Words(page).headings == ["Distances", "Surface"]
    assert "Signed mean" not in page
    assert "<script>" not in page
    assert "From +Y" in page
    assert "blue lies inside" not in page


def test_names_of_files_are_no_markup_and_nothing_is_loaded(comparison: Comparison) -> None:
    page = comparison_page(HOSTILE, HOSTILE, comparison, SHOWN, None)
    Words(page)
    assert page.count("<script") == 1
    assert "<script>alert" not in page
    assert not re.search(r"https?://|src\s*=(?!.data:image/)|@import|url\(|<link|<iframe", page, re.IGNORECASE)


def test_the_same_comparison_gives_the_same_bytes(comparison: Comparison) -> None:
    assert comparison_page("a", "b", comparison, SHOWN, None) == comparison_page("a", "b", comparison, SHOWN, None)


def test_bars_are_as_high_as_their_shares() -> None:
    bars = re.findall(
        r'class="class" x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', histogram_plot(UNSIGNED)
    )
    x, y, width, height = np.array(bars, float).T
    np.testing.assert_allclose(height / height.max(), [1, 0, 1 / 3], atol=1e-3)
    np.testing.assert_allclose(width, width[0])
    np.testing.assert_allclose(x[1:], (x + width)[:-1], atol=0.02)
    np.testing.assert_allclose(y + height, (y + height)[0], atol=0.02)


def test_figures_that_are_not_known_have_no_fact() -> None:
    assert "Points" not in figures_facts(Comparison(**FIGURES | {"points": None}))
    assert "Farthest inside" not in figures_facts(Comparison(**FIGURES))
    assert "Farthest inside" in figures_facts(Comparison(**FIGURES, signed_min=-1.0))


def test_the_table_for_a_spreadsheet(comparison: Comparison) -> None:
    rows = list(csv.DictReader(io.StringIO(comparison_csv(comparison))))
    assert [(row["table"], row["name"]) for row in rows] == [
        ("whole", ""),
        ("region", "heel"),
        ("region", "toes"),
        ("completeness", ""),
        ("completeness", "ball"),
        *(("unsigned", str(k)) for k in (1, 2, 3)),
        *(("signed", str(k)) for k in (1, 2, 3)),
    ]
    assert (rows[0]["mean"], rows[0]["points"], rows[0]["signed_std"]) == ("0.2", "1234", "")
    assert (rows[3]["to_mm"], rows[3]["share"]) == ("1.0", "0.9375")
    assert [rows[5][name] for name in ("from_mm", "to_mm", "points", "share", "mean")] == [
        "0.0",
        "0.5",
        "900",
        "0.75",
        "",
    ]
    assert all(None not in row and None not in row.values() for row in rows)

import re
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser

import numpy as np
import pytest

from footscan.cloud.points import make_points
from footscan.report.sample_frames import FrameSample
from footscan.report.scan_page import scan_page, upright
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap, Source
from schemas.measures import Measure, Measures
from schemas.quality import CameraQuality, Comparison, MeshQuality, Quality

IDENTITY = np.eye(4).tolist()
HOSTILE = '<script>alert("x")</script>'


def identity_map():
    return PolynomialMap(order=1, centre_px=(0, 0), scale_px=1, alpha_y=[0, 1, 0], alpha_z=[0, 0, 1])


@pytest.fixture(scope="module")
def scan():
    """A tetrahedron, two cameras, three measures."""
    vertices = np.array([[0, 0, 0], [250, 0, 0], [0, 100, 0], [0, 0, 80]], float)
    image = np.full((48, 64, 3), 30, np.uint8)
    point = np.array([20.0]), np.array([30.0])
    return {
        "patient": "P0001",
        "scan": "2026-11-20-R",
        "side": "right",
        "vertices": vertices,
        "faces": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
        "cloud": make_points(vertices, camera=np.array([1, 1, 2, 2]), frame=np.array([0, 1, 1, 3])),
        "measures": Measures(
            side="right",
            axis="toe2",
            transform=IDENTITY,
            measures={
                "foot_length": Measure(value=265.14, unit="mm", status="ok", definition="Heel to toe"),
                "arch_index": Measure(value=0.2312, unit="1", status="uncertain", definition="Areas", note="No toes"),
                "heel_girth": Measure(value=None, unit="mm", status="incomplete", definition="Taut", note="Cut off"),
            },
        ),
        "calibration": Calibration(
            sources=[],
            software="footscan",
            cameras=[CameraCalibration(camera=1, map=identity_map(), region_px=[(9, 9), (99, 9), (9, 99)], points=3)],
        ),
        "quality": Quality(
            calibration=Source(name=f"{HOSTILE}.json", sha256="12ab"),
            cameras=[
                CameraQuality(
                    camera=1, frames=4, frames_lost=1, frames_with_stripe=2, points=1711, removed={"far_off": 13}
                ),
                CameraQuality(
                    camera=2, frames=4, frames_lost=1, frames_with_stripe=3, points=1722, removed={"outside": 17}
                ),
            ],
            cloud_points=4,
            mesh=MeshQuality(vertices=4, triangles=4, open_edges=0, non_manifold_edges=0, components=1, holes=0),
        ),
        "samples": [FrameSample(camera, 1, image, *point) for camera in (1, 2)],
        "truth_distance": None,
        "provenance": {"extraction.method": "ridge", "footscan": "0.1.0"},
    }


def rows_of(page):
    """The cells of every table row, without markup."""
    return [
        [re.sub(r"<[^>]+>", " ", cell).strip() for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", page)
    ]


def facts_of(page):
    return dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page))


def test_every_measure_stands_with_value_unit_status_and_definition(scan):
    rows = rows_of(scan_page(**scan))
    assert ["Foot length", "265.1", "mm", "ok", "Heel to toe"] in rows
    assert ["Heel girth", "–", "mm", "incomplete", "Taut Cut off"] in rows
    assert ["Arch index", "0.231", "", "uncertain", "Areas No toes"] in rows


def test_the_cameras_table_adds_up(scan):
    rows = rows_of(scan_page(**scan))
    assert [
        "Camera",
        "Frames",
        "Lost",
        "With stripe",
        "Points",
        "Removed: Far off",
        "Removed: Outside",
        "In cloud",
    ] in rows
    assert ["1", "4", "1", "2", "1\u202f711", "13", "0", "2"] in rows
    assert ["2", "4", "1", "3", "1\u202f722", "0", "17", "2"] in rows
    assert ["All", "8", "2", "5", "3\u202f433", "13", "17", "4"] in rows


def test_provenance_and_mesh(scan):
    page = scan_page(**scan)
    assert ["extraction.method", "ridge"] in rows_of(page)
    assert facts_of(page)["Closed"] == "Yes"
    assert facts_of(page)["Triangles"] == "4"


def test_the_calibration_stands_with_its_digest_and_a_picture(scan):
    page = scan_page(**scan)
    assert ["SHA-256", "12ab"] in rows_of(page)
    assert ["Made", "unknown"] in rows_of(page)
    assert '<img class="picture" src="data:image/png;base64,' in page


@pytest.mark.parametrize("broken", [{"open_edges": 3}, {"non_manifold_edges": 1}])
def test_a_mesh_with_open_or_non_manifold_edges_is_not_closed(scan, broken):
    mesh = scan["quality"].mesh.model_copy(update=broken)
    page = scan_page(**scan | {"quality": scan["quality"].model_copy(update={"mesh": mesh})})
    assert facts_of(page)["Closed"] == "No"


def test_the_comparison_stands_where_there_is_one(scan):
    truth = Comparison(
        mean=0.213, std=0.18, min=0, max=2.1, p50=0.17, p90=0.42, p95=0.61, p99=1.1, rms=0.28, signed_mean=-0.04
    )
    quality = scan["quality"].model_copy(update={"truth": truth})
    page = scan_page(**scan | {"quality": quality, "truth_distance": np.array([0.1, -0.2, 0.3, np.nan])})
    facts = facts_of(page)
    assert facts["Mean"] == "0.213 mm"
    assert facts["95 %"] == "0.610 mm"
    assert facts["Greatest"] == "2.100 mm"
    assert facts["Signed mean"] == "−0.040 mm"
    assert "Colour bar" in page
    assert "Colour bar" not in scan_page(**scan)


def test_what_comes_from_a_scan_is_no_markup(scan):
    measure = Measure(value=None, unit="mm", status="incomplete", definition=HOSTILE, note=HOSTILE)
    camera = scan["quality"].cameras[0].model_copy(update={"removed": {HOSTILE: 1}})
    page = scan_page(
        **scan
        | {
            "patient": HOSTILE,
            "scan": HOSTILE,
            "side": HOSTILE,
            "measures": scan["measures"].model_copy(update={"measures": {HOSTILE: measure}}),
            "quality": scan["quality"].model_copy(update={"cameras": [camera]}),
            "provenance": {HOSTILE: HOSTILE},
        }
    )
    assert "alert" in page
    assert page.count("<script") == scan_page(**scan).count("<script") == 1
    assert "<script>alert" not in page


def test_the_page_asks_for_nothing_from_elsewhere(scan):
    page = scan_page(**scan)
    assert not re.search(r"https?://|src\s*=(?!.data:image/)|@import|url\(|<link|<iframe", page, re.IGNORECASE)
    assert all(address.startswith("data:image/") for address in re.findall(r'href="([^"]*)"', page))
    assert "default-src 'none'" in page


class Balance(HTMLParser):
    """Tags that were opened and are still open; refuses a wrong end."""

    void = frozenset({"meta", "input", "img"})

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, _attributes):
        if tag not in self.void:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_every_tag_is_closed(scan):
    parser = Balance()
    parser.feed(scan_page(**scan))
    assert parser.open == []


def test_the_same_scan_gives_the_same_bytes_in_every_thread(scan):
    with ThreadPoolExecutor(4) as threads:
        pages = list(threads.map(lambda _: scan_page(**scan), range(8)))
    assert len(set(pages)) == 1


def test_a_left_foot_is_shown_as_it_is():
    # Scanner and foot stand alike, but for 10 mm in X and the mirror that makes a right foot of a left one.
    mirrored = [[1, 0, 0, -10], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert upright(np.array([[30.0, 4.0, 5.0]]), mirrored).tolist() == [[20, 4, 5]]
    turned = [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]
    assert upright(np.array([[30.0, 4.0, 5.0]]), turned).tolist() == [[4, -30, 7]]

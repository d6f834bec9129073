import datetime
import re
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser

import numpy as np
import pytest

from footscan.cloud.outliers.remove import REASONS
from footscan.cloud.points import make_points
from footscan.report.sample_frames import FrameSample, cut_out
from footscan.report.scan.foot_colours import FootSurface
from footscan.report.scan.page import ScanTitle, scan_page
from footscan.report.scan.pictures import scan_pictures
from footscan.report.surface_views import upright
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap
from schemas.calibration_check import ScanCheck
from schemas.fusion import CameraCorrection, Disagreement, FusionReport, PairDisagreement
from schemas.glass import GlassPlane
from schemas.measures import Measure, Measures
from schemas.movement import MovementReport
from schemas.quality import CameraQuality, Comparison, MeshQuality, Quality
from schemas.used_calibration import UsedCalibration

IDENTITY = np.eye(4).tolist()
HOSTILE = '<script>alert("x")</script>'


def identity_map():
    return PolynomialMap(order=1, centre_px=(0, 0), scale_px=1, alpha_y=[0, 1, 0], alpha_z=[0, 0, 1])


WHOLE = 0, 48, 0, 64
"""The cut of the frames."""


def apart(median, rms):
    return Disagreement(median_mm=median, deviation_mm=0.05, rms_mm=rms)


@pytest.fixture(scope="module")
def scan():
    """A tetrahedron, two cameras, three measures."""
    vertices = np.array([[0, 0, 0], [250, 0, 0], [0, 100, 0], [0, 0, 80]], float)
    image = np.full((48, 64, 3), 30, np.uint8)
    point = np.array([20.0]), np.array([30.0])
    return {
        "title": ScanTitle("P0001", "2026-11-20-R", "right"),
        "surface": FootSurface(
            vertices=vertices,
            faces=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
            filled=np.array([False, False, False, True]),
            deviations=np.array([0.03, 0.03, 0.03, 0.5]),
            cut_mm=None,
            truth_distance=None,
        ),
        "cloud": make_points(vertices, camera=np.array([1, 1, 2, 2]), frame=np.array([0, 1, 1, 3])),
        "pictures": scan_pictures(
            make_points(np.vstack([vertices, [[0, 0, -9]]]), camera=np.array([1, 1, 2, 2, 2])),
            np.array([0, 0, 0, 0, 1 + REASONS.index("glass")], np.uint8),
            [FrameSample(camera, 1, WHOLE, cut_out(image, WHOLE), *point) for camera in (1, 2)],
        ),
        "measures": Measures(
            side="right",
            axis="toe2",
            transform=IDENTITY,
            measures={
                "foot_length": Measure(
                    value=265.14,
                    unit="mm",
                    status="ok",
                    definition="Heel to toe",
                    uncertainty=0.25,
                    budget={"noise": 0.07, "sway": 0.24},
                ),
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
            calibration=UsedCalibration(name=f"{HOSTILE}.json", sha256="12ab"),
            cameras=[
                CameraQuality(
                    camera=1,
                    frames=4,
                    frames_lost=1,
                    frames_with_stripe=2,
                    points=1711,
                    laser="green",
                    removed={"end": 13, "volume": 0},
                ),
                CameraQuality(
                    camera=2,
                    frames=4,
                    frames_lost=1,
                    frames_with_stripe=3,
                    points=1722,
                    removed={"end": 2, "far_off": 15},
                ),
            ],
            fusion=FusionReport(
                pairs=[PairDisagreement(cameras=(1, 2), points=777, before=apart(0.21, 0.3), after=apart(-0.01, 0.1))],
                corrections=[
                    CameraCorrection(camera=1, kind="none", points=0),
                    CameraCorrection(
                        camera=2,
                        kind="rigid",
                        points=777,
                        largest_mm=0.25,
                        held_out_before_mm=0.4,
                        held_out_after_mm=0.1,
                    ),
                ],
                contradicted={2: 5},
                warnings=[f"camera 2 {HOSTILE}"],
            ),
            glass=GlassPlane(
                below_foot_mm=-1.234,
                below_foot_sd_mm=0.0123,
                tilt_x_deg=0.25,
                tilt_x_sd_deg=0.031,
                supported=["height", "tilt_x"],
                cameras=[5, 6],
                contact_mm2=5230.0,
                stripes=77,
                corrected=True,
            ),
            cloud_points=4,
            mesh=MeshQuality(
                vertices=4,
                triangles=4,
                open_edges=0,
                non_manifold_edges=0,
                components=1,
                holes=0,
                filled_share=0.125,
                cut_share=0.25,
                triangle_quality=0.91,
                worst_triangles=0.456,
            ),
        ),
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


def test_every_measure_stands_with_value_deviation_unit_status_and_definition(scan):
    rows = rows_of(scan_page(**scan))
    assert ["Foot length", "265.1", "± 0.25", "mm", "ok", "Heel to toe ± from sway 0.24, noise 0.07"] in rows
    assert ["Heel girth", "–", "", "mm", "incomplete", "Taut Cut off"] in rows
    assert ["Arch index", "0.231", "", "", "uncertain", "Areas No toes"] in rows


def test_the_cameras_table_adds_up(scan):
    rows = rows_of(scan_page(**scan))
    assert ["Camera", "Frames", "Lost", "With stripe", "Points", "Removed", "In cloud", "Laser"] in rows
    assert ["1", "4", "1", "2", "1\u202f711", "13", "2", "green"] in rows
    assert ["2", "4", "1", "3", "1\u202f722", "17", "2", "–"] in rows
    assert ["All", "8", "2", "5", "3\u202f433", "30", "4", ""] in rows


def test_each_reason_has_a_column_that_adds_up(scan):
    rows = rows_of(scan_page(**scan))
    assert ["Camera", "Removed", "Of its points", "End", "Far off"] in rows
    assert ["1", "13", "0.8 %", "13", "0"] in rows
    assert ["2", "17", "1.0 %", "2", "15"] in rows
    assert ["All", "30", "0.9 %", "15", "15"] in rows


def test_cameras_are_compared_before_and_after_they_were_moved(scan):
    page = scan_page(**scan)
    rows = rows_of(page)
    assert ["1 and 2", "777", "0.300", "0.100", "0.210", "−0.010", "0.050", "0.050"] in rows
    assert ["1", "None", "0.000", "–", "–", "0"] in rows
    assert ["2", "Rigid", "0.250", "0.400", "0.100", "5"] in rows
    assert "<li>Camera 2 &lt;script&gt;" in page
    alone = scan["quality"].model_copy(update={"fusion": FusionReport()})
    assert "No two cameras see the same skin" in scan_page(**scan | {"quality": alone})


def test_the_movement_of_the_foot_says_what_is_not_known(scan):
    swaying = MovementReport(tremor_mm=0.12, agreement=0.8, x_mm=[0.1], sway_mm=0.22, sway_by_axis_mm=(0.06, 0.21))
    page = scan_page(**{**scan, "quality": scan["quality"].model_copy(update={"movement": swaying})})
    for fact in ("0.12 mm, moved back", "Slow movement along Y", "0.21 mm"):
        assert fact in page
    assert "swayed slowly is not known" not in page
    moved_back = swaying.model_copy(update={"y_mm": [0.2]})
    page = scan_page(**{**scan, "quality": scan["quality"].model_copy(update={"movement": moved_back})})
    assert "0.21 mm, moved back" in page
    assert "swayed slowly is not known" in scan_page(**scan)


def test_the_glass_stands_with_its_deviations(scan):
    page = scan_page(**scan)
    facts = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page))
    assert facts["Height below the foot"].endswith("1.23 ± 0.012 mm")
    assert facts["Tilt about X"] == "0.25 ± 0.031 °"
    assert facts["Tilt about Y"] == "not shown"
    assert (facts["Contact"], facts["Stripes on it"]) == ("52.3 cm²", "77")
    unknown = scan["quality"].model_copy(update={"glass": GlassPlane()})
    assert "Not known from the sole" in scan_page(**{**scan, "quality": unknown})


def test_filled_parts_are_told_with_their_share(scan):
    page = scan_page(**scan)
    assert "Measured, 62.5 %" in page
    assert "Filled, 12.5 %" in page
    assert "Flat cut of the leg, 25.0 %" in page
    unknown = scan["quality"].mesh.model_copy(update={"filled_share": None, "cut_share": None})
    quality = scan["quality"].model_copy(update={"mesh": unknown})
    page = scan_page(**scan | {"surface": scan["surface"]._replace(filled=None), "quality": quality})
    assert "Measured," not in page


def test_provenance_and_mesh(scan):
    page = scan_page(**scan)
    assert ["extraction.method", "ridge"] in rows_of(page)
    assert facts_of(page)["Closed"] == "Yes"
    facts = facts_of(page)
    assert facts["Triangles"] == "4"
    assert (facts["Filled"], facts["Flat cut"]) == ("12.5 %", "25.0 %")
    assert (facts["Triangle quality"], facts["Of the worst 1 %"]) == ("0.91", "0.46")
    assert "Largest hole" not in facts


def test_the_calibration_stands_with_its_digest_and_a_picture(scan):
    page = scan_page(**scan)
    assert ["SHA-256", "12ab"] in rows_of(page)
    assert ["Made", "unknown"] in rows_of(page)
    assert 'aria-label="Camera 1: residuals and support"' in page


def test_the_check_of_the_calibration_stands_beside_it_and_a_doubt_among_the_warnings(scan):
    assert ["Check", "calibration was not checked"] in rows_of(scan_page(**scan))
    on = datetime.date(2026, 11, 24)
    steady = ScanCheck(checked=on, age_days=1, largest_mm=0.04)
    page = scan_page(**scan | {"quality": scan["quality"].model_copy(update={"calibration_check": steady})})
    assert ["Check", "checked on 2026-11-24, 1 day before the scan: every camera was within 0.04 mm"] in rows_of(page)
    moved = ScanCheck(checked=on, age_days=0, largest_mm=0.41, drifted=[2])
    quality = scan["quality"].model_copy(update={"calibration_check": moved})
    measures = scan["measures"].model_copy(update={"doubts": [moved.doubt]})
    page = scan_page(**scan | {"quality": quality, "measures": measures})
    assert ["Check", "checked on 2026-11-24: camera 2 had moved"] in rows_of(page)
    sentence = "Camera 2 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew."
    assert f"<li>{sentence} All measures are uncertain. Put the reference object" in page


@pytest.mark.parametrize("broken", [{"open_edges": 3}, {"non_manifold_edges": 1}])
def test_a_mesh_with_open_or_non_manifold_edges_is_not_closed(scan, broken):
    mesh = scan["quality"].mesh.model_copy(update=broken)
    page = scan_page(**scan | {"quality": scan["quality"].model_copy(update={"mesh": mesh})})
    assert facts_of(page)["Closed"] == "No"


def test_the_largest_hole_is_told(scan):
    mesh = scan["quality"].mesh.model_copy(update={"holes": 2, "open_edges": 9, "largest_hole_mm": 31.26})
    page = scan_page(**scan | {"quality": scan["quality"].model_copy(update={"mesh": mesh})})
    assert facts_of(page)["Largest hole"] == "31.3 mm around"


def test_the_comparison_stands_where_there_is_one(scan):
    truth = Comparison(
        mean=0.213, std=0.18, min=0, max=2.1, p50=0.17, p90=0.42, p95=0.61, p99=1.1, rms=0.28, signed_mean=-0.04
    )
    quality = scan["quality"].model_copy(update={"truth": truth})
    surface = scan["surface"]._replace(truth_distance=np.array([0.1, -0.2, 0.3, np.nan]))
    page = scan_page(**scan | {"quality": quality, "surface": surface})
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
            "title": ScanTitle(HOSTILE, HOSTILE, HOSTILE),
            "measures": scan["measures"].model_copy(update={"measures": {HOSTILE: measure}}),
            "quality": scan["quality"].model_copy(update={"cameras": [camera]}),
            "provenance": {HOSTILE: HOSTILE},
        }
    )
    assert "alert" in page
    assert page.count("<script") == scan_page(**scan).count("<script") == 2
    assert "<script>alert" not in page


def test_the_page_asks_for_nothing_from_elsewhere(scan):
    page = scan_page(**scan)
    assert not re.search(r"https?://|src\s*=(?!.data:image/)|@import|url\(|<link|<iframe", page, re.IGNORECASE)
    assert all(address.startswith("data:image/") for address in re.findall(r'href="([^"]*)"', page))
    assert "default-src 'none'" in page


class Balance(HTMLParser):
    """Stack of open tags; fails at a wrong end tag."""

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
    # The frames of scanner and foot differ by 10 mm in X and by the mirror that makes a right foot of a left one.
    mirrored = [[1, 0, 0, -10], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert upright(np.array([[30.0, 4.0, 5.0]]), mirrored).tolist() == [[20, 4, 5]]
    turned = [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]
    assert upright(np.array([[30.0, 4.0, 5.0]]), turned).tolist() == [[4, -30, 7]]

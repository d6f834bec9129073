"""A recorded scan becomes a measured foot whose true shape and measures are known."""

import hashlib
import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import open3d as o3d
import pytest
import trimesh
from bench_scan import STEP_MM

from footscan.virtual.foot.foot import make_foot

Footscan = Callable[..., CompletedProcess[str]]
FIGURES = {"mean", "std", "min", "max", "p50", "p90", "p95", "p99", "rms", "signed_mean"}


@pytest.fixture(scope="module")
def folder(measured: Path) -> Path:
    return measured / "results" / "P0001" / "small"


def test_delivers_its_files(folder: Path) -> None:
    names = {file.name for file in folder.iterdir()}
    assert names == {"cloud.ply", "foot.stl", "foot.ply", "measures.json", "sizes.json", "quality.json", "report.html"}


def test_the_surface_is_the_foot_in_millimetres(folder: Path) -> None:
    content = (folder / "foot.stl").read_bytes()
    assert len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")  # binary STL, nothing behind it
    mesh = trimesh.load_mesh(folder / "foot.stl")
    foot = make_foot(side="right")
    length, _, height = np.ptp(foot.vertices, axis=0)
    assert mesh.extents[0] == pytest.approx(length, abs=STEP_MM)  # heel and toes lie between two stripes
    assert mesh.extents[2] == pytest.approx(height, abs=1.5)
    assert mesh.bounds[0][2] == pytest.approx(0.0, abs=0.5)  # it stands on the glass
    assert mesh.is_winding_consistent
    whole = trimesh.Trimesh(foot.vertices, foot.faces)
    assert mesh.volume == pytest.approx(whole.volume, rel=0.1)  # positive: the faces look outward


def test_the_cloud_has_normals_and_cameras(folder: Path) -> None:
    cloud = trimesh.load(folder / "cloud.ply")
    read_again = o3d.io.read_point_cloud(str(folder / "cloud.ply"))
    assert len(cloud.vertices) == len(read_again.points) == _quality(folder)["cloud_points"]
    assert np.array_equal(np.asarray(read_again.points), np.asarray(cloud.vertices))
    assert np.linalg.norm(np.asarray(read_again.normals), axis=1) == pytest.approx(1.0, abs=1e-5)
    stripe_planes = np.asarray(cloud.vertices)[:, 0] / STEP_MM
    assert stripe_planes == pytest.approx(np.rint(stripe_planes), abs=1e-6)  # X is start_mm + k * step_mm
    camera = cloud.metadata["_ply_raw"]["vertex"]["data"]["camera"]
    assert set(np.unique(camera)) == set(range(1, 9))


def test_measures_are_those_of_the_foot(folder: Path) -> None:
    document = json.loads((folder / "measures.json").read_bytes())
    assert document["format"] == "footscan.measures/1"
    assert document["unit"] == "mm"
    assert document["side"] == "right"
    known = make_foot(side="right").measures
    length, breadth = (document["measures"][name] for name in ("foot_length", "foot_breadth"))
    print(f"length {length['value']} of {known['foot_length']}, breadth {breadth['value']} of {known['foot_breadth']}")
    assert length["unit"] == breadth["unit"] == "mm"
    for name, measure in (("foot_length", length), ("foot_breadth", breadth)):
        assert measure["value"] == pytest.approx(known[name], abs=3.0 * measure["uncertainty"])
    assert length["uncertainty"] > 0.5  # with so few frames, the ends lie between stripes
    assert length["value"] == pytest.approx(known["foot_length"], abs=3.0)
    assert breadth["value"] == pytest.approx(known["foot_breadth"], abs=2.0)


def test_the_surface_is_close_to_the_truth(measured: Path, folder: Path) -> None:
    quality = _quality(folder)
    print(f"mean distance {quality['truth']['mean']:.3f} mm, 99 % below {quality['truth']['p99']:.3f} mm")
    assert quality["format"] == "footscan.quality/1"
    assert quality["truth"]["mean"] < 0.35
    assert quality["mesh"]["components"] == 1
    digest = hashlib.sha256((measured / "calibration.json").read_bytes()).hexdigest()
    assert (quality["calibration"]["name"], quality["calibration"]["sha256"]) == ("calibration.json", digest)
    assert [camera["camera"] for camera in quality["cameras"]] == list(range(1, 9))


def test_compare_tells_the_same_distances(footscan: Footscan, measured: Path, folder: Path) -> None:
    truth = measured / "archive" / "P0001" / "small" / "truth.stl"
    done = footscan("compare", folder / "foot.stl", truth, "--json")
    comparison = json.loads(done.stdout)
    assert done.returncode == 0
    assert set(comparison) >= {"unit", "transform"} | FIGURES
    assert comparison["unit"] == "mm"
    assert comparison["transform"] is None
    of_the_run = _quality(folder)["truth"]
    assert comparison["mean"] == pytest.approx(of_the_run["mean"], rel=0.02)
    table = footscan("compare", folder / "foot.stl", truth).stdout
    assert all(figure in table for figure in FIGURES)


def test_measure_tells_the_same_measures(footscan: Footscan, folder: Path, tmp_path: Path) -> None:
    done = footscan("measure", folder / "foot.stl", "--side", "right", "--json", "--out", tmp_path / "measures.json")
    of_the_run = json.loads((folder / "measures.json").read_bytes())
    assert done.returncode == 0
    assert json.loads(done.stdout) == json.loads((tmp_path / "measures.json").read_bytes())
    # foot.stl holds single precision: 262 mm to 0.00002 mm
    for name, measure in json.loads(done.stdout)["measures"].items():
        assert measure["value"] == pytest.approx(of_the_run["measures"][name]["value"], abs=0.1), name


def test_the_report_needs_nothing_else(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    links = _Links()
    links.feed(page)
    assert not [link for link in links.found if not link.startswith(("data:", "#"))]
    assert "@import" not in page
    assert sum(link.startswith("data:image/") for link in links.found) >= 8  # a frame of each camera
    for shown in ("P0001", "small", "262", "calibration.json"):
        assert shown in page


class _Links(HTMLParser):
    """What a page refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        del tag
        self.found += [value or "" for name, value in attrs if name in {"src", "href", "srcset", "data", "poster"}]


def _quality(folder: Path) -> dict[str, object]:
    return json.loads((folder / "quality.json").read_bytes())

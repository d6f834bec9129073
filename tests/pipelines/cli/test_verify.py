"""`footscan verify`: what it prints and refuses."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from footscan.cloud.points import coordinates, make_points
from footscan.mesh.formats.ply import ply_of
from footscan.mesh.mesh import Mesh
from pipelines.archive.job import CACHE
from pipelines.arrays import pack
from pipelines.cli.main import run_command
from pipelines.engine.store.store import Row, open_store
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap

Verify = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def verify(capsys: pytest.CaptureFixture[str]) -> Verify:
    """Exit status, standard output and the lines of standard error of `footscan verify ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["verify", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err.splitlines()

    return run


@pytest.fixture
def block(tmp_path: Path) -> Path:
    """A block of 60.5 x 40 x 20.2 mm that lies on its side, as an STL file."""
    mesh = trimesh.creation.box(extents=(40.0, 20.2, 60.5))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.4, [0, 0, 1]))
    mesh.export(tmp_path / "block.stl")
    return tmp_path / "block.stl"


def test_a_block_beside_its_nominal_dimensions(verify: Verify, block: Path) -> None:
    status, out, err = verify("block", block, "--nominal", "60x40x20", "--json")
    assert (status, err) == (0, [])
    document = json.loads(out)
    rows = document["table_6_1"]
    assert [row["nominal_mm"] for row in rows] == [60, 40, 20]
    assert [row["value_mm"] for row in rows] == pytest.approx([60.5, 40, 20.2], abs=1e-4)
    assert [row["error_mm"] for row in rows] == pytest.approx([0.5, 0, 0.2], abs=1e-4)
    assert [row["thesis_mm"] for row in rows] == [None] * 3  # it had another block
    assert document["fit"]["unit"] == "mm"
    assert len(document["fit"]["faces"]) == 6
    status, out, _ = verify("block", block, "--nominal", "60x40x20")
    assert status == 0
    assert "+0.500" in out
    assert "60.500" in out


def test_the_thesis_stands_beside_its_own_block(verify: Verify, tmp_path: Path) -> None:
    trimesh.creation.box(extents=(150.0, 100.0, 50.0)).export(tmp_path / "foot.stl")
    status, out, _ = verify("block", tmp_path, "--json")  # a folder of results without a cloud
    assert status == 0
    rows = json.loads(out)["table_6_1"]
    assert [(row["nominal_mm"], row["thesis_mm"]) for row in rows] == [(150, 151.2), (100, 102.0), (50, 51.4)]
    assert [row["error_mm"] for row in rows] == pytest.approx([0, 0, 0], abs=1e-4)


def test_of_results_the_cloud_is_taken(verify: Verify, tmp_path: Path) -> None:
    points = trimesh.creation.box(extents=(90.0, 60.0, 30.0)).sample(20_000, seed=1)
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    trimesh.creation.box(extents=(150.0, 100.0, 50.0)).export(tmp_path / "foot.stl")
    status, out, _ = verify("block", tmp_path, "--nominal", "90x60x30", "--json")
    assert status == 0
    assert [row["value_mm"] for row in json.loads(out)["table_6_1"]] == pytest.approx([90, 60, 30], abs=1e-3)


def test_what_cameras_saw_before_the_fusion_is_taken_from_the_store(verify: Verify, tmp_path: Path) -> None:
    # A block of 60 x 40 x 30 mm, square to the travel, with whole stripes every 2 mm: that nothing displaces the last
    # ones says that both ends are out of their reach.
    y, z = np.linspace(-20, 20, 81), np.linspace(0, 30, 61)
    around = [np.column_stack([y, np.full(81, 30.0)]), *(np.column_stack([np.full(61, side), z]) for side in (-20, 20))]
    ring = np.concatenate(around)
    x = np.repeat(np.arange(0, 60, 2.0), len(ring))
    seen = make_points(np.column_stack([x, np.tile(ring, (30, 1))]), camera=1)

    results = tmp_path / "results" / "P1" / "block"
    results.mkdir(parents=True)
    cloud = ply_of(Mesh(coordinates(seen), np.zeros((0, 3), np.int32)))
    (results / "cloud.ply").write_bytes(cloud)
    table = ("block", results, "--nominal", "60x40x30", "--json")
    _, out, _ = verify(*table)
    alone = json.loads(out)["table_6_1"][0]

    a_map = PolynomialMap(order=1, centre_px=(320, 240), scale_px=400, alpha_y=[0, 200, 0], alpha_z=[100, 0, -200])
    camera = CameraCalibration(camera=1, map=a_map, region_px=[], points=9)
    calibration = Calibration(sources=[], software="footscan", cameras=[camera]).model_dump_json().encode()
    (tmp_path / "results" / CACHE).mkdir()
    store = open_store(tmp_path / "results" / CACHE)
    inputs = {"calibration": ["value", store.put(calibration)]}
    store.record("P1/block/clean", Row({"step": "clean", "inputs": inputs}, store.put(pack(points=seen))))
    store.record("P1/block/cloud.ply", Row({"step": "cloud.ply", "inputs": {}}, store.put(cloud)))
    status, out, _ = verify(*table)
    assert status == 0
    informed = json.loads(out)["table_6_1"][0]
    assert informed["ends"] == alone["ends"] == ["stripes", "stripes"]
    assert informed["uncertainty_mm"] < 0.7 * alone["uncertainty_mm"]

    # Of another cloud than that of the store nothing is known.
    (results / "cloud.ply").write_bytes(ply_of(Mesh(coordinates(seen[1:]), np.zeros((0, 3), np.int32))))
    _, out, _ = verify(*table)
    assert json.loads(out)["table_6_1"][0]["uncertainty_mm"] == pytest.approx(alone["uncertainty_mm"], rel=1e-3)


def test_spheres_in_several_files(verify: Verify, tmp_path: Path) -> None:
    for k in range(2):
        ball = trimesh.creation.icosphere(subdivisions=4, radius=20.0 + k / 10)
        ball.apply_translation([50 * k, 0, 20])
        ball.export(tmp_path / f"{k}.ply")
    files = [tmp_path / "0.ply", tmp_path / "1.ply"]
    status, out, err = verify("sphere", *files, "--diameter", 40, "--json")
    assert (status, err) == (0, [])
    found = json.loads(out)
    assert [fit["file"] for fit in found] == list(map(str, files))
    assert [fit["diameter_error_mm"] for fit in found] == pytest.approx([0, 0.2], abs=0.1)  # triangles are flat
    status, out, _ = verify("sphere", *files, "--diameter", 40)
    assert status == 0
    assert "Worst of 2: error of diameter +0.1" in out


def test_findings_are_one_line(verify: Verify, tmp_path: Path, block: Path) -> None:
    trimesh.creation.icosphere(radius=50.0).export(tmp_path / "ball.stl")
    status, out, err = verify("block", tmp_path / "ball.stl")
    assert (status, out, len(err)) == (1, "", 1)
    assert "ball.stl" in err[0]
    assert "cuboid" in err[0]
    status, out, err = verify("sphere", block, "--diameter", 40)
    assert (status, out, len(err)) == (1, "", 1)
    assert "no sphere of about 40 mm" in err[0]


@pytest.mark.parametrize("nominal", ["150x100", "axbxc", "150x100x0", "nanx1x1", "150x100x50x2", ""])
def test_wrong_dimensions_are_refused(verify: Verify, block: Path, nominal: str) -> None:
    status, out, err = verify("block", block, "--nominal", nominal)
    assert (status, out, len(err)) == (2, "", 1)
    assert "--nominal" in err[0]


@pytest.mark.parametrize("sheet", [("0.6", "0.2"), ("-1", "0.2"), ("0.2", "9"), ("nan", "nan")])
def test_a_sheet_that_cannot_be_is_refused(verify: Verify, block: Path, sheet: tuple[str, str]) -> None:
    status, out, err = verify("block", block, "--sheet-mm", *sheet)
    assert (status, out, len(err)) == (2, "", 1)
    assert "--sheet-mm" in err[0]


def test_a_folder_without_results_is_refused(verify: Verify, tmp_path: Path) -> None:
    status, out, err = verify("block", tmp_path)
    assert (status, out) == (2, "")
    assert err == [f"footscan: {tmp_path}: holds neither cloud.ply nor foot.stl, expected the results of a scan"]

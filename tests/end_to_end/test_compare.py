"""`footscan compare`, as it is used beside a reference model."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import trimesh
from PIL import Image

from footscan.virtual.foot.foot import make_foot

Footscan = Callable[..., CompletedProcess[str]]
TURN = np.deg2rad(100)
MOTION = np.array(
    [[np.cos(TURN), -np.sin(TURN), 0, 30], [np.sin(TURN), np.cos(TURN), 0, -400], [0, 0, 1, 10], [0, 0, 0, 1]]
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A foot, the same 0.2 mm thicker, a cloud of it with normals, the thick one moved, and odd clouds."""
    folder = tmp_path_factory.mktemp("shapes")
    made = make_foot(resolution_mm=3.0)
    foot = trimesh.Trimesh(made.vertices, made.faces, process=False)
    foot.export(folder / "foot.stl")
    thick = foot.copy()
    thick.vertices += 0.2 * foot.vertex_normals
    thick.export(folder / "thick.stl")
    normals = np.asarray(foot.vertex_normals)
    (folder / "cloud.ply").write_bytes(_cloud(np.asarray(thick.vertices), normals))
    (folder / "inner.ply").write_bytes(_cloud(made.vertices, normals))
    (folder / "blind.ply").write_bytes(_cloud(np.asarray(thick.vertices), normals * 0))
    thick.apply_transform(MOTION).export(folder / "moved.stl")
    (folder / "one.ply").write_bytes(_cloud(np.zeros((1, 3)), np.array([[0.0, 0, 1]])))
    (folder / "doubled.ply").write_bytes(_cloud(np.zeros((9, 3)), np.tile([0.0, 0, 1], (9, 1))))
    flat = np.random.default_rng(0).uniform(0, 200, (5000, 3)) * [1, 1, 0]
    (folder / "flat.ply").write_bytes(_cloud(flat, np.tile([0.0, 0, 1], (5000, 1))))
    trimesh.creation.icosphere(radius=60.0).export(folder / "ball.stl")
    return folder


def _cloud(points: np.ndarray, normals: np.ndarray) -> bytes:
    lines = [" ".join(f"{value:.6f}" for value in row) for row in np.column_stack([points, normals])]
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n{names}end_header\n"
    return (header + "\n".join(lines) + "\n").encode()


def test_everything_at_once(footscan: Footscan, folder: Path, tmp_path: Path) -> None:
    files = {"--csv": "c.csv", "--mesh": "m.ply", "--pictures": "views", "--report": "r.html"}
    options = [part for option, name in files.items() for part in (option, tmp_path / name)]
    done = footscan("compare", folder / "thick.stl", folder / "foot.stl", "--both", "--classes", 8, "--json", *options)
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["unit"] == "mm"
    assert found["transform"] is None
    assert found["mean"] == pytest.approx(0.2, abs=0.02)
    assert found["signed_mean"] == pytest.approx(found["mean"], abs=0.002)
    assert [region["region"] for region in found["regions"]] == ["sole", "heel", "midfoot", "ball", "toes", "ankle"]
    assert [(classes["signed"], len(classes["counts"])) for classes in found["histograms"]] == [(False, 8), (True, 8)]
    assert found["completeness"]["within_share"] == 1
    assert found["completeness"]["signed_mean"] == pytest.approx(-found["signed_mean"], abs=0.01)

    rows = list(csv.DictReader((tmp_path / "c.csv").read_text().splitlines()))
    assert float(rows[0]["mean"]) == found["mean"]
    assert len(rows) == 2 * (1 + 6) + 2 * 8
    mesh = trimesh.load(tmp_path / "m.ply", process=False)
    assert mesh.metadata["_ply_raw"]["vertex"]["data"]["distance"].mean() == pytest.approx(0.2, abs=0.02)
    assert sorted(path.name for path in (tmp_path / "views").iterdir()) == [
        *("above.png", "below.png", "left.png", "right.png")
    ]
    with Image.open(tmp_path / "views" / "above.png") as picture:
        assert picture.width > 700
    assert "thick.stl <span>to foot.stl</span>" in (tmp_path / "r.html").read_text()


def test_the_table_has_seventy_classes_less(footscan: Footscan, folder: Path) -> None:
    done = footscan("compare", folder / "thick.stl", folder / "foot.stl", "--both")
    assert done.returncode == 0
    assert "thick.stl to foot.stl, mm" in done.stdout
    assert "Regions of the foot, mm" in done.stdout
    assert "100.00 % of foot.stl is within 1 mm of thick.stl" in done.stdout
    assert len(json.loads(footscan("compare", *done.args[1:3], "--json").stdout)["histograms"][0]["counts"]) == 70


def test_clouds_have_a_sign_where_their_normals_are_known(footscan: Footscan, folder: Path) -> None:
    to_mesh = footscan("compare", folder / "cloud.ply", folder / "foot.stl", "--json")
    to_cloud = footscan("compare", folder / "cloud.ply", folder / "inner.ply", "--json")
    assert json.loads(to_mesh.stdout)["signed_mean"] == pytest.approx(0.2, abs=0.02)
    assert json.loads(to_cloud.stdout)["signed_mean"] == pytest.approx(0.2, abs=0.001)
    blind = footscan("compare", folder / "foot.stl", folder / "blind.ply", "--json")
    assert (json.loads(blind.stdout)["signed_mean"], blind.returncode) == (None, 0)
    assert blind.stderr == f"{folder / 'blind.ply'}: has normals that are no unit vectors, which are not used\n"


def test_registration_tells_what_was_moved(footscan: Footscan, folder: Path, tmp_path: Path) -> None:
    apart = footscan("compare", folder / "moved.stl", folder / "foot.stl", "--json")
    assert json.loads(apart.stdout)["mean"] > 100
    [line] = apart.stderr.splitlines()
    assert line.startswith("moved.stl and foot.stl do not overlap, they are ")
    assert line.endswith("--register moves the first onto the second")

    report = tmp_path / "r.html"
    done = footscan("compare", folder / "moved.stl", folder / "foot.stl", "--register", "--json", "--report", report)
    found = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (0, "")
    assert found["mean"] == pytest.approx(0.2, abs=0.03)
    np.testing.assert_allclose(np.array(found["transform"]) @ MOTION, np.eye(4), atol=0.1)
    assert found["registration"]["after"]["rms"] < found["registration"]["before"]["rms"]
    assert "<h2>Registration</h2>" in report.read_text()


def test_a_ball_cannot_be_registered(footscan: Footscan, folder: Path, mistake: Callable[..., str]) -> None:
    done = footscan("compare", folder / "ball.stl", folder / "ball.stl", "--register", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert mistake(done).startswith(f"{folder / 'ball.stl'}: cannot be registered: ")


@pytest.mark.parametrize("name", ["one.ply", "doubled.ply"])
def test_a_single_place_is_no_reference(
    footscan: Footscan, folder: Path, mistake: Callable[..., str], name: str
) -> None:
    for arguments in ((folder / "foot.stl", folder / name), (folder / name, folder / "foot.stl", "--both")):
        done = footscan("compare", *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert mistake(done) == f"{folder / name}: is a single point, expected a mesh or a cloud"


def test_a_flat_cloud_is_compared_and_drawn(footscan: Footscan, folder: Path, tmp_path: Path) -> None:
    arguments = folder / "flat.ply", folder / "foot.stl", "--report", tmp_path / "r.html", "--pictures", tmp_path / "p"
    assert footscan("compare", *arguments).returncode == 0
    assert footscan("compare", folder / "ball.stl", folder / "flat.ply", "--json").returncode == 0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--classes", "0"], "Invalid value for '--classes'"),
        (["--classes", "ten"], "Invalid value for '--classes'"),
        (["--mesh", "m.stl"], "m.stl: --mesh: expected a file that ends in .ply"),
        (["--csv", "foot.stl"], "foot.stl: is an input"),
        (["--report", "."], ".: is a folder"),
        (["--pictures", "ball.stl"], "ball.stl: is a file, expected a folder for pictures"),
    ],
)
def test_a_wrong_use_is_told_in_one_line(
    footscan: Footscan,
    folder: Path,
    mistake: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    told: str,
) -> None:
    monkeypatch.chdir(folder)
    before = (folder / "foot.stl").read_bytes()
    done = footscan("compare", "thick.stl", "foot.stl", *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert told in mistake(done)
    assert (folder / "foot.stl").read_bytes() == before

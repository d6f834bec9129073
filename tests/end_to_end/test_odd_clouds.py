"""Clouds that are no foot's, through the steps and through the commands: a finding or a result, and never a crash."""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import bench_scan
import numpy as np
import pytest
import trimesh

from footscan.cloud.outliers.remove import KEPT
from footscan.cloud.points import POINT_DTYPE, make_points
from footscan.mesh.formats.ply import ply_of
from footscan.mesh.mesh import Mesh
from footscan.sizing.table import read_table
from footscan.stripe.points import STRIPE_DTYPE
from footscan.surface.quality import mesh_quality
from pipelines.arrays import pack, unpack
from pipelines.steps import (
    deviations,
    fuse,
    measure,
    orient,
    pictures,
    quality,
    report,
    sizes_json,
    surface,
    verify,
)
from schemas.base.errors import Finding
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap, Source
from schemas.frames import FrameManifest
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.movement import MovementReport
from schemas.parameters.delivery import SizesParameters
from schemas.parameters.foot import MeasureParameters
from schemas.parameters.fusion import FusionParameters
from schemas.parameters.normals import NormalParameters
from schemas.parameters.surface import SurfaceParameters
from schemas.quality import Quality

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
Cloud = np.ndarray
FRAMES = 40
SEMI_AXES = np.array([40.0, 25.0, 20.0])
"""Of an egg that stands on the glass."""


def egg(cameras: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8)) -> Cloud:
    """Two points each mm of stripes 2 mm apart; each camera sees the side on which it stands."""
    parts = []
    for frame, x in enumerate(np.arange(FRAMES) * 2.0 - 39.0):
        size = np.sqrt(1 - (x / SEMI_AXES[0]) ** 2)
        angle = np.linspace(0, 2 * np.pi, int(300 * size) + 8, endpoint=False)
        y, z = SEMI_AXES[1] * size * np.cos(angle), SEMI_AXES[2] * (1 + size * np.sin(angle))
        for camera in cameras:
            # Of the first four, above the glass, two stand on either side; so do the others, below it.
            seen = (np.sin(angle) > -0.5 if camera <= 4 else np.sin(angle) < 0.5) & (
                np.cos(angle) > -0.3 if camera in (1, 2, 5, 6) else np.cos(angle) < 0.3
            )
            places = np.column_stack([np.full(seen.sum(), x), y[seen], z[seen]])
            parts.append(make_points(places, camera, frame, np.arange(len(places))))
    return np.concatenate(parts)


def spoilt(**values: float) -> Cloud:
    """The egg, some of its coordinates all alike."""
    cloud = egg()
    for axis, value in values.items():
        cloud[axis] = value
        if axis == "x":
            cloud["plane"] = value
    return cloud


def with_nan(every: int) -> Cloud:
    cloud = egg()
    cloud["z"][::every] = np.nan
    return cloud


NO_SURFACE = {
    "empty": lambda: np.zeros(0, POINT_DTYPE),
    "one point": lambda: egg()[:1],
    "one point, doubled": lambda: np.repeat(egg()[:1], 500),
    "one stripe": lambda: egg()[egg()["frame"] == 20],
    "in the plane of a stripe": lambda: spoilt(x=7.0),
    "on a line": lambda: spoilt(y=3.0, z=9.0),
    "NaN alone": lambda: with_nan(1),
    "far away": lambda: spoilt(x=3e38),
}
SHEETS = {"upright": lambda: spoilt(y=3.0), "on the glass": lambda: spoilt(z=0.0)}
SURFACE = {
    "doubled": lambda: np.repeat(egg(), 2),
    "with NaN": lambda: with_nan(17),
    "of four cameras": lambda: egg((1, 3, 5, 7)),
}


@pytest.fixture(scope="module")
def calibration() -> bytes:
    """Of a camera that is none of the scan's: normals are then told by the middle of the cloud."""
    a_map = PolynomialMap(order=1, centre_px=(320, 240), scale_px=400, alpha_y=[0, 200, 0], alpha_z=[100, 0, -200])
    camera = CameraCalibration(camera=9, map=a_map, region_px=[], points=9)
    return Calibration(sources=[], software="footscan", cameras=[camera]).model_dump_json().encode()


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    mesh = trimesh.creation.icosphere(4)
    mesh.apply_scale(SEMI_AXES)
    mesh.apply_translation([0, 0, SEMI_AXES[2]])
    path = tmp_path_factory.mktemp("truth") / "egg.stl"
    mesh.export(path)
    return path


def meshed(cloud: Cloud, calibration: bytes, parameters: SurfaceParameters) -> dict[str, bytes]:
    """The results of the steps up to the surface."""
    nothing = {
        "removed": "{}", "warnings": "[]", "heads": "{}",
        "glass": GlassPlane().model_dump_json(), "movement": MovementReport().model_dump_json(),
    }  # fmt: skip
    reports = {name: np.frombuffer(text.encode(), np.uint8) for name, text in nothing.items()}
    codes = np.full(len(cloud), KEPT, np.uint8)
    contested, parted = np.array([np.inf, -np.inf]), np.full(len(cloud), np.inf, np.float32)
    clean = pack(points=cloud, codes=codes, lasers=np.zeros((2, 6)), contested=contested, parted=parted, **reports)
    fused = fuse.run({"clean": clean}, FusionParameters(), {})
    oriented = orient.run({"fused": fused, "calibration": calibration}, NormalParameters(), {})
    return {
        "heads": HeadsReport().model_dump_json().encode(), "clean": clean, "fused": fused, "oriented": oriented,
        "surface": surface.run({"oriented": oriented}, parameters, {}),
    }  # fmt: skip


@pytest.mark.parametrize("method", ["closed", "ball_pivoting"])
@pytest.mark.parametrize("name", NO_SURFACE)
def test_no_surface_is_a_finding(name: str, method: str, calibration: bytes) -> None:
    with pytest.raises(Finding, match=r"^[^\n]+$"):
        meshed(NO_SURFACE[name](), calibration, SurfaceParameters.model_validate({"method": method}))


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_is_closed_by_none_of_the_methods(name: str, calibration: bytes) -> None:
    with pytest.raises(Finding, match="do not surround a solid"):
        meshed(SHEETS[name](), calibration, SurfaceParameters())
    pivoted = unpack(meshed(SHEETS[name](), calibration, SurfaceParameters(method="ball_pivoting"))["surface"])
    assert mesh_quality(pivoted["vertices"], pivoted["faces"]).open_edges > 0


@pytest.mark.parametrize("name", SURFACE)
def test_a_surface_is_verified_and_reported(name: str, calibration: bytes, truth: Path) -> None:
    cloud = SURFACE[name]()
    done = meshed(cloud, calibration, SurfaceParameters())
    verified = verify.run({"surface": done["surface"]}, None, {"truth": truth})
    side = MeasureParameters(side="unknown")
    measures = measure.run(done, side, {})
    manifest = FrameManifest(encoding="image", height=480, width=640, frames=["0" * 64] * FRAMES)
    of_cameras: dict[str, bytes] = {}
    for camera in np.unique(cloud["camera"]).tolist():
        of_cameras |= {
            f"stripe-{camera}": pack(stripe=np.zeros(0, STRIPE_DTYPE), lost=np.zeros(0, np.int64)),
            f"manifest-{camera}": manifest.model_dump_json().encode(),
            f"points-{camera}": pack(points=cloud[cloud["camera"] == camera]),
        }
    source = Source(name="calibration.json", sha256="0" * 64).model_dump_json().encode()
    qualities = quality.run(done | of_cameras | {"calibration": source, "verified": verified}, None, {})
    found = Quality.model_validate_json(qualities)
    assert (found.mesh.open_edges, found.mesh.non_manifold_edges, found.mesh.components) == (0, 0, 1)
    assert found.truth is not None
    assert found.truth.mean < 0.2
    about = {"patient": "P0001", "scan": "egg", "provenance": {}}
    shown = {"measures": measures, "quality": qualities, "verified": verified, "about": json.dumps(about).encode()}
    table = read_table().model_dump_json().encode()
    shown["sizes"] = sizes_json.run({"measures": measures, "table": table}, SizesParameters(), {})
    shown |= {"pictures": pictures.run(done | of_cameras, None, {}), "deviations": deviations.run(done, None, {})}
    page = report.run(done | shown | {"calibration": calibration}, side, {})
    assert b"Distance to the reference model" in page
    assert len(unpack(done["surface"])["vertices"]) == found.mesh.vertices


FILES = {
    "empty": np.zeros((0, 3)),
    "one": np.array([[10.0, 20.0, 30.0]]),
    "doubled": np.tile([10.0, 20.0, 30.0], (2000, 1)),
    "line": np.column_stack([np.linspace(0, 200, 2000), np.zeros((2000, 2))]),
    "plane": np.random.default_rng(0).uniform(0, 200, (2000, 3)) * [1, 1, 0],
    "nan": np.array([[0, 0, 0], [np.nan, 1, 1], [100, 0, 0], [0, 100, 0]]),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Each of the odd clouds, each with a triangle as a mesh, and a box."""
    folder = tmp_path_factory.mktemp("odd")
    for name, points in FILES.items():
        (folder / f"{name}.ply").write_bytes(ply_of(Mesh(points, np.zeros((0, 3), np.int32))))
        corners = np.arange(3, dtype=np.int32)[None] % max(len(points), 1)
        (folder / f"{name}-mesh.ply").write_bytes(ply_of(Mesh(points, corners)))
    trimesh.creation.box((100.0, 50.0, 30.0)).export(folder / "box.stl")
    return folder


@pytest.mark.parametrize("name", [*FILES, *(f"{name}-mesh" for name in FILES)])
def test_odd_files_are_refused_or_a_finding(footscan: Footscan, mistake: Mistake, folder: Path, name: str) -> None:
    file = folder / f"{name}.ply"
    for command, statuses in (
        (("verify", "block", file), {1, 2}),
        (("verify", "sphere", file, "--diameter", 40), {1, 2}),
        (("compare", file, folder / "box.stl", "--register"), {2}),
        (("compare", folder / "box.stl", file, "--register"), {2}),
    ):
        done = footscan(*command)
        assert done.returncode in statuses, command
        assert done.stdout == ""
        assert mistake(done).startswith(str(file))


@pytest.mark.parametrize("name", [*FILES, *(f"{name}-mesh" for name in FILES)])
def test_no_odd_file_is_exported_as_a_closed_mesh(
    footscan: Footscan, mistake: Mistake, folder: Path, name: str
) -> None:
    out = folder / f"{name}.stl"
    done = footscan("export", folder / f"{name}.ply", "--out", out)
    if done.returncode == 0:
        assert name in ("line-mesh", "plane-mesh")  # three points apart are a triangle
        assert "is not closed: 3 open edges" in done.stderr
    else:
        assert (done.returncode, done.stdout) == (2, "")
        assert mistake(done).startswith(str(folder / f"{name}.ply"))
    assert out.exists() == (done.returncode == 0)


@pytest.mark.parametrize("name", [*FILES, *(f"{name}-mesh" for name in FILES)])
def test_odd_files_are_compared_or_refused(footscan: Footscan, mistake: Mistake, folder: Path, name: str) -> None:
    file = folder / f"{name}.ply"
    for pair in ((file, folder / "box.stl"), (folder / "box.stl", file)):
        done = footscan("compare", *pair, "--both", "--json")
        if done.returncode == 0:
            assert json.loads(done.stdout)["mean"] >= 0
        else:
            assert (done.returncode, done.stdout) == (2, "")
            assert file.name in mistake(done)


@pytest.mark.parametrize(
    ("zeroed", "said"),
    [
        (("alpha_y",), "points do not surround a solid"),
        (
            ("alpha_y", "alpha_z"),
            f"{bench_scan.FRAMES} points in planes {bench_scan.STEP_MM:g} mm apart, expected a cloud to mesh",
        ),
    ],
    ids=["plane", "line"],
)
def test_a_scan_that_is_mapped_to_a_plane_or_a_line_is_a_finding(
    footscan: Footscan, mistake: Mistake, bench: Path, zeroed: tuple[str, ...], said: str
) -> None:
    calibration = json.loads((bench / "calibration.json").read_bytes())
    flat = {"model": "polynomial", "order": 1, "centre_px": [320, 240], "scale_px": 400}
    for camera in calibration["cameras"]:
        camera |= {"map": flat | {"alpha_y": [0, 100, 0], "alpha_z": [50, 0, -50]}, "covariance": [], "residuals": []}
        for name in zeroed:
            camera["map"][name] = [0, 0, 0]
    (bench / "calibration.json").write_text(json.dumps(calibration))
    done = footscan("run", bench / "workflow.yaml")
    assert (done.returncode, done.stdout) == (1, "")
    line = mistake(done)
    assert "P0001/small" in line
    assert said in line


def test_a_scan_of_one_camera_that_sees_one_side_is_a_finding(
    footscan: Footscan, mistake: Mistake, bench: Path
) -> None:
    document = bench / "archive/P0001/small/scan.yaml"
    lines = document.read_text().splitlines()
    document.write_text("\n".join(line for line in lines if "{id: " not in line or "{id: 2," in line) + "\n")
    done = footscan("run", bench / "workflow.yaml")
    assert (done.returncode, done.stdout) == (1, "")
    line = mistake(done)
    assert "P0001/small" in line
    assert "points do not surround a solid" in line

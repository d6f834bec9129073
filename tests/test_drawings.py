"""The drawings of docs/build follow the rig, and the reference object is a closed body."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from footscan.mesh.formats.files import read_mesh
from footscan.mesh.topology import edge_counts
from footscan.virtual.optics.scanner import standard_scanner
from schemas.base.yaml_files import read_yaml
from schemas.rig import Rig

BUILD = Path(__file__).parents[1] / "docs" / "build"
TWO_CAMERAS = """\
format: footscan.rig/1
scanner: S2
port: /dev/ttyUSB0
travel: {length_mm: 350}
cameras:
  - {id: 1, device: /dev/video0}
  - {id: 9, device: /dev/video2, head: 3, stands: [below, right, behind]}
"""


@pytest.fixture(scope="module")
def drawings() -> ModuleType:
    spec = importlib.util.spec_from_file_location("drawings", BUILD / "drawings.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def drawn(drawings: ModuleType, monkeypatch: pytest.MonkeyPatch, *arguments: Path) -> None:
    monkeypatch.setattr("sys.argv", ["drawings.py", *map(str, arguments)])
    drawings.main()


def test_the_drawings_beside_the_page_are_current(
    drawings: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    drawn(drawings, monkeypatch, BUILD / "rig.yaml", tmp_path)

    for name in ("front.svg", "side.svg", "above.svg", "reference.svg", "reference.stl"):
        assert (tmp_path / name).read_bytes() == (BUILD / name).read_bytes(), f"{name}: run docs/build/drawings.py"
    assert (tmp_path / "front.pdf").read_bytes().startswith(b"%PDF")


def test_another_rig_changes_them(drawings: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(TWO_CAMERAS)

    drawn(drawings, monkeypatch, tmp_path / "rig.yaml", tmp_path)

    assert (tmp_path / "side.svg").read_bytes() != (BUILD / "side.svg").read_bytes()
    stand = drawings.stand_of(read_yaml(tmp_path / "rig.yaml", Rig).cameras[1])
    assert (stand.below, stand.left, stand.front) == (True, False, False)


def test_cameras_stand_where_those_of_the_virtual_scanner_do(drawings: ModuleType) -> None:
    scanner = standard_scanner()
    for camera in read_yaml(BUILD / "rig.yaml", Rig).cameras:
        place, _ = drawings.nominal_place(drawings.stand_of(camera))
        assert np.linalg.norm(place - scanner.camera(camera.id).position) < 8.0


def test_the_reference_object_is_closed_and_has_its_volume() -> None:
    vertices, faces = read_mesh(BUILD / "reference.stl")

    assert np.all(edge_counts(faces)[1] == 2)
    corners = vertices[faces]
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(80.0 * (40 * 100 + 2 * 30 * 40), rel=1e-6)

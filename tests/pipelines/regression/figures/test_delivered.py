"""Figures of delivered files."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.mesh.formats.ply import ply_of
from footscan.mesh.formats.stl import stl_bytes
from footscan.mesh.mesh import Mesh
from pipelines.arrays import pack
from pipelines.regression.figures.delivered import delivered_figures

VERTICES = np.random.default_rng(3).uniform(-100.0, 250.0, (60, 3))
FACES = np.arange(60).reshape(20, 3)
SURFACE = {"surface": pack(vertices=VERTICES, faces=FACES)}


def deliver(folder: Path, vertices: NDArray[np.float64], faces: NDArray[np.int64] = FACES) -> None:
    (folder / "foot.stl").write_bytes(stl_bytes(vertices, faces, "footscan unit=mm side=right"))
    (folder / "foot.ply").write_bytes(ply_of(Mesh(vertices, faces)))


def test_files_that_hold_what_was_measured(tmp_path: Path) -> None:
    deliver(tmp_path, VERTICES)
    figures = delivered_figures(tmp_path, SURFACE)
    assert figures.keys() == {"files.foot.stl_off_mm", "files.foot.ply_off_mm"}
    assert all(value is not None and value < 5e-5 for value in figures.values())  # of float32


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (VERTICES / 1000, FACES),
        (VERTICES[:, [0, 2, 1]], FACES),
        (VERTICES * [1.0, 1.0, -1.0], FACES),
        (VERTICES + np.array([0.0, 0.002, 0.0]), FACES),
        (VERTICES[:-3], FACES[:-1]),
    ],
)
def test_files_that_do_not(vertices: NDArray[np.float64], faces: NDArray[np.int64], tmp_path: Path) -> None:
    deliver(tmp_path, vertices, faces)
    figures = delivered_figures(tmp_path, SURFACE)
    assert all(value is not None and value > 0.0015 for value in figures.values())


def test_a_file_that_is_not_there_or_broken_has_no_figure(tmp_path: Path) -> None:
    (tmp_path / "foot.stl").write_bytes(b"solid")
    assert delivered_figures(tmp_path, SURFACE) == {"files.foot.stl_off_mm": None, "files.foot.ply_off_mm": None}

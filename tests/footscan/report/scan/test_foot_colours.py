"""Colours of a foot: each vertex has that of the nearest measured point."""

import numpy as np

from footscan.cloud.points import make_points
from footscan.report.filled import CUT
from footscan.report.scan.foot_colours import CAMERAS, SURE, UNSURE, FootSurface, foot_colourings
from schemas.quality import MeshQuality

VERTICES = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [9, 1, 0]])
SURFACE = FootSurface(
    vertices=VERTICES,
    faces=np.array([[0, 1, 3], [1, 2, 3]]),
    filled=np.array([False, False, False, True]),
    deviations=np.array([0.0, 0.05, 0.1, 0.2]),
    cut_mm=None,
    truth_distance=None,
)
CLOUD = make_points(VERTICES[:3] + 0.1, camera=np.array([1, 2, 13]))
MESH = MeshQuality(vertices=4, triangles=2, open_edges=0, non_manifold_edges=0, components=1, holes=0)


def test_cameras_are_those_of_the_nearest_point_and_filled_is_grey() -> None:
    colourings = {colouring.name: colouring for colouring in foot_colourings(SURFACE, MESH, CLOUD)}
    assert list(colourings) == ["Measured and filled", "Camera", "Uncertainty"]
    # Camera 13 has the colour of the first.
    assert colourings["Camera"].colours.tolist() == [list(CAMERAS[0]), list(CAMERAS[1]), list(CAMERAS[0]), list(CUT)]
    for camera in (1, 2, 13):
        assert f"Camera {camera}</span>" in colourings["Camera"].meaning


def test_uncertainty_is_shown_of_filled_surface_too() -> None:
    *_, uncertainty = foot_colourings(SURFACE, MESH, CLOUD)
    assert uncertainty.colours[0].tolist() == SURE.tolist()
    assert uncertainty.colours[3].tolist() == UNSURE.tolist()
    assert "from all causes" in uncertainty.meaning


def test_the_distance_to_a_reference_comes_first_where_there_is_one() -> None:
    surface = SURFACE._replace(filled=None, truth_distance=np.array([-1.0, 0.0, 1.0, np.nan]))
    first, *_ = foot_colourings(surface, MESH, CLOUD)
    assert first.name == "Distance to reference"
    red, _, blue = first.colours.astype(int).T
    assert red[0] < blue[0]
    assert red[2] > blue[2]
    assert "blue lies inside" in first.meaning


def test_without_a_cloud_the_surface_alone_is_shown() -> None:
    assert [colouring.name for colouring in foot_colourings(SURFACE, MESH, CLOUD[:0])] == [
        "Measured and filled",
        "Uncertainty",
    ]

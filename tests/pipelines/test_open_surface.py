"""Ball pivoting leaves a surface open: filled holes are reported, and measures of a closed surface have no value."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.points import POINT_DTYPE, coordinates, make_points
from footscan.mesh.topology import vertex_normals
from footscan.surface.quality import mesh_quality
from footscan.virtual.foot.foot import make_foot
from pipelines.arrays import pack, unpack
from pipelines.steps import measure, surface
from schemas.fusion import FusionReport
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.measures import Measure, Measures
from schemas.movement import MovementReport
from schemas.parameters.foot import MeasureParameters
from schemas.parameters.surface import SurfaceParameters

STEP_MM = 4.0
WINDOW_MM = 30.0
NOWHERE: dict[str, Path] = {}
IN_PLACE = pack(
    points=np.empty(0, POINT_DTYPE),
    parted=np.empty(0, np.float32),
    glass=np.frombuffer(GlassPlane().model_dump_json().encode(), np.uint8),
    lasers=np.empty((0, 6)),
    contested=np.array([np.inf, -np.inf]),
    movement=np.frombuffer(MovementReport().model_dump_json().encode(), np.uint8),
)
"""What cleaning says of a plate that was not moved."""
ALONE = pack(cloud=np.empty(0, POINT_DTYPE), report=np.frombuffer(FusionReport().model_dump_json().encode(), np.uint8))
"""What `fuse` says of one camera."""


@pytest.fixture(scope="module")
def oriented() -> bytes:
    """A foot's points in planes, with a window of 30 mm in the medial side of the heel that no camera saw."""
    foot = make_foot(side="right")
    vertices, normals = foot.vertices, vertex_normals(foot.vertices, foot.faces)
    plane = np.rint(vertices[:, 0] / STEP_MM)
    near = np.abs(vertices[:, 0] - plane * STEP_MM) < 0.6
    points = vertices[near]
    seen = ~in_window(points, vertices, WINDOW_MM / 2)
    frames = plane[near][seen].astype(int)
    cloud = make_points(points[seen], camera=1, frame=frames - frames.min())
    return pack(cloud=cloud, normals=normals[near][seen])


def test_what_was_filled_is_known(oriented: bytes) -> None:
    mesh = unpack(surface_of(oriented))
    vertices, filled = mesh["vertices"], mesh["filled"]
    within = in_window(vertices, make_foot(side="right").vertices, WINDOW_MM / 2 - STEP_MM)
    assert within.sum() > 10
    assert filled[within].all()
    distance = KDTree(coordinates(unpack(oriented)["cloud"])).query(vertices)[0]
    assert distance[~filled].max() <= 0.6 * STEP_MM < distance[filled].min()
    assert set(mesh["camera"][filled]) == {0}
    assert set(mesh["camera"][~filled]) == {1}


def test_what_needs_a_closed_surface_has_no_value_on_an_open_one(oriented: bytes) -> None:
    closed = measures_of(surface_of(oriented))
    assert {closed[name].status for name in ("foot_volume", "foot_surface")} == {"ok"}
    mesh = surface_of(oriented, hole_mm=60.0)  # less than it is around the window
    found = measures_of(mesh)
    for name in ("foot_volume", "foot_surface"):
        assert (found[name].value, found[name].status) == (None, "incomplete")
        assert (found[name].note or "").startswith("the surface has a hole of ")
    for name in ("foot_length", "ball_girth", "instep_girth"):  # which lie elsewhere
        assert found[name].status == "ok"
        assert found[name].value == pytest.approx(closed[name].value, abs=0.5)
    opened = unpack(mesh)
    assert mesh_quality(opened["vertices"], opened["faces"], opened["filled"]).holes > 1  # not the leg's alone


def in_window(points: NDArray[np.float64], foot: NDArray[np.float64], radius: float) -> NDArray[np.bool_]:
    """(N,) which points lie around the middle of the window, as seen from the side."""
    middle = np.array([foot[:, 0].min() + 40.0, 25.0])
    is_medial = points[:, 1] > np.median(foot[:, 1])
    return is_medial & (np.linalg.norm(points[:, [0, 2]] - middle, axis=1) <= radius)


def surface_of(oriented: bytes, **values: object) -> bytes:
    parameters = SurfaceParameters.model_validate({"method": "ball_pivoting", **values})
    return surface.run({"oriented": oriented}, parameters, NOWHERE)


def measures_of(mesh: bytes) -> dict[str, Measure]:
    document = measure.run(
        {"surface": mesh, "clean": IN_PLACE, "fused": ALONE, "heads": HeadsReport().model_dump_json().encode()},
        MeasureParameters(side="right"),
        NOWHERE,
    )
    found = Measures.model_validate_json(document)
    assert found.finding is None
    return found.measures

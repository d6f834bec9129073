"""The closed surface of clouds as stripes leave them, of shapes whose surface is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh
from footscan.surface.closed_surface import close_surface
from footscan.surface.quality import mesh_quality
from footscan.verify.distances import signed_distances
from footscan.virtual.foot.foot import make_foot
from schemas.base.errors import Finding
from schemas.parameters.surface import SurfaceParameters
from schemas.quality import MeshQuality

STEP = 2.0
RADIUS = 30.0
Floats = NDArray[np.float64]


def stripes(points: Floats, normals: Floats, offset: float = 0.3) -> tuple[Floats, Floats]:
    """What of a dense cloud lies within 0.02 mm of the planes of the stripes."""
    near = np.abs((points[:, 0] - offset + STEP / 2) % STEP - STEP / 2) < 0.02
    return points[near], normals[near]


def sphere(count: int = 1_500_000, seed: int = 1) -> tuple[Floats, Floats]:
    normals = np.random.default_rng(seed).normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return stripes(RADIUS * normals, normals)


def closed(points: Floats, normals: Floats) -> Mesh:
    return close_surface(points, normals, np.full(len(points), 3, np.uint8), STEP, SurfaceParameters())


def quality_of(mesh: Mesh) -> MeshQuality:
    cut = float(mesh.metadata["cut_mm"]) if "cut_mm" in mesh.metadata else None
    return mesh_quality(mesh.vertices, mesh.faces, mesh.filled, cut)


def check_closed(mesh: Mesh) -> None:
    quality = quality_of(mesh)
    assert (quality.open_edges, quality.non_manifold_edges, quality.components) == (0, 0, 1)
    assert quality.worst_triangles is not None
    assert quality.worst_triangles > 0.2


def test_sphere_is_met_between_the_stripes_and_not_shortened_beyond_the_last() -> None:
    mesh = closed(*sphere())
    check_closed(mesh)
    assert mesh.filled is not None
    off = np.linalg.norm(mesh.vertices, axis=1) - RADIUS
    assert np.abs(off[~mesh.filled]).max() < 0.05
    assert np.abs(off).max() < 0.1
    # The last stripes stand at -29.7 and 28.3 mm, the surface's ends at -30 and 30.
    assert mesh.vertices[:, 0].min() == pytest.approx(-RADIUS, abs=0.06)
    assert mesh.vertices[:, 0].max() == pytest.approx(RADIUS, abs=0.06)


def test_the_cap_within_the_outermost_stripe_bulges() -> None:
    """A heel: the ring of the first stripe is not round, and the quadric of its points does not say how it bends."""
    axes = np.array([100.0, 45.0, 30.0])
    places = np.random.default_rng(2).normal(size=(4_000_000, 3))
    places *= axes / np.linalg.norm(places, axis=1, keepdims=True)
    outward = places / axes**2
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    points, normals = stripes(places, outward, offset=0.9)  # the first stripe lies 0.9 mm before the end
    mesh = closed(points, normals)
    cap = mesh.vertices[mesh.vertices[:, 0] < points[:, 0].min()]
    assert cap[:, 0].min() == pytest.approx(-axes[0], abs=0.1)
    off = np.sqrt(np.sum((cap / axes) ** 2, axis=1)) - 1.0
    assert np.abs(off * axes[0]).max() < 0.15


def test_steps_are_not_to_be_seen_as_ribs() -> None:
    """The distance to the sphere does not follow the distance to the nearest stripe."""
    mesh = closed(*sphere())
    assert mesh.filled is not None
    side = ~mesh.filled & (np.abs(mesh.vertices[:, 0]) < 20)
    off = np.linalg.norm(mesh.vertices[side], axis=1) - RADIUS
    phase = np.exp(2j * np.pi * (mesh.vertices[side, 0] - 0.3) / STEP)
    assert 2 * np.abs(np.mean(off * phase)) < 0.002


def test_hole_is_filled_smoothly_and_marked() -> None:
    points, normals = sphere()
    hole = np.linalg.norm(points - [0, 0, RADIUS], axis=1) < 12
    mesh = closed(points[~hole], normals[~hole])
    check_closed(mesh)
    assert mesh.filled is not None
    assert mesh.camera is not None
    within = np.linalg.norm(mesh.vertices - [0, 0, RADIUS], axis=1) < 9
    assert mesh.filled[within].all()
    assert (mesh.camera[mesh.filled] == 0).all()
    assert (mesh.camera[~mesh.filled] == 3).all()
    assert np.abs(np.linalg.norm(mesh.vertices[within], axis=1) - RADIUS).max() < 0.4
    cap = (12 / RADIUS) ** 2 / 4  # of a sphere's area
    ends = quality_of(closed(*sphere())).filled_share
    assert quality_of(mesh).filled_share - ends == pytest.approx(cap, rel=0.4)


def test_open_leg_is_cut_flat() -> None:
    """A leg whose upper end is ragged and open: cut below the rags, and the cut is a plane."""
    random = np.random.default_rng(2)
    angle, z = random.uniform(0, 2 * np.pi, 600_000), random.uniform(0, 100, 600_000)
    ragged = z < 95 + 3 * np.cos(5 * angle)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])[ragged]
    leg = 35 * normals + np.column_stack([np.zeros((ragged.sum(), 2)), z[ragged]])
    disc = random.uniform(-35, 35, (400_000, 3)) * [1, 1, 0]
    disc = disc[np.hypot(disc[:, 0], disc[:, 1]) < 35]
    points = np.concatenate([leg, disc])
    mesh = closed(*stripes(points, np.concatenate([normals, np.broadcast_to([0, 0, -1.0], disc.shape)])))
    check_closed(mesh)
    cut = float(mesh.metadata["cut_mm"])
    assert 89.5 < cut < 95  # the rags end between 92 and 98 mm
    assert mesh.vertices[:, 2].max() == cut
    lid = mesh.vertices[:, 2] == cut
    assert np.hypot(*mesh.vertices[lid, :2].T).max() == pytest.approx(35, abs=0.2)
    share = quality_of(mesh).cut_share
    assert share == pytest.approx(35**2 / (2 * 35**2 + 2 * 35 * cut), rel=0.03)


@pytest.mark.slow
def test_foot_is_met() -> None:
    foot = make_foot(resolution_mm=0.5)
    corners = foot.vertices[foot.faces]
    random = np.random.default_rng(3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    chosen = random.choice(len(area), 3_000_000, p=area / area.sum())
    share = random.dirichlet([1, 1, 1], len(chosen))
    points = np.einsum("nk,nki->ni", share, corners[chosen])
    mesh = closed(*stripes(points, (normal / area[:, None])[chosen]))
    check_closed(mesh)
    off = np.abs(signed_distances(mesh.vertices, (foot.vertices, foot.faces)))
    assert off.mean() < 0.01
    assert np.quantile(off, 0.99) < 0.15
    assert np.ptp(mesh.vertices[:, 0]) == pytest.approx(np.ptp(foot.vertices[:, 0]), abs=0.15)


def test_same_bytes_again() -> None:
    cloud = sphere(400_000)
    first, second = closed(*cloud), closed(*cloud)
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_too_few_points_are_a_finding(count: int) -> None:
    points, normals = sphere(100_000)
    with pytest.raises(Finding):
        close_surface(
            points[:count], normals[:count], np.zeros(count, np.uint8), 0.0 if count < 2 else STEP, SurfaceParameters()
        )


@pytest.mark.parametrize("spoil", ["plane", "doubled", "nan", "inward"])
def test_odd_clouds_end_well(spoil: str) -> None:
    points, normals = sphere(300_000)
    if spoil == "plane":
        points[:, 2], normals[:] = 0.0, [0, 0, 1.0]
    elif spoil == "doubled":
        points, normals = np.repeat(points, 2, axis=0), np.repeat(normals, 2, axis=0)
    elif spoil == "nan":
        points[::50, 1], normals[7] = np.nan, np.nan
    else:
        normals = -normals
    if spoil in ("plane", "inward"):
        with pytest.raises(Finding, match=r"^[^\n]+$"):
            closed(points, normals)
    else:
        check_closed(closed(points, normals))

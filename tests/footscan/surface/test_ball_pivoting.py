import numpy as np
import pytest

from footscan.cloud.fusion.fuse import fuse
from footscan.cloud.normals import estimate_normals
from footscan.cloud.outliers.remove import remove_outliers
from footscan.cloud.points import coordinates, make_points
from footscan.surface.ball_pivoting import mesh_cloud
from footscan.surface.quality import mesh_quality
from schemas.base.errors import Finding
from schemas.parameters.fusion import FusionParameters
from schemas.parameters.normals import NormalParameters
from schemas.parameters.outliers import OutlierParameters
from schemas.parameters.surface import SurfaceParameters

AXES = np.array([70.0, 40.0, 25.0])
CENTRE = np.array([80.0, 0.0, 30.0])


def scan_of_an_ellipsoid(noise: float, offset: float, outliers: int) -> list[np.ndarray]:
    """Stripes 2 mm apart over an ellipsoid, as cameras 1 and 3 see it from above and 5 and 7 from below.

    Each camera's points lie `offset` too far out or in; ends that are almost parallel to the stripes are missing.
    """
    random = np.random.default_rng(4)
    clouds = []
    for camera, side, up, sign in ((1, 1, 1, 1), (3, -1, 1, -1), (5, 1, -1, -1), (7, -1, -1, 1)):
        points = []
        for x in np.arange(12.0, 150.0, 2.0):
            shrink = np.sqrt(max(0.0, 1 - ((x - CENTRE[0]) / AXES[0]) ** 2))
            angle = np.arange(0, 2 * np.pi, 0.3 / (40 * shrink + 0.1))
            points.append(
                np.column_stack(
                    [
                        np.full(angle.size, (x - CENTRE[0]) / AXES[0]),
                        *(shrink * np.array([np.cos(angle), np.sin(angle)])),
                    ]
                )
            )
        unit = np.concatenate(points)
        stripe = np.repeat(np.arange(len(points)), [len(part) for part in points])
        normal = unit / AXES
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        seen = (unit[:, 1] * side > -0.3) & (unit[:, 2] * up > -0.3) & (np.abs(normal[:, 0]) < 0.99)
        unit, normal = unit[seen], normal[seen]
        moved = CENTRE + unit * AXES + normal * (sign * offset + random.normal(0, noise, (len(unit), 1)))
        stray = CENTRE + random.uniform(-1, 1, (outliers, 3)) * AXES * 1.4
        frame = np.concatenate([stripe[seen], random.integers(0, stripe.max(), outliers)])
        clouds.append(make_points(np.concatenate([moved, stray]), camera=camera, frame=frame))
    return clouds


def radial_deviation(points: np.ndarray) -> np.ndarray:
    """Distance from the ellipsoid in mm, to first order."""
    unit = (points - CENTRE) / AXES
    length = np.linalg.norm(unit, axis=1)
    return (length - 1) * length / np.linalg.norm(unit / AXES, axis=1)


def test_eight_noisy_partial_clouds_become_one_closed_surface() -> None:
    seen = np.concatenate(scan_of_an_ellipsoid(noise=0.1, offset=0.1, outliers=100))
    inliers, removed = remove_outliers(seen, {}, OutlierParameters())
    kept = fuse(inliers, FusionParameters()).cloud
    assert sum(sum(reasons.values()) for reasons in removed.counts.values()) > 200
    normals = estimate_normals(kept, {}, NormalParameters())
    vertices, faces = mesh_cloud(coordinates(kept), normals, 2.0, SurfaceParameters())

    quality = mesh_quality(vertices, faces)
    assert (quality.components, quality.open_edges, quality.non_manifold_edges) == (1, 0, 0)
    deviation = radial_deviation(vertices[faces].mean(axis=1))
    # Where one camera alone sees the surface its offset of 0.1 mm stays; the noise does not, nor the offset elsewhere.
    assert np.abs(deviation).mean() < 0.08
    # Nothing says where the middle of the cameras is; fusion moves as few of them as it can.
    assert abs(deviation.mean()) < 0.03
    # The last stripe stands up to 2 mm before an end; the patch over the hole that is left reaches most of it.
    assert vertices[:, 0].min() == pytest.approx(10.0, abs=1.0)
    assert vertices[:, 0].max() == pytest.approx(150.0, abs=1.0)
    # Counter-clockwise seen from outside: the volume is that of the ellipsoid, and positive.
    a, b, c = (vertices[faces] - CENTRE).transpose(1, 0, 2)
    volume = np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * AXES.prod(), rel=0.005)


def test_the_same_bytes_at_every_call() -> None:
    cloud = fuse(scan_of_an_ellipsoid(noise=0.1, offset=0.05, outliers=0), FusionParameters()).cloud
    normals = estimate_normals(cloud, {}, NormalParameters())
    first = mesh_cloud(coordinates(cloud), normals, 2.0, SurfaceParameters())
    second = mesh_cloud(coordinates(cloud), normals, 2.0, SurfaceParameters())
    assert [array.tobytes() for array in first] == [array.tobytes() for array in second]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_points_are_a_finding(count: int) -> None:
    points = np.arange(count)[:, None] * np.ones(3) * 100
    with pytest.raises(Finding, match="expected a cloud"):
        mesh_cloud(points, np.tile([0.0, 0.0, 1.0], (count, 1)), 2.0, SurfaceParameters())

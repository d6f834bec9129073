from collections.abc import Callable

import numpy as np
import pytest

from footscan.cloud.normals import estimate_normals
from footscan.cloud.points import coordinates, make_points
from footscan.cloud.views import View
from schemas.base.errors import Finding
from schemas.parameters.normals import NormalParameters

Film = Callable[..., tuple[np.ndarray, np.ndarray]]
Views = dict[int, View]


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(np.sum(a * b, axis=1), -1, 1)))


@pytest.mark.parametrize("step", [0.5, 2.0, 3.0])
def test_normals_of_an_ellipsoid(ellipsoid: Film, views: Views, step: float) -> None:
    cloud, outward = ellipsoid(step=step)
    normals = estimate_normals(cloud, views, NormalParameters())
    assert normals.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    off = degrees(normals, outward)
    assert np.median(off) < 1.0
    assert np.percentile(off, 99) < 12.0  # at the first and the last stripe, with others on one side only
    assert off.max() < 90.0  # none points inward, those of the ends along the travel included


def test_noise_tilts_them_little(ellipsoid: Film, views: Views) -> None:
    cloud, outward = ellipsoid()
    for axis in "yz":
        cloud[axis] += np.random.default_rng(3).normal(0, 0.05, len(cloud))
    assert np.median(degrees(estimate_normals(cloud, views, NormalParameters()), outward)) < 2.0


def test_a_camera_tells_the_side_of_a_sheet() -> None:
    """Two sheets, one seen from above and one from below, where the cloud's middle would say the contrary."""
    x, y = (side.ravel() for side in np.meshgrid(np.arange(20) * 2.0, np.arange(40) * 0.5, indexing="ij"))
    frame = np.round(x / 2).astype(int)
    low = make_points(np.column_stack([x, y, np.full(len(x), 10.0)]), camera=1, frame=frame)
    high = make_points(np.column_stack([x, y, np.full(len(x), 60.0)]), camera=5, frame=frame)
    views = {
        1: View(np.array([100.0, 0.0, 200.0]), np.empty((0, 2))),
        5: View(np.array([100.0, 0.0, -200.0]), np.empty((0, 2))),
    }
    normals = estimate_normals(np.concatenate([low, high]), views, NormalParameters())
    np.testing.assert_allclose(normals[: len(low)], np.tile([0, 0, 1], (len(low), 1)), atol=1e-6)
    np.testing.assert_allclose(normals[len(low) :], np.tile([0, 0, -1], (len(high), 1)), atol=1e-6)


def test_neighbours_decide_where_a_camera_looks_along_the_surface() -> None:
    """A sheet bent away from camera 1, which sees its level part at a grazing angle from just below."""
    x, y = (side.ravel() for side in np.meshgrid(np.arange(30) * 2.0, np.arange(120) * 0.5, indexing="ij"))
    z = np.where(y < 30, 30 - y, 0.0)
    cloud = make_points(np.column_stack([x, y, z]), camera=1, frame=np.round(x / 2).astype(int))
    views = {1: View(np.array([0.0, 300.0, -2.0]), np.empty((0, 2)))}
    normals = estimate_normals(cloud, views, NormalParameters())
    assert (normals[:, 2] > 0).all()
    assert not (estimate_normals(cloud, views, NormalParameters(grazing=0.0))[:, 2] > 0).all()


def test_without_cameras_the_middle_decides(ellipsoid: Film) -> None:
    cloud, outward = ellipsoid()
    assert np.sum(estimate_normals(cloud, {}, NormalParameters()) * outward, axis=1).min() > 0


def test_a_stripe_far_from_others_takes_a_wider_look(ellipsoid: Film, views: Views) -> None:
    cloud, outward = ellipsoid()
    there = ~np.isin(cloud["frame"], [25, 27, 28])  # frame 26 has its neighbours 4 mm away
    alone = cloud["frame"][there] == 26
    normals = estimate_normals(cloud[there], views, NormalParameters(radius_steps=1.2))
    assert np.median(degrees(normals, outward[there])[alone]) < 3.0


def test_the_outermost_stripe_of_a_heel_is_not_the_plane_of_the_laser() -> None:
    """The next stripe is farther away than the neighbours along the stripe."""
    x, angle = (part.ravel() for part in np.meshgrid(1.1 + 2.0 * np.arange(8), np.linspace(0, 2 * np.pi, 180)))
    radius = np.sqrt(90.0 * x - x**2)  # a sphere of radius 45 mm
    skin = np.column_stack([x, radius * np.cos(angle), radius * np.sin(angle)])
    cloud = make_points(skin, camera=1, frame=np.round(x / 2).astype(int))
    normals = estimate_normals(cloud, {}, NormalParameters())
    first = x < 2.0
    outward = (skin - [45.0, 0.0, 0.0]) / 45.0
    assert degrees(normals[first], outward[first]).max() < 5.0


def test_the_same_at_every_call(ellipsoid: Film, views: Views) -> None:
    cloud, _ = ellipsoid()
    first = estimate_normals(cloud, views, NormalParameters())
    assert first.tobytes() == estimate_normals(cloud, views, NormalParameters()).tobytes()


def test_no_points(views: Views) -> None:
    assert estimate_normals(make_points(np.zeros((0, 3)), camera=1), views, NormalParameters()).shape == (0, 3)


def test_points_in_one_plane_are_a_finding(ellipsoid: Film, views: Views) -> None:
    cloud, _ = ellipsoid()
    with pytest.raises(Finding, match="points in one plane"):
        estimate_normals(cloud[cloud["frame"] == 30], views, NormalParameters())


def test_points_without_coordinates_are_a_finding(ellipsoid: Film, views: Views) -> None:
    cloud, _ = ellipsoid()
    cloud["y"][7] = np.nan
    with pytest.raises(Finding, match="without coordinates"):
        estimate_normals(cloud, views, NormalParameters())


def test_two_points_and_doubled_points(ellipsoid: Film, views: Views) -> None:
    pair = make_points(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), camera=1, frame=np.array([0, 1]))
    assert np.isfinite(estimate_normals(pair, views, NormalParameters())).all()
    cloud, outward = ellipsoid()
    doubled = estimate_normals(np.concatenate([cloud, cloud]), views, NormalParameters())
    assert np.median(degrees(doubled, np.concatenate([outward, outward]))) < 1.0
    assert np.isfinite(coordinates(cloud)).all()

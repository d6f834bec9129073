"""The fit on stripes that are computed from the body alone: no scanner, no pictures."""

from functools import lru_cache

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial.transform import Rotation

from footscan.calibration.models.laser_plane import terms_of_plane
from footscan.calibration.travel.body import Body, standard_body
from footscan.calibration.travel.fit import TravelFit, TravelPoints, fit_travel
from schemas.base.errors import Finding

HEADS = [0, 0, 1, 1, 2, 2]
CENTRES = np.array([[200, 210, 160], [-200, 210, 160], [200, -210, 160], [-200, -210, 160], [200, 80, -180],
                    [-200, -80, -180]], float)  # fmt: skip
"""Place of each camera, relative to its laser plane at Y = Z = 0, mm."""
STEP = 2.0
NOISE_MM = 0.02
OFF = np.array([[1.5, 0.012, -0.008, 0.2, 0.003], [-2.0, -0.015, 0.01, 0.2, -0.004], [0.5, 0.006, 0.015, 0.2, 0.001]])
"""Offset (mm), yaw, pitch, bend (mm) and scale of each head."""


@lru_cache
def filmed(shutter: float, *, off: bool = True, turn_deg: float = 20.0, noise: float = NOISE_MM) -> TravelPoints:
    """Points of all cameras: rays through the body in the turned planes."""
    random = np.random.default_rng(3)
    body = standard_body()
    turn = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    shift = np.array([120.0, 4.0, 0.0])
    scene = o3d.t.geometry.RaycastingScene()
    placed = body.vertices @ turn.T + shift
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(placed.astype(np.float32)), o3d.core.Tensor.from_numpy(body.faces.astype(np.uint32))
    )
    frames = np.arange(120)
    parts = []
    for camera, head in enumerate(HEADS):
        values = np.concatenate([OFF[head] if off else np.zeros(5), [0.0, shutter]])
        angles = np.linspace(0, 2 * np.pi, 240, endpoint=False)
        x, angle = (grid.ravel() for grid in np.meshgrid(frames * STEP, angles, indexing="ij"))
        radius = random.uniform(0, 100, len(x)) ** 0.5 * 10.0
        places = np.column_stack([radius * np.cos(angle), 42.0 + 0.4 * radius * np.sin(angle)])
        for _ in range(4):  # the row, and X, of a point follow from its place, and that from the ray
            row = (CENTRES[camera, 2] - places[:, 1]) / 600.0 - 0.3
            terms = terms_of_plane(x, places, np.full(len(x), STEP), row, 120.0)
            on_plane = np.column_stack([x + terms @ values, places])
            closest = scene.compute_closest_points(o3d.core.Tensor.from_numpy(on_plane.astype(np.float32)))
            places = closest["points"].numpy()[:, 1:].astype(float)
        row = (CENTRES[camera, 2] - places[:, 1]) / 600.0 - 0.3
        on_plane[:, 0] = x + terms_of_plane(x, places, np.full(len(x), STEP), row, 120.0) @ values
        on_plane[:, 1:] = places
        closest = scene.compute_closest_points(o3d.core.Tensor.from_numpy(on_plane.astype(np.float32)))
        away = np.linalg.norm(closest["points"].numpy() - on_plane, axis=1)
        normal = closest["primitive_normals"].numpy()
        sight = CENTRES[camera] - np.column_stack([np.zeros(len(x)), places])
        seen = (away < 0.005) & (np.einsum("ij,ij->i", normal, sight) > 0.3 * np.linalg.norm(sight, axis=1))
        count = int(seen.sum())
        noisy = places[seen] + random.normal(0, noise, (count, 2))
        parts.append(
            (np.full(count, camera), x[seen], np.full(count, STEP), row[seen], noisy, sight[seen], np.full(count, 0.03))
        )
    return TravelPoints(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def centred(fit: TravelFit) -> np.ndarray:
    """True planes of the heads as the fit counts them: offsets at its X, relative to their mean."""
    truth = OFF.copy()
    truth[:, 0] += OFF[:, 4] * (fit.x_mm - 120.0)
    truth[:, 0] -= truth[:, 0].mean()
    return truth


def test_planes_that_are_off_are_found() -> None:
    fit = fit_travel(filmed(0.0), HEADS, standard_body())
    found, deviations, truth = fit.planes[::2, :5], fit.deviations[::2, :5], centred(fit)
    assert np.abs(found[:, 0] - truth[:, 0]).max() < 0.03
    assert np.abs(found[:, 1:3] - truth[:, 1:3]).max() < 0.0015
    assert np.abs(found[:, 4] - truth[:, 4]).max() < 0.0005
    assert np.mean(np.abs(found - truth) < 3 * deviations) >= 0.97
    assert fit.rms_mm < 0.04
    assert fit.before_mm > 0.2


def test_nothing_is_found_where_nothing_is_off() -> None:
    fit = fit_travel(filmed(0.0, off=False), HEADS, standard_body())
    assert np.abs(fit.planes[:, 0]).max() < 0.1
    assert np.abs(fit.planes[:, 1:3]).max() < 0.002
    assert np.all(np.abs(fit.planes) < 3.5 * fit.deviations + 1e-9)


def test_a_rolling_shutter_is_found() -> None:
    fit = fit_travel(filmed(0.4), HEADS, standard_body())
    terms = terms_of_plane(*(filmed(0.4)[k] for k in (1, 4, 2, 3)), fit.x_mm)
    camera = filmed(0.4).camera
    truth = np.hstack([OFF[HEADS], np.tile([0.0, 0.4], (6, 1))])
    truth[:, 0] += OFF[HEADS, 4] * (fit.x_mm - 120.0)
    apart = np.einsum("nk,nk->n", terms, (fit.planes - truth)[camera])
    assert np.std(apart) < 0.05  # pitch and shutter may stand for each other: what counts is X


@pytest.mark.parametrize("turn_deg", [-20.0, 160.0])
def test_the_body_may_stand_at_any_angle(turn_deg: float) -> None:
    fit = fit_travel(filmed(0.0, turn_deg=turn_deg), HEADS, standard_body())
    assert np.abs(fit.planes[::2, 0] - centred(fit)[:, 0]).max() < 0.05


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "form", [(1.1, 1.0, 1.0), pytest.param((1.3, 0.6, 1.2), marks=SLOW), pytest.param((0.8, 0.8, 0.8), marks=SLOW)]
)
def test_another_body_is_refused(form: tuple[float, float, float]) -> None:
    body = standard_body()
    with pytest.raises(Finding, match="is it the film of this body"):
        fit_travel(filmed(0.0), HEADS, Body(body.vertices * np.array(form), body.faces))

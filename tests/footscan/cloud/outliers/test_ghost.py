"""Ghosts of the sole in the plate."""

from collections.abc import Callable

import numpy as np
import pytest

from footscan.cloud.outliers.ghost import is_ghost
from footscan.cloud.outliers.remove import REASONS, remove_outliers
from footscan.cloud.views import View
from schemas.parameters.outliers import OutlierParameters

Film = Callable[..., tuple[np.ndarray, np.ndarray]]
Views = dict[int, View]


def ghosts(clean: np.ndarray, higher_mm: float, cameras: tuple[int, ...] = (5, 6, 7, 8)) -> np.ndarray:
    """What cameras below see of the sole a second time, with 0.1 mm of noise."""
    seen = clean[np.isin(clean["camera"], cameras) & (clean["z"] < 12.0)].copy()
    seen["z"] += higher_mm + np.random.default_rng(1).normal(0.0, 0.1, len(seen))
    seen["source"] += 1_000_000
    return seen


@pytest.mark.parametrize("higher_mm", [4.5, 7.3, 11.0, 19.0])
def test_ghosts_are_found_at_any_distance(ellipsoid: Film, views: Views, higher_mm: float) -> None:
    clean, _ = ellipsoid()
    spoilt = ghosts(clean, higher_mm)
    found = is_ghost(np.concatenate([clean, spoilt]), views, 1.5, 15.0)
    assert np.mean(found[len(clean) :]) > 0.95
    assert np.mean(found[: len(clean)]) < 0.02  # a steep side, too, has points 4.5 mm above others


def test_a_foot_without_a_ghost_loses_nothing(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    assert not is_ghost(clean, views, 1.5, 15.0).any()


def test_each_camera_has_its_own(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    above = clean[(clean["camera"] == 1) & (clean["z"] > 30.0)].copy()
    above["z"] += 7.0  # a camera above does not look through the plate
    spoilt = ghosts(clean, 7.0, (6,))
    found = is_ghost(np.concatenate([clean, spoilt, above]), views, 1.5, 15.0)
    assert np.mean(found[len(clean) : len(clean) + len(spoilt)]) > 0.95
    assert not found[-len(above) :].any()


def test_ghosts_on_which_all_cameras_below_agree_are_dropped(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    spoilt = ghosts(clean, 8.0)
    _, removed = remove_outliers(np.concatenate([clean, spoilt]), views, OutlierParameters(end_points=0))
    assert np.mean(removed.codes[len(clean) :] > 0) > 0.99
    assert np.mean(removed.codes[len(clean) :] == 1 + REASONS.index("glass")) > 0.9
    assert np.mean(removed.codes[: len(clean)] > 0) < 0.01

import numpy as np
import pytest

from footscan.cloud.fusion.agreement import disagreements, find_overlaps
from footscan.cloud.fusion.stripes import sort_stripes
from footscan.cloud.points import make_points


def tube(camera: int, radius: float, low: float, high: float, start: float = 0.0, frames: int = 20) -> np.ndarray:
    """Stripes 2 mm apart over a tube along X, from one angle in degrees to another; points stand 0.3 mm apart."""
    angle = np.radians(np.arange(low, high, np.degrees(0.3 / radius)))
    frame, place = np.divmod(np.arange(frames * len(angle)), len(angle))
    yz = radius * np.column_stack([np.cos(angle), np.sin(angle)])[place]
    return make_points(np.column_stack([start + 2.0 * frame, yz]), camera, frame, np.arange(len(frame)), sigma=0.03)


def test_a_camera_that_sees_the_skin_farther_out() -> None:
    clouds = [tube(3, 30.0, 0, 120), tube(5, 30.2, 60, 200)]
    stripes = sort_stripes(clouds)
    pairs = disagreements(stripes, find_overlaps(stripes, stripes.yz, 3.0))
    assert list(pairs) == [(3, 5)]
    count, apart = pairs[3, 5]
    assert count > 1000
    assert apart.median_mm == pytest.approx(-0.2, abs=1e-3)
    assert apart.rms_mm == pytest.approx(0.2, abs=1e-3)
    assert apart.deviation_mm < 1e-3


def test_noise_is_no_systematic_disagreement() -> None:
    first, second = tube(3, 30.0, 0, 120, frames=60), tube(5, 30.1, 0, 120, frames=60)
    noise = np.random.default_rng(3).normal(0.0, 0.05 / 30.0, len(second))
    second["y"] *= 1.0 + noise
    second["z"] *= 1.0 + noise
    stripes = sort_stripes([first, second])
    _, apart = disagreements(stripes, find_overlaps(stripes, stripes.yz, 3.0))[3, 5]
    assert apart.rms_mm > 0.107
    assert apart.systematic_mm == pytest.approx(0.1, abs=0.004)


def test_what_only_one_camera_sees_is_not_compared() -> None:
    for clouds in ([tube(1, 30.0, 0, 80), tube(2, 30.0, 90, 170)], [tube(1, 30.0, 0, 80)], []):
        stripes = sort_stripes(clouds)
        assert len(find_overlaps(stripes, stripes.yz, 3.0).point) == 0


def test_variances_are_those_of_both() -> None:
    stripes = sort_stripes([tube(1, 30.0, 0, 90), tube(2, 30.0, 0, 90)])
    np.testing.assert_allclose(find_overlaps(stripes, stripes.yz, 3.0).variance, 2 * 0.03**2, rtol=1e-5)


def test_planes_between_each_others() -> None:
    # A cone: its radius grows by 0.3 mm a mm. The second camera's planes lie 0.7 mm behind the first one's.
    first, second = tube(1, 30.0, 0, 90), tube(2, 30.0, 0, 90, start=0.7)
    for cloud in (first, second):
        growth = 1 + 0.3 * cloud["x"] / 30.0
        cloud["y"] *= growth
        cloud["z"] *= growth
    stripes = sort_stripes([first, second])
    overlaps = find_overlaps(stripes, stripes.yz, 3.0)
    assert len(overlaps.point) > 1000
    np.testing.assert_allclose(overlaps.distance, 0.0, atol=2e-3)


def test_a_gap_in_the_travel_is_not_bridged() -> None:
    second = tube(2, 30.0, 0, 90, start=0.7)
    lost = (second["frame"] >= 5) & (second["frame"] < 10)
    stripes = sort_stripes([tube(1, 30.0, 0, 90), second[~lost]])
    x = stripes.x[find_overlaps(stripes, stripes.yz, 3.0).point]
    assert not np.any((x > 8.7 + 0.01) & (x < 20.7 - 0.01) & (np.abs(x % 2) < 0.01))


def test_unsupported_points_and_corners_do_not_count() -> None:
    first, second = tube(1, 30.0, 0, 90), tube(2, 30.0, 0, 90)
    first["supported"] = False
    stripes = sort_stripes([first, second])
    assert len(find_overlaps(stripes, stripes.yz, 3.0).point) == 0

import json

import numpy as np
import pytest

from footscan.cloud.fusion.fuse import fuse
from footscan.cloud.points import POINT_DTYPE, coordinates, make_points
from schemas.fusion import FusionReport
from schemas.parameters.fusion import FusionParameters

PARAMETERS = FusionParameters()
SECTORS = {1: (-30, 110), 2: (-20, 120), 3: (70, 210), 4: (60, 200)}


def arch(shift: tuple[float, float] = (0.0, 0.0), moved: int = 3, frames: int = 30) -> list[np.ndarray]:
    """Four cameras over an arch of 60 mm across and 40 mm high, one of which stands off by `shift`."""
    random = np.random.default_rng(2)
    clouds = []
    for camera, (low, high) in SECTORS.items():
        angle = np.radians(np.arange(low, high, 0.8))
        frame, place = np.divmod(np.arange(frames * len(angle)), len(angle))
        size = 1 + 0.005 * frame + random.normal(0, 0.0003, len(frame))
        xyz = np.column_stack([2.0 * frame, 30 * size * np.cos(angle[place]), 40 * size * np.sin(angle[place])])
        xyz[:, 1:] += shift if camera == moved else (0.0, 0.0)
        clouds.append(make_points(xyz, camera, frame, np.arange(len(frame)), sigma=0.012))
    return clouds


def off_arch(cloud: np.ndarray) -> np.ndarray:
    """Distances of the points from the arch, mm, to first order."""
    x, y, z = coordinates(cloud).T
    size = 1 + 0.0025 * x
    level = np.hypot(y / (30 * size), z / (40 * size))
    return np.abs((level - 1) * level / np.hypot(y / (30 * size) ** 2, z / (40 * size) ** 2))


def test_fused_points_are_better_than_those_they_are_made_of() -> None:
    clouds = arch()
    cloud, report = fuse(clouds, PARAMETERS)
    raw = np.concatenate(clouds)
    assert len(cloud) < len(raw) / 2
    for percentile in (50, 90, 99):
        assert np.percentile(off_arch(cloud), percentile) < np.percentile(off_arch(raw), percentile)
    assert [pair.cameras for pair in report.pairs] == [(1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)]
    assert all(pair.before == pair.after for pair in report.pairs)
    assert report.warnings == []


def test_concatenated_points_are_all_there_as_they_were() -> None:
    clouds = arch()
    cloud, report = fuse(clouds, FusionParameters(method="concatenate"), {1: 1, 2: 1, 3: 2, 9: 3})

    raw = np.concatenate(clouds)
    assert len(cloud) == len(raw)
    assert np.array_equal(
        np.sort(cloud, order=["frame", "camera", "source"]), np.sort(raw, order=["frame", "camera", "source"])
    )
    assert np.all(np.diff(cloud["plane"]) >= 0)
    assert not report.corrections
    assert report.heads == {1: 1, 2: 1, 3: 2}
    assert all(pair.before == pair.after for pair in report.pairs)
    assert report.pairs


def test_a_camera_that_stands_off_is_corrected_and_told() -> None:
    clean, _ = fuse(arch(), PARAMETERS)
    cloud, report = fuse(arch(shift=(0.15, -0.15)), PARAMETERS)
    assert [correction.kind for correction in report.corrections] == ["none", "none", "rigid", "none"]
    assert np.percentile(off_arch(cloud), 90) < 1.2 * np.percentile(off_arch(clean), 90)
    disagreement_of = {pair.cameras: pair for pair in report.pairs}
    assert disagreement_of[3, 4].before.rms_mm > 0.1
    assert disagreement_of[3, 4].after.rms_mm < 0.03
    assert disagreement_of[1, 2].before.rms_mm < 0.03
    assert FusionReport.model_validate_json(json.dumps(report.model_dump(mode="json"))) == report


def test_a_camera_that_stands_far_off_is_named_and_outvoted() -> None:
    cloud, report = fuse(arch(shift=(0.0, 1.6), moved=2), PARAMETERS)
    assert [correction.kind for correction in report.corrections] == ["none"] * 4
    assert len(report.warnings) == 1
    assert report.warnings[0].startswith("camera 2 deviates from the others by 1.6")
    seen_by_others = np.degrees(np.arctan2(cloud["z"] / 40, cloud["y"] / 30)) > 0
    assert np.percentile(off_arch(cloud[seen_by_others]), 90) < 0.1


@pytest.mark.parametrize("order", [(3, 2, 1, 0), (2, 0, 3, 1)])
def test_order_of_cameras_does_not_matter(order: tuple[int, ...]) -> None:
    clouds = arch(shift=(0.15, -0.15), frames=12)
    cloud, report = fuse(clouds, PARAMETERS)
    other, other_report = fuse([clouds[k] for k in order], PARAMETERS)
    assert other.tobytes() == cloud.tobytes()
    assert other_report == report
    assert fuse(np.concatenate(clouds), PARAMETERS).cloud.tobytes() == cloud.tobytes()


def test_stripe_planes_stay_apart() -> None:
    planes = make_points(np.array([[0.0, 1.0, 1.0], [2.0, 1.0, 1.0], [0.5, 1.0, 1.0]]), camera=1)
    np.testing.assert_array_equal(fuse(planes, PARAMETERS).cloud["x"], [0.0, 0.5, 2.0])


def test_no_points() -> None:
    for nothing in ([], [make_points(np.zeros((0, 3)), camera=1)], make_points(np.full((5, 3), np.nan), camera=2)):
        cloud, report = fuse(nothing, PARAMETERS)
        assert cloud.dtype == POINT_DTYPE
        assert len(cloud) == 0
        assert report.pairs == []


def test_one_point() -> None:
    cloud, report = fuse(make_points(np.array([[1.0, 2.0, 3.0]]), camera=5, source=7, frame=3), PARAMETERS)
    assert cloud[["camera", "source", "frame", "cameras"]].tolist() == [(5, 7, 3, 1)]
    np.testing.assert_array_equal(coordinates(cloud), [[1.0, 2.0, 3.0]])
    assert [correction.kind for correction in report.corrections] == ["none"]


def test_doubled_points_are_there_once() -> None:
    clouds = arch(frames=5)
    once, _ = fuse(clouds, PARAMETERS)
    twice, _ = fuse([*clouds, *clouds], PARAMETERS)
    assert len(twice) == pytest.approx(len(once), rel=0.05)
    assert np.percentile(off_arch(twice), 99) < 0.05


def test_strange_clouds() -> None:
    random = np.random.default_rng(0)
    huge = make_points(random.normal(0, 1e9, (500, 3)), camera=1, source=np.arange(500))
    same = make_points(np.zeros((500, 3)), camera=random.integers(1, 9, 500))
    flat = make_points(np.column_stack([np.zeros(500), random.uniform(0, 50, (500, 2))]), camera=3)
    stray = arch(frames=5)[0]
    stray["y"][::7] = np.nan
    stray["sigma"][::5] = 0.0
    for cloud in (huge, same, flat, stray):
        fused, _ = fuse([cloud, arch(frames=5)[1]], PARAMETERS)
        assert len(fused)
        assert np.isfinite(coordinates(fused)).all()
        assert np.all(fused["sigma"] > 0)

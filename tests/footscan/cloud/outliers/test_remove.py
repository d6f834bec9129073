from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError

from footscan.cloud.outliers.remove import REASONS, Removed, remove_outliers
from footscan.cloud.points import POINT_DTYPE, make_points
from footscan.cloud.views import View
from schemas.parameters.outliers import OutlierParameters

Film = Callable[..., tuple[np.ndarray, np.ndarray]]
Views = dict[int, View]


WITH_ENDS = OutlierParameters(end_points=0)
"""Parameters that keep the ends of stripes, which simplifies the other tests."""


def line(camera: int, frame: int, start: tuple[float, float], end: tuple[float, float], count: int = 40) -> np.ndarray:
    """A piece of stripe that is straight in Y and Z, in a frame of the even travel with 2 mm a step."""
    part = np.linspace(0, 1, count)[:, None]
    yz = (1 - part) * np.array(start) + part * np.array(end)
    rows = 1_000_000 + np.arange(count)
    return make_points(np.column_stack([np.full(count, 2.0 * frame), yz]), camera=camera, frame=frame, source=rows)


def dropped(clean: np.ndarray, spoilt: np.ndarray, views: Views, **parameters: object) -> dict[str, int]:
    """Why how many of `spoilt` are dropped, of a scan of whose other points none may be."""
    points = np.concatenate([clean, spoilt])
    kept, removed = remove_outliers(points, views, OutlierParameters(**{"end_points": 0, **parameters}))
    assert not removed.codes[: len(clean)].any()
    assert kept.tobytes() == points[removed.codes == 0].tobytes()
    codes = removed.codes[len(clean) :]
    return {reason: int(np.sum(codes == k)) for k, reason in enumerate(REASONS, start=1) if np.any(codes == k)}


def test_counts_stand_for_each_camera_and_reason(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    spoilt = line(5, 30, (100.0, 20.0), (110.0, 20.0), 12)
    _, removed = remove_outliers(np.concatenate([spoilt, clean]), views, WITH_ENDS)
    assert isinstance(removed, Removed)
    assert removed.codes.shape == (12 + len(clean),)
    assert set(removed.counts) == set(range(1, 9))
    assert removed.counts[5] == {**dict.fromkeys(REASONS, 0), "volume": 12}
    assert removed.counts[1] == dict.fromkeys(REASONS, 0)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"step": 0.5},
        {"step": 5.0},
        {"offsets": {1: 0.5, 4: 1.0, 6: 1.3}},
    ],
)
def test_a_clean_scan_loses_nothing(ellipsoid: Film, views: Views, more: dict[str, object]) -> None:
    clean, _ = ellipsoid(**more)
    kept, _ = remove_outliers(clean, views, WITH_ENDS)
    assert kept.tobytes() == clean.tobytes()


def test_lost_frames_and_uneven_steps_cost_nothing(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    there = ~np.isin(clean["frame"], [20, 31, 32]) & ~((clean["camera"] == 3) & (clean["frame"] > 35))
    clean = clean[there]
    clean["x"] += 0.8 * np.sin(clean["frame"])
    clean["plane"] = clean["x"]
    kept, _ = remove_outliers(clean, views, WITH_ENDS)
    assert len(kept) == len(clean)


@pytest.mark.parametrize("missing", [(2,), (1, 2), (5, 6, 7, 8), (1, 2, 3, 4, 5, 6, 7)])
def test_missing_cameras_cost_nothing(ellipsoid: Film, views: Views, missing: tuple[int, ...]) -> None:
    clean, _ = ellipsoid()
    clean = clean[~np.isin(clean["camera"], missing)]
    kept, _ = remove_outliers(clean, views, WITH_ENDS)
    assert len(kept) == len(clean)


def test_gaps_in_the_stripes_of_one_camera_cost_the_others_nothing(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    clean = clean[~((clean["camera"] == 1) & (clean["z"] > 35) & (clean["z"] < 38))]
    kept, _ = remove_outliers(clean, views, WITH_ENDS)
    assert len(kept) == len(clean)


def test_the_order_of_points_does_not_matter(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    points = np.concatenate([clean, line(1, 30, (10.0, 70.0), (14.0, 70.0))])
    order = np.random.default_rng(1).permutation(len(points))
    _, removed = remove_outliers(points, views, WITH_ENDS)
    _, shuffled = remove_outliers(points[order], views, WITH_ENDS)
    np.testing.assert_array_equal(shuffled.codes, removed.codes[order])


def test_outside_the_control_volume(ellipsoid: Film, views: Views) -> None:
    spoilt = make_points(
        np.array([[60.0, 190.0, 10.0], [60.0, 0.0, -160.0], [60.0, 0.0, 200.0], [np.nan, 0.0, 10.0]]), camera=3
    )
    assert dropped(ellipsoid()[0], spoilt, views) == {"volume": 4}


def test_levels_drop_without_evidence(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    alone = make_points(np.array([[60.0, 0.0, 100.0]]), camera=3)
    beyond = line(5, 30, (190.0, 20.0), (200.0, 20.0))
    clutter = line(1, 30, (10.0, 70.0), (14.0, 70.0))  # no other camera sees it
    spoilt = clean[2000:2001].copy()
    spoilt["z"] += 1.6
    points = np.concatenate([np.delete(clean, 2000), spoilt, alone, beyond, clutter])
    kept, removed = remove_outliers(points, views, OutlierParameters(method="levels"))
    reasons = np.array(["", *REASONS])[removed.codes]
    assert reasons[len(clean) - 1] == "median"
    assert reasons[len(clean)] == "isolated"
    assert set(reasons[len(clean) + 1 : len(clean) + 41]) == {"volume"}
    assert set(reasons[len(clean) + 41 :]) == {""}
    assert np.count_nonzero(removed.codes[: len(clean) - 1]) < 0.02 * len(clean)
    assert len(kept) == np.count_nonzero(removed.codes == 0)


def test_a_given_volume_replaces_that_of_the_scanner(ellipsoid: Film, views: Views) -> None:
    spoilt = make_points(np.array([[60.0, 190.0, 10.0]]), camera=3)
    assert dropped(ellipsoid()[0], spoilt, views, y_mm=(-200.0, 200.0)) != {"volume": 1}
    beyond = line(1, 400, (0.0, 20.0), (0.0, 40.0))  # the frames end before
    filmed = {camera: 2.0 * np.arange(61) for camera in views}
    _, removed = remove_outliers(np.concatenate([ellipsoid()[0], beyond]), views, WITH_ENDS, filmed)
    assert removed.counts[1]["volume"] == len(beyond)


@pytest.mark.parametrize("limits", [{"z_mm": (0.0, 20.0)}, {"y_mm": (-60.0, 5.0)}])
def test_a_volume_that_cuts_the_foot_is_reported(
    ellipsoid: Film, views: Views, limits: dict[str, tuple[float, float]]
) -> None:
    clean, _ = ellipsoid()
    _, whole = remove_outliers(clean, views, WITH_ENDS)
    assert not whole.warnings
    _, removed = remove_outliers(clean, views, OutlierParameters(end_points=0, **limits))
    cut = [warning for warning in removed.warnings if "control volume" in warning]
    assert len(cut) == 1
    assert cut[0].startswith("camera")


def test_extrapolated(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    spoilt = clean[:100].copy()
    spoilt["supported"] = False
    assert dropped(clean, spoilt, views) == {"extrapolated": 100}
    assert dropped(clean, spoilt, views, drop_unsupported=False) == {}


def test_a_glint_in_one_frame_is_isolated(ellipsoid: Film, views: Views) -> None:
    assert dropped(ellipsoid()[0], line(1, 30, (-5.0, 58.0), (5.0, 62.0)), views) == {"isolated": 40}


def test_speckles_are_isolated(ellipsoid: Film, views: Views) -> None:
    spoilt = np.concatenate([line(2, frame, (0.0, 60.0 + frame), (0.1, 60.0 + frame), 2) for frame in (10, 25, 40)])
    assert dropped(ellipsoid()[0], spoilt, views) == {"isolated": 6}


def above(clean: np.ndarray, camera: int, by_mm: float) -> np.ndarray:
    """The top as one camera sees it, in 16 frames, raised by so much."""
    ghost = clean[(clean["camera"] == camera) & (clean["z"] > 42) & (abs(clean["frame"] - 30) < 8)].copy()
    ghost["z"] += by_mm
    ghost["source"] += 1_000_000
    return ghost


@pytest.mark.parametrize("by_mm", [8.0, 20.0])
def test_a_ghost_that_no_other_camera_sees_is_unconfirmed(ellipsoid: Film, views: Views, by_mm: float) -> None:
    clean, _ = ellipsoid()
    ghost = above(clean, 1, by_mm)
    found = dropped(clean, ghost, views)
    assert found["unconfirmed"] > 0.8 * len(ghost)
    assert sum(found.values()) == len(ghost)  # what is left of it is a small part of its own


def test_what_lies_inside_the_foot_was_not_seen(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    ghost = above(clean, 1, -10.0)
    assert dropped(clean, ghost, views) == {"unconfirmed": len(ghost)}


def test_few_cameras_do_not_judge_each_other(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    clean = clean[clean["camera"] <= 3]
    assert dropped(clean, above(clean, 1, 8.0), views) == {}


def test_cameras_of_unknown_place_are_not_asked(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    assert dropped(clean, above(clean, 1, 8.0), {}) == {}


def test_the_mirror_image_in_the_glass(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    mirrored = clean[(clean["camera"] <= 4) & (clean["z"] > 1) & (clean["z"] < 15)].copy()
    mirrored["z"] *= -1
    mirrored["source"] += 1_000_000
    assert dropped(clean, mirrored, views) == {"glass": len(mirrored)}


def test_the_glass_beside_the_foot(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    shown = [line(camera, frame, (40.0, 0.1), (60.0, -0.1)) for camera in (5, 6) for frame in range(60)]
    before = [line(camera, frame, (-30.0, 0.2), (30.0, 0.2)) for camera in (5, 6) for frame in (-8, -7, -6, 66, 67)]
    assert dropped(clean, np.concatenate(shown + before), views) == {"glass": 60 * 2 * 40 + 5 * 2 * 40}


def test_what_travels_with_the_heads_is_clutter(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    spoilt = np.concatenate([line(3, frame, (-60.0, 40.0), (-55.0, 50.0)) for frame in range(-30, 90)])
    assert dropped(clean, spoilt, views) == {"clutter": len(spoilt)}


def test_what_the_foot_hides_for_a_while_is_clutter_too(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    spoilt = [line(3, frame, (-60.0, 40.0), (-55.0, 50.0)) for frame in range(-30, 90) if not 10 < frame < 50]
    assert dropped(clean, np.concatenate(spoilt), views) == {"clutter": 40 * len(spoilt)}


def test_a_small_part_apart_from_the_rest_is_clutter(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    island = [line(camera, frame, (-4.0, 100.0), (4.0, 100.0), 20) for camera in (1, 2, 3) for frame in (29, 30, 31)]
    assert dropped(clean, np.concatenate(island), views) == {"clutter": 9 * 20}


def block(views: Views) -> np.ndarray:
    """A cuboid 80 x 60 x 50 mm on the glass as the cameras see it: each sees its own side, and top or bottom."""
    parts = []
    for camera, view in views.items():
        side = 30.0 * np.sign(view.centre[1])
        level = 50.0 if view.centre[2] > 0 else 0.0
        across = np.column_stack([np.arange(-30.0, 30.1, 0.4), np.full(151, level)])
        upright = np.column_stack([np.full(124, side), np.arange(0.4, 49.9, 0.4)])
        for frame in range(41):
            for number, yz in enumerate((across, upright) if view.centre[2] > 0 else (across,)):
                xyz = np.column_stack([np.full(len(yz), 2.0 * frame), yz])
                rows = np.arange(len(yz)) + 1000 * number
                parts.append(make_points(xyz, camera=camera, frame=frame, source=rows))
    return np.concatenate(parts)


def test_a_block_keeps_its_edges(views: Views) -> None:
    points = block(views)
    kept, _ = remove_outliers(points, views, WITH_ENDS)
    assert len(kept) == len(points)


@pytest.mark.parametrize("height", [-2.0, 1.5])
def test_a_plate_that_was_moved(views: Views, height: float) -> None:
    points = block(views)
    points["z"] += height - 0.008 * points["y"]  # 0.46 degrees
    mirrored = line(5, 20, (-20.0, height - 0.9), (20.0, height - 0.9))
    kept, removed = remove_outliers(np.concatenate([points, mirrored]), views, WITH_ENDS)
    assert len(kept) == len(points)
    assert removed.counts[5]["glass"] == len(mirrored)
    assert removed.glass.below_foot_mm == pytest.approx(height, abs=0.01)
    assert removed.glass.tilt_x_deg == pytest.approx(-0.458, abs=0.01)
    assert [warning for warning in removed.warnings if f"{abs(height):.2f} mm" in warning]


def test_a_block_is_no_clutter_where_clutter_is(views: Views) -> None:
    spoilt = np.concatenate([line(3, frame, (-60.0, 40.0), (-55.0, 50.0)) for frame in range(-30, 70)])
    assert dropped(block(views), spoilt, views) == {"clutter": len(spoilt)}


@pytest.mark.parametrize("count", [0, 1, 5])
def test_few_points(views: Views, count: int) -> None:
    kept, removed = remove_outliers(make_points(np.zeros((count, 3)), camera=1), views, WITH_ENDS)
    assert len(kept) + sum(removed.counts.get(1, {}).values()) == count


def test_points_without_coordinates(views: Views) -> None:
    points = make_points(np.full((3, 3), np.nan), camera=2)
    kept, removed = remove_outliers(points, views, WITH_ENDS)
    assert kept.dtype == POINT_DTYPE
    assert len(kept) == 0
    assert removed.counts[2]["volume"] == 3


def test_one_plane_and_doubled_points(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    plane = clean[clean["frame"] == 30]
    assert len(remove_outliers(plane, views, WITH_ENDS)[0]) == len(plane)
    doubled = np.concatenate([clean, clean])
    assert len(remove_outliers(doubled, views, WITH_ENDS)[0]) == len(doubled)


def test_ranges_are_ordered() -> None:
    with pytest.raises(ValidationError, match="lower limit first"):
        OutlierParameters(y_mm=(5.0, -5.0))


def test_ends_that_another_camera_sees_within_its_stripe_are_dropped(views: Views) -> None:
    """On a level sheet: camera 1 sees Y from -20 to 20, camera 3 from -10 to 40."""
    first = np.concatenate([line(1, frame, (-20.0, 40.0), (20.0, 40.0), 81) for frame in range(20)])
    third = np.concatenate([line(3, frame, (-10.0, 40.0), (40.0, 40.0), 101) for frame in range(20)])
    kept, removed = remove_outliers(np.concatenate([first, third]), views, OutlierParameters())
    code = 1 + REASONS.index("end")
    of_first, of_third = np.split(removed.codes, [len(first)])
    np.testing.assert_array_equal(of_first == code, first["y"] > 18.2)
    np.testing.assert_array_equal(of_third == code, third["y"] < -8.2)
    assert len(kept) == len(first) + len(third) - 2 * 4 * 20
    assert removed.counts[1]["end"] == removed.counts[3]["end"] == 4 * 20


def test_ends_that_nobody_else_sees_stay(views: Views) -> None:
    alone = np.concatenate([line(1, frame, (-20.0, 40.0), (20.0, 40.0), 81) for frame in range(20)])
    assert len(remove_outliers(alone, views, OutlierParameters())[0]) == len(alone)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_points_outside_the_control_volume_and_no_others_are_outside(ellipsoid: Film, views: Views, axis: str) -> None:
    clean, _ = ellipsoid()
    low, high = float(clean[axis].min()), float(clean[axis].max())
    for bounds in ((low, high), (low + 3.0, high - 3.0)):
        _, removed = remove_outliers(clean, views, OutlierParameters(**{f"{axis}_mm": bounds}))
        outside = (clean[axis] < bounds[0]) | (clean[axis] > bounds[1])
        assert np.array_equal(removed.codes == 1 + REASONS.index("volume"), outside)


def test_a_camera_that_saw_nothing_where_it_filmed_denies(ellipsoid: Film, views: Views) -> None:
    """A ledge that only camera 1 sees, in planes in which the others see the tip of the foot at most."""
    clean, _ = ellipsoid()
    ledge = np.concatenate([line(1, frame, (20.0, 30.0), (40.0, 34.0)) for frame in range(4, 8)])
    points = np.concatenate([clean, ledge])
    filmed = {camera: np.arange(0.0, 120.0, 2.0) for camera in views}
    _, removed = remove_outliers(points, views, WITH_ENDS, filmed)
    assert (removed.codes[len(clean) :] > 0).all()
    assert not removed.codes[: len(clean)].any()


def test_a_reflection_goes_as_a_whole(ellipsoid: Film, views: Views) -> None:
    """A tilted line that others deny where it leaves the foot, and that touches the foot at its end."""
    clean, _ = ellipsoid()
    spoilt = np.concatenate([line(1, frame, (0.0, 50.5), (0.0, 66.0), 60) for frame in range(20, 40)])
    assert sum(dropped(clean, spoilt, views).values()) == len(spoilt)


def test_much_that_is_not_the_foot_is_warned_of(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    _, removed = remove_outliers(clean, views, WITH_ENDS)
    assert removed.warnings == []
    spoilt = np.concatenate([line(3, frame, (-60.0, 40.0), (-55.0, 50.0), 100) for frame in range(-30, 90)])
    _, removed = remove_outliers(np.concatenate([clean, spoilt]), views, WITH_ENDS)
    share = len(spoilt) / (len(spoilt) + np.count_nonzero(clean["camera"] == 3))
    [warning] = removed.warnings
    assert warning.startswith(f"camera 3: {100 * share:.0f} % of its points are not the foot and were dropped")


def test_a_leg_above_the_calibrated_region_is_not_reported(ellipsoid: Film, views: Views) -> None:
    clean, _ = ellipsoid()
    low = {camera: View(view.centre, np.minimum(view.outline, 40.0)) for camera, view in views.items()}
    clean["supported"] = clean["z"] < 40.0
    _, removed = remove_outliers(clean, low, WITH_ENDS)
    assert sum(of["extrapolated"] for of in removed.counts.values()) > 0.01 * len(clean)
    assert not [warning for warning in removed.warnings if "calibration" in warning]

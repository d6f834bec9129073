import numpy as np
import pytest

from footscan.cloud.fusion.agreement import find_overlaps
from footscan.cloud.fusion.correction import Corrected, correct
from footscan.cloud.fusion.stripes import Stripes, sort_stripes
from footscan.cloud.points import make_points
from schemas.parameters.fusion import FusionParameters

SECTORS = {1: (-30, 110), 2: (-20, 120), 3: (70, 210), 4: (60, 200), 5: (200, 340), 6: (190, 330), 7: (230, 380)}
"""The part of the foot that each camera sees, in degrees from +Y towards +Z."""


def foot(
    behind: tuple[int, ...] = (), step: float = 2.0, noise: float = 0.01, frames: int = 45
) -> dict[int, np.ndarray]:
    """Something round that is 90 mm long, 70 mm wide and 60 mm high, by camera. It is not quite an ellipsoid, for
    such a one could be turned unseen. The planes of the cameras `behind` stand between those of the others."""
    random = np.random.default_rng(1)
    clouds = {}
    for camera, (low, high) in SECTORS.items():
        angle = np.radians(np.arange(low, high, 0.8))
        frame, place = np.divmod(np.arange(frames * len(angle)), len(angle))
        x = step * frame + 0.01 * camera + (step / 2 if camera in behind else 0.0)
        size = 0.5 + np.sqrt(np.maximum(0.0, 1 - (x / (step * frames) * 1.8 - 0.9) ** 2)) / 2
        bumps = 1 + 0.05 * np.cos(3 * angle[place] + x / 40) + random.normal(0, noise / 30, len(x))
        y, z = 35 * size * bumps * np.cos(angle[place]), 40 + 30 * size * bumps * np.sin(angle[place])
        clouds[camera] = make_points(np.column_stack([x, y, z]), camera, frame, np.arange(len(x)), sigma=noise)
    return clouds


def spoiled(points: np.ndarray, dy: float, dz: float, degrees: float = 0.0, bow: float = 0.0) -> np.ndarray:
    """`points` turned about (0, 40) and moved; `bow` adds to Z by the square of Y."""
    moved, angle = points.copy(), np.radians(degrees)
    y, z = points["y"].astype(float), points["z"].astype(float) - 40
    moved["y"] = y * np.cos(angle) - z * np.sin(angle) + dy
    moved["z"] = y * np.sin(angle) + z * np.cos(angle) + 40 + dz + bow * (y / 35) ** 2
    return moved


def corrected(clouds: dict[int, np.ndarray], **parameters: object) -> tuple[Stripes, Corrected]:
    chosen = FusionParameters(**parameters)
    stripes = sort_stripes(clouds.values())
    return stripes, correct(stripes, find_overlaps(stripes, stripes.yz, chosen.overlap_mm), chosen)


def errors(clouds: dict[int, np.ndarray], stripes: Stripes, result: Corrected) -> dict[int, float]:
    """Distances of each camera's points from the skin on which they lay before they were moved, mm rms."""
    found = {}
    for k, camera in enumerate(stripes.cameras):
        mine = stripes.camera == k
        truth = np.column_stack([clouds[int(camera)]["y"], clouds[int(camera)]["z"]])
        away = np.sum((result.yz[mine] - truth) * stripes.normals[mine], axis=1)
        found[int(camera)] = float(np.sqrt(np.mean(away**2)))
    return found


def kinds(result: Corrected) -> dict[int, str]:
    return {correction.camera: correction.kind for correction in result.corrections if correction.kind != "none"}


def test_cameras_that_agree_stay() -> None:
    stripes, result = corrected(foot())
    assert kinds(result) == {}
    np.testing.assert_array_equal(result.yz, stripes.yz)
    assert all(correction.points > 200 for correction in result.corrections)


@pytest.mark.parametrize("camera", [1, 4, 6])
def test_one_camera_comes_back(camera: int) -> None:
    clouds = foot()
    stripes, result = corrected(clouds | {camera: spoiled(clouds[camera], 0.16, -0.12, 0.1)})
    assert kinds(result) == {camera: "rigid"}
    assert result.corrections[camera - 1].rotation_deg == pytest.approx(-0.1, abs=0.05)
    before, after = result.corrections[camera - 1].held_out_before_mm, result.corrections[camera - 1].held_out_after_mm
    assert before is not None
    assert after is not None
    assert before > 0.08
    assert after < 0.03
    assert errors(clouds, stripes, result)[camera] < 0.01


def test_two_cameras_of_one_head_come_back() -> None:
    clouds = foot()
    stripes, result = corrected(clouds | {k: spoiled(clouds[k], 0.16, -0.12, 0.1) for k in (1, 2)})
    assert kinds(result) == {1: "rigid", 2: "rigid"}
    assert max(errors(clouds, stripes, result).values()) < 0.02


def test_all_cameras_off_by_chance_come_closer_without_moving_all_alike() -> None:
    clouds = foot()
    random = np.random.default_rng(3)
    off = {camera: spoiled(cloud, *random.normal(0, 0.1, 2)) for camera, cloud in clouds.items()}
    stripes, result = corrected(off)
    assert len(kinds(result)) >= 6
    untouched = errors(clouds, stripes, Corrected(stripes.yz, [], {}))
    assert sum(errors(clouds, stripes, result).values()) < 0.6 * sum(untouched.values())


def test_a_bent_camera_is_straightened() -> None:
    clouds = foot()
    stripes, result = corrected(clouds | {3: spoiled(clouds[3], 0.0, 0.0, bow=0.4)})
    assert kinds(result)[3] == "quadratic"
    assert errors(clouds, stripes, result)[3] < 0.04
    assert max(errors(clouds, stripes, result).values()) < 0.04


def test_planes_between_each_others_serve_too() -> None:
    clouds = foot(behind=(2, 4, 6))
    assert kinds(corrected(clouds)[1]) == {}
    _, result = corrected(clouds | {1: spoiled(clouds[1], 0.16, -0.12, 0.1)})
    assert kinds(result) == {1: "rigid"}


def test_what_would_have_to_move_too_far_stays_and_is_named() -> None:
    clouds = foot()
    stripes, result = corrected(clouds | {2: spoiled(clouds[2], 1.1, 0.9)})
    assert list(result.too_far) == [2]
    assert result.too_far[2] == pytest.approx(np.hypot(1.1, 0.9), rel=0.1)
    assert kinds(result) == {}
    np.testing.assert_array_equal(result.yz, stripes.yz)


def test_too_little_overlap_moves_nothing() -> None:
    clouds = foot()
    off = spoiled(clouds[2], 0.16, -0.12)
    few = {1: clouds[1], 2: off[off["frame"] < 8]}
    assert kinds(corrected(few)[1]) == {}
    assert corrected({2: off})[1].corrections[0].points == 0


def test_it_can_be_switched_off() -> None:
    clouds = foot()
    stripes, result = corrected(clouds | {1: spoiled(clouds[1], 0.16, -0.12)}, correct_cameras=False)
    np.testing.assert_array_equal(result.yz, stripes.yz)
    assert [correction.kind for correction in result.corrections] == ["none"] * len(SECTORS)

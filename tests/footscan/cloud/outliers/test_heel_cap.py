"""Stripes of another laser on a heel are found by its form; toes, and what no other laser explains, stay."""

import numpy as np

from footscan.cloud.outliers.heel_cap import is_off_cap

RADIUS = 30.0
"""Of the heel, mm."""
WAY = np.array([-0.5, 0.12, -0.08])
"""From the plane of one laser to that of another along the sight of a camera, mm."""
ANGLES = np.linspace(0.0, 2 * np.pi, 90, endpoint=False)


def ring(depth: float, angles: np.ndarray = ANGLES, radius: float = RADIUS, y: float = 0.0) -> np.ndarray:
    """A stripe on a sphere that begins at X = 0."""
    across = np.sqrt(2 * radius * depth - depth**2)
    return np.column_stack([np.full(len(angles), depth), y + across * np.cos(angles), 40.0 + across * np.sin(angles)])


def seen(stripes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The points of stripes, their numbers, and their places in the planes of their laser and of another one."""
    xyz = np.concatenate(stripes)
    number = np.repeat(np.arange(len(stripes)), [len(stripe) for stripe in stripes])
    return xyz, number, np.array([xyz, xyz + WAY])


def selected(stripes: list[np.ndarray]) -> list[int]:
    xyz, number, places = seen(stripes)
    found = is_off_cap(xyz, np.ones(len(xyz), np.bool_), number, places)
    share = np.bincount(number, found) / np.bincount(number)
    assert set(share.tolist()) <= {0.0, 1.0}
    return np.flatnonzero(share).tolist()


def displaced(stripe: np.ndarray) -> np.ndarray:
    """A stripe of the other laser as it comes to lie in the plane of the camera's own one."""
    return stripe - WAY


HEEL = [ring(depth) for depth in np.arange(0.9, 12.0, 1.0)]


def test_the_first_ring_of_another_laser_is_found() -> None:
    half = ANGLES[:45]
    assert selected([*HEEL, displaced(ring(0.6, half)), displaced(ring(2.6, half))]) == [len(HEEL), len(HEEL) + 1]


def test_two_cameras_that_see_it_do_not_confirm_each_other() -> None:
    twins = [displaced(ring(0.6, ANGLES[:40])) + np.array([0.0, 0.1 * k, 0.0]) for k in range(2)]
    assert selected([*HEEL, *twins]) == [len(HEEL), len(HEEL) + 1]


def test_what_no_other_laser_explains_is_kept() -> None:
    lump = ring(2.0, ANGLES[:10]) - np.array([0.6, 0.0, 0.0])
    assert selected([*HEEL, lump]) == []


def test_the_other_end_of_a_travel() -> None:
    mirrored = [stripe * np.array([-1.0, 1.0, 1.0]) for stripe in [*HEEL, displaced(ring(0.6, ANGLES[:45]))]]
    xyz, number, places = seen(mirrored)
    places[1] = xyz + WAY * np.array([-1.0, 1.0, 1.0])
    found = is_off_cap(xyz, np.ones(len(xyz), np.bool_), number, places)
    assert np.unique(number[found]).tolist() == [len(HEEL)]


def test_toes_are_no_cap() -> None:
    toes = [ring(depth, radius=7.0, y=y) for y in (-24.0, -8.0, 8.0, 24.0) for depth in np.arange(0.9, 7.0, 1.0)]
    assert selected([*toes, displaced(ring(0.6, ANGLES[:45], 7.0, 8.0))]) == []


def test_a_laser_whose_plane_is_not_known_says_nothing() -> None:
    xyz, number, places = seen([*HEEL, displaced(ring(0.6, ANGLES[:45]))])
    places[1] = np.nan
    assert not is_off_cap(xyz, np.ones(len(xyz), np.bool_), number, places).any()


def test_few_points_make_no_cap() -> None:
    xyz, number, places = seen([HEEL[0]])
    assert not is_off_cap(xyz, np.ones(len(xyz), np.bool_), number, places).any()
    assert not is_off_cap(xyz[:0], np.ones(0, np.bool_), number[:0], places[:, :0]).any()

"""Cameras that stand at random about the foot."""

import numpy as np
import pytest
from pydantic import ValidationError

from footscan.virtual.worlds.machine import machine_of
from footscan.virtual.worlds.rig import cameras_of
from schemas.world import World, WorldRig


@pytest.mark.parametrize(("above", "below"), [(2, 0), (2, 2), (3, 3), (6, 6), (0, 2)])
def test_each_camera_sees_the_plane_of_its_head(above: int, below: int) -> None:
    cameras = cameras_of(World(seed=3, rig=WorldRig(above=above, below=below)))
    assert list(cameras) == list(range(1, above + below + 1))
    for number, (camera, head) in cameras.items():
        assert camera.id == number
        assert camera.below_glass == (number > above) == (head == 2)
        if head < 2:
            assert (head == 0) == (camera.position[1] > 0.0)
        i, j = camera.project(np.array([[0.0, 0.0, 10.0]]))[0]
        assert 0.0 < i < 640.0
        assert 0.0 < j < 480.0


def test_places_follow_from_the_seed() -> None:
    def places(seed: int) -> np.ndarray:
        rig = WorldRig(above=3, below=3)
        return np.array([camera.position for camera, _ in cameras_of(World(seed=seed, rig=rig)).values()])

    np.testing.assert_array_equal(places(1), places(1))
    assert np.abs(places(1) - places(2)).min() > 1e-6


def test_the_standard_scanner_has_two_cameras_on_each_upper_head_and_four_below() -> None:
    assert machine_of(World(seed=1)).head_of == {1: 0, 2: 0, 3: 1, 4: 1, 5: 2, 6: 2, 7: 2, 8: 2}


def test_too_many_cameras_are_refused() -> None:
    for above, below in ((7, 6), (0, 0)):
        with pytest.raises(ValidationError, match="expected 1 to 12 cameras"):
            WorldRig(above=above, below=below)

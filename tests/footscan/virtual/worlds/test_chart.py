"""The chart that a world's scanner is calibrated with."""

import csv
import io

import numpy as np
import pytest

from footscan.virtual.worlds.chart import world_chart
from footscan.virtual.worlds.machine import machine_of
from schemas.world import World, WorldCameras, WorldHead, WorldLaser


def rows_of(world: World) -> list[dict[str, float]]:
    text = world_chart(machine_of(world))
    return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(io.StringIO(text))]


def test_corners_are_where_the_camera_sees_them() -> None:
    world = World(seed=2, cameras=WorldCameras(corner_px=0.0))
    machine = machine_of(world)
    rows = rows_of(world)
    assert {row["camera"] for row in rows} == set(range(1, 9))
    for row in rows:
        exact = machine.calibrated[int(row["camera"])].project(np.array([[0.0, row["y_mm"], row["z_mm"]]]))[0]
        assert [row["i"], row["j"]] == pytest.approx(exact, abs=1e-3)


def test_cameras_below_see_corners_in_both_planes() -> None:
    world = World(seed=2, cameras=WorldCameras(corner_px=0.0), laser=WorldLaser(lower_lasers=2, lower_apart_mm=12.0))
    machine, rows = machine_of(world), rows_of(world)
    lasers = {camera: {row["laser"] for row in rows if row["camera"] == camera} for camera in range(1, 9)}
    assert lasers == {camera: {1.0, 2.0} if camera > 4 else {1.0} for camera in range(1, 9)}
    for row in rows:
        assert row["x_mm"] == 12.0 * (row["laser"] - 1)
        exact = machine.calibrated[int(row["camera"])].project(np.array([[row["x_mm"], row["y_mm"], row["z_mm"]]]))[0]
        assert [row["i"], row["j"]] == pytest.approx(exact, abs=1e-3)


def test_each_camera_has_enough_of_them() -> None:
    cameras = [int(row["camera"]) for row in rows_of(World(seed=2))]
    assert min(cameras.count(camera) for camera in range(1, 9)) >= 40


def corners(head: WorldHead, camera: int) -> dict[tuple[float, float], float]:
    """Columns of the pixels of corners, by Y and Z, for a first head with errors."""
    world = World(seed=2, heads=(head, WorldHead(), WorldHead()), cameras=WorldCameras(corner_px=0.0))
    return {(row["y_mm"], row["z_mm"]): row["i"] for row in rows_of(world) if row["camera"] == camera}


@pytest.mark.parametrize(("head", "least_px", "most_px"), [
    (WorldHead(offset_mm=3.0), 0.0, 1e-3),  # the object's edges run along X
    (WorldHead(yaw_deg=1.0), 0.0, 0.1),  # lasers and cameras turn together: X is wrong, the pixels are not
    (WorldHead(roll_deg=1.0), 1.0, 10.0),
])  # fmt: skip
def test_what_the_chart_shows_of_a_head(head: WorldHead, least_px: float, most_px: float) -> None:
    before, after = corners(WorldHead(), 1), corners(head, 1)
    moved = [abs(after[place] - before[place]) for place in before.keys() & after.keys()]
    assert least_px <= max(moved) < most_px
    assert corners(head, 3) == corners(WorldHead(), 3)

"""A scan with laser-off frames, from the virtual scanner's films to the results."""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from bench_scan import FRAMES

from footscan.virtual.filming.film import write_film

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]

CAMERA = 1
STEPS_OF_THE_SCAN = 40


@pytest.fixture(scope="session")
def laser_off(laser_off_films: Path) -> list[bytes]:
    """The pictures of one camera of the bench's scan, taken again with the laser off."""
    return [picture.read_bytes() for picture in sorted(laser_off_films.iterdir())]


def test_scan_with_a_background(footscan: Footscan, mistake: Mistake, bench: Path, laser_off: list[bytes]) -> None:
    scan, results = bench / "archive/P0001/small", bench / "results/P0001/small"
    before = json.loads((results / "quality.json").read_bytes())
    text = (scan / "scan.yaml").read_text()
    (scan / "scan.yaml").write_text(text.replace("file: cam1.avi", "file: cam1.avi, background: off/cam1.avi"))

    done = footscan("plan", bench / "workflow.yaml", "--json")
    assert done.returncode == 1
    assert mistake(done) == f"{scan / 'off/cam1.avi'}: no such film"

    (scan / "off").mkdir()
    write_film(scan / "off/cam1.avi", laser_off[:-1], 640, 480, 18)
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 1
    expected = (
        f"{scan / 'off/cam1.avi'}: frames: expected one frame or {FRAMES}, as many as the film has, found {FRAMES - 1}"
    )
    assert mistake(done).startswith(expected)

    write_film(scan / "off/cam1.avi", laser_off, 640, 480, 18)
    plan = json.loads(footscan("plan", bench / "workflow.yaml", "--json").stdout)
    assert plan["steps"] == STEPS_OF_THE_SCAN + 3  # and its colours, and those of the surface
    reasons = {(miss["step"], miss["camera"]): miss["reason"] for miss in plan["misses"]}
    assert reasons["background", CAMERA] == "cam1-background is not there"
    assert reasons["extract", CAMERA] == "waits for background of camera 1"
    assert {camera for step, camera in reasons if camera is not None} == {CAMERA}
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ran"] >= 2
    after = json.loads((results / "quality.json").read_bytes())
    one, *others = (camera["points"] for camera in after["cameras"])
    one_before, *others_before = (camera["points"] for camera in before["cameras"])
    assert one == pytest.approx(one_before, rel=0.1)
    assert others == others_before
    assert after["truth"]["mean"] == pytest.approx(before["truth"]["mean"], abs=0.05)

    (scan / "scan.yaml").write_text(text)
    plan = json.loads(footscan("plan", bench / "workflow.yaml", "--json").stdout)
    assert (plan["steps"], plan["misses"]) == (STEPS_OF_THE_SCAN, [])

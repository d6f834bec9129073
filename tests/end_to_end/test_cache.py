"""Nothing is computed twice, nothing stale is kept, and what is damaged is made anew."""

import hashlib
import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest
import trimesh

from footscan.virtual.foot.foot import make_foot
from tests.helpers.stored_frames import frame_bytes, put_frame

Footscan = Callable[..., CompletedProcess[str]]
Results = Callable[[Path], dict[str, bytes]]
STEPS = 40
"""Ingest, extract and map of 8 cameras; fuse, clean, orient, surface, measure, verify, quality, 2 exports, report."""
OF_CAMERAS = {"ingest", "extract", "map"}


def plan(footscan: Footscan, bench: Path) -> dict[str, Any]:
    done = footscan("plan", bench / "workflow.yaml", "--json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert document["steps"] == STEPS == document["hits"] + len(document["misses"])
    return document


def missed(planned: dict[str, Any]) -> list[tuple[str, int | None]]:
    return [(miss["step"], miss["camera"]) for miss in planned["misses"]]


def run(footscan: Footscan, bench: Path) -> dict[str, Any]:
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def rows(bench: Path) -> dict[str, list[Path]]:
    """Rows of the action cache by kind of step."""
    found: dict[str, list[Path]] = {}
    for row in sorted((bench / "results" / ".footscan" / "actions").rglob("*.json")):
        found.setdefault(json.loads(row.read_bytes())["image"]["step"], []).append(row)
    return found


def replace(file: Path, content: bytes) -> None:
    """Files of the store and of the frames are linked to those of other tests."""
    file.unlink()
    file.write_bytes(content)


def set_parameters(bench: Path, parameters: str) -> None:
    with (bench / "workflow.yaml").open("a") as file:
        file.write(f"parameters: {parameters}\n")


def change_calibration(bench: Path, cameras: set[int]) -> None:
    """Shift the Y of some cameras by 0.1 mm."""
    file = bench / "calibration.json"
    calibration = json.loads(file.read_bytes())
    for camera in calibration["cameras"]:
        if camera["camera"] in cameras:
            camera["map"]["matrix"][2] += 0.1
    file.write_text(json.dumps(calibration))


def test_before_the_first_run_all_is_to_do(footscan: Footscan, fresh: Path) -> None:
    planned = plan(footscan, fresh)
    assert planned["hits"] == 0
    assert all(set(miss) == {"scan", "step", "camera", "reason"} for miss in planned["misses"])
    assert {miss["scan"] for miss in planned["misses"]} == {"P0001/small"}
    assert missed(planned)[0] == ("ingest", 1)
    assert not (fresh / "results").exists()  # a plan leaves nothing behind


def test_a_second_run_does_nothing(command: Footscan, bench: Path, results: Results) -> None:
    command("run", bench / "workflow.yaml")  # files just copied are too young for their digests to be remembered
    before = results(bench)
    start = time.perf_counter()
    done = command("run", bench / "workflow.yaml", "--json")
    print(f"second run: {time.perf_counter() - start:.2f} s of process, goal 3 s")
    assert done.returncode == 0
    assert done.stderr == f"0 of {STEPS} steps to run\n"
    assert json.loads(done.stdout) == {
        "steps": STEPS,
        "planned": 0,
        "ran": 0,
        "scans": [
            {
                "scan": "P0001/small",
                "status": "done",
                "results": str(bench / "results" / "P0001" / "small"),
                "problem": None,
                "warnings": json.loads(results(bench)["quality.json"])["scan_warnings"],
            }
        ],
    }
    assert results(bench) == before


def test_without_a_workflow_the_cache_is_the_same(footscan: Footscan, bench: Path) -> None:
    scan = ("--scan", bench / "archive/P0001/small", "--calibration", bench / "calibration.json")
    done = footscan("run", *scan, "--out", bench / "results")
    assert done.returncode == 0
    assert done.stderr.splitlines()[0] == f"0 of {STEPS} steps to run"


def test_an_outlier_parameter_concerns_what_follows_the_filter(footscan: Footscan, bench: Path) -> None:
    before = rows(bench)
    set_parameters(bench, "{outliers: {z_mm: [-150, 90]}}")
    planned = plan(footscan, bench)
    assert missed(planned)[0] == ("clean", None)
    assert planned["misses"][0]["reason"] == "parameter z_mm changed"
    assert not {step for step, _ in missed(planned)} & OF_CAMERAS
    assert run(footscan, bench)["ran"] == len(planned["misses"]) == 15
    after = rows(bench)
    assert all(after[step] == before[step] for step in OF_CAMERAS)
    mesh = trimesh.load_mesh(bench / "results/P0001/small/foot.stl")
    assert 80.0 < mesh.bounds[1][2] <= 90.0  # the leg, open there, is cut where its outline is still seen
    set_parameters_back = (bench / "workflow.yaml").read_text().replace("[-150, 90]", "null")
    (bench / "workflow.yaml").write_text(set_parameters_back)  # the default, written out
    assert plan(footscan, bench)["misses"] == []


def test_one_cameras_calibration_concerns_its_map_alone(footscan: Footscan, bench: Path) -> None:
    change_calibration(bench, {3})
    planned = plan(footscan, bench)
    assert [step for step in missed(planned) if step[0] in OF_CAMERAS] == [("map", 3)]
    assert planned["misses"][0]["reason"] == "input calibration changed"
    change_calibration(bench, set(range(1, 9)))
    planned = plan(footscan, bench)
    assert [step for step in missed(planned) if step[0] in OF_CAMERAS] == [("map", camera) for camera in range(1, 9)]


def test_a_byte_of_a_film_concerns_its_camera(footscan: Footscan, bench: Path) -> None:
    before = rows(bench)
    film = bench / "archive/P0001/small/cam5.avi"
    content = bytearray(film.read_bytes())
    end_of_picture = content.rfind(b"\xff\xd9")
    where = next(k for k in range(end_of_picture - 200, 0, -1) if content[k - 1] < 0x80 and 0 < content[k] < 0x80)
    content[where] ^= 1  # within the entropy-coded data of a picture, near its end
    film.write_bytes(content)
    planned = plan(footscan, bench)
    assert missed(planned)[0] == ("ingest", 5)
    assert planned["misses"][0]["reason"] == "input film changed"
    assert {camera for step, camera in missed(planned) if step in OF_CAMERAS} == {5}
    run(footscan, bench)
    after = rows(bench)
    assert {step: len(after[step]) - len(before[step]) for step in ("ingest", "extract")} == {"ingest": 1, "extract": 1}
    assert plan(footscan, bench)["misses"] == []


def test_a_deleted_result_comes_back_without_work(footscan: Footscan, bench: Path, results: Results) -> None:
    before = results(bench)
    for name in ("foot.stl", "report.html"):
        (bench / "results/P0001/small" / name).unlink()
    (bench / "results/P0001/small/measures.json").write_text("{}")
    assert run(footscan, bench)["ran"] == 0
    assert results(bench) == before


def test_a_damaged_blob_is_told_and_made_anew(command: Footscan, bench: Path) -> None:
    fused = json.loads(rows(bench)["fuse"][0].read_bytes())["digest"]
    blob = bench / "results/.footscan/blobs" / fused[:2] / fused
    content = bytearray(blob.read_bytes())
    content[len(content) // 2] ^= 1
    replace(blob, bytes(content))
    set_parameters(bench, "{outliers: {shortest: 2}}")
    done = command("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    assert f"footscan: {blob}: damaged, will be made again" in done.stderr.splitlines()
    assert "Traceback" not in done.stderr
    assert hashlib.sha256(blob.read_bytes()).hexdigest() == fused
    again = command("run", bench / "workflow.yaml")
    assert (again.returncode, again.stderr.splitlines()[0]) == (0, f"0 of {STEPS} steps to run")


def test_a_store_that_is_damaged_all_over_is_made_anew(footscan: Footscan, bench: Path, results: Results) -> None:
    before = results(bench)
    blobs = sorted((bench / "results/.footscan/blobs").glob("*/*"))
    for blob in blobs:
        content = bytearray(blob.read_bytes())
        content[len(content) // 2] ^= 1
        replace(blob, bytes(content))
    set_parameters(bench, "{outliers: {shortest: 2}}")
    assert run(footscan, bench)["planned"] == STEPS  # what has been touched is looked at by the plan
    (bench / "workflow.yaml").write_text(
        (bench / "workflow.yaml").read_text().replace("shortest: 2", "shortest: 3")
    )  # the default
    run(footscan, bench)
    assert results(bench) == before


def test_frames_that_are_gone_are_ingested_again(footscan: Footscan, bench: Path, results: Results) -> None:
    before = results(bench)
    frames = bench / "archive/P0001/small/frames.zarr/cam3"
    chunks = {file.name: file.read_bytes() for file in frames.iterdir()}
    shutil.rmtree(frames)
    planned = plan(footscan, bench)
    assert missed(planned)[0] == ("ingest", 3)
    assert planned["misses"][0]["reason"] == "cam3 is not there"
    assert run(footscan, bench)["ran"] == 1  # its frames are what they were, so nothing follows
    assert {file.name: file.read_bytes() for file in frames.iterdir()} == chunks
    assert results(bench) == before


def test_a_damaged_frame_is_ingested_again(footscan: Footscan, bench: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Another parameter of the extraction has it read the frames again."""
    array = bench / "archive/P0001/small/frames.zarr/cam2"
    sound = frame_bytes(array, 40)
    put_frame(array, 40, sound[:-1000] + bytes(1000))
    set_parameters(bench, "{extraction: {red_threshold: 19}}")
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    assert f"{array}: frame 40 is damaged" in caplog.text
    assert frame_bytes(array, 40) == sound
    mesh = trimesh.load_mesh(bench / "results/P0001/small/foot.stl")
    foot = make_foot(side="right")
    assert mesh.extents[1] == pytest.approx(np.ptp(foot.vertices[:, 1]), abs=1.5)

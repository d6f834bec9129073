"""The graph of a scan: the steps that run again after a change."""

import html
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from made_up_scan import recorded

from footscan.recordings.scans import read_scan
from footscan.scan import open_scan
from pipelines.engine.actions.step import Output
from pipelines.engine.files.file_digests import FileDigests
from pipelines.scan import DELIVERED, CalibrationFile, scan_steps, source_files
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration
from schemas.parameters.scan import ScanParameters
from schemas.quality import Quality
from tests.helpers.stored_frames import frame_bytes, put_frame

FROM_CLEAN = {
    "clean", "fuse", "orient", "surface", "measure", "quality", "quality.json", "sizes.json", "cloud.ply", "foot.stl",
    "foot.ply", "pictures", "deviations", "report",
}  # fmt: skip
CAMERAS = {f"{kind}-{camera}" for kind in ("ingest", "extract", "map") for camera in (1, 5)}
ALL = CAMERAS | {"heads"} | FROM_CLEAN


def change_byte(film: Path) -> None:
    """One pixel's worth of the fourth picture, in the middle of its entropy-coded data."""
    data = bytearray(film.read_bytes())
    starts = [found.start() for found in re.finditer(b"\xff\xd8\xff", data)]
    data[(starts[3] + starts[4]) // 2] ^= 1
    film.write_bytes(data)


def test_steps_stand_behind_those_whose_results_they_take(
    archive: Any, calibration: Callable[..., Calibration]
) -> None:
    calibrated = CalibrationFile(archive.root / "calibration.json", calibration(), "0" * 64)
    digests = FileDigests(archive.root / "files.json")
    steps = scan_steps(read_scan(archive.scan), calibrated, ScanParameters(), digests)
    known: set[str] = set()
    for step in steps:
        assert {source.step for source in step.inputs.values() if isinstance(source, Output)} <= known
        known.add(step.name)
    assert known == {f"P0001/S1/{name}" for name in ALL}
    assert set(DELIVERED.values()) <= {step.kind for step in steps}


def test_nothing_has_run(archive: Any) -> None:
    steps, reasons = archive.plan()
    assert (steps, set(reasons)) == (21, ALL)
    assert reasons["ingest-1"] == "never run"
    assert reasons["extract-5"] == "waits for ingest of camera 5"
    assert reasons["clean"] == "waits for map of camera 1"
    assert not archive.results.exists()


def test_second_run_does_nothing(done: Any) -> None:
    assert done.plan() == (21, {})
    before = {path: path.stat().st_mtime_ns for path in done.root.rglob("*") if path.is_file()}
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, set())
    after = {path: path.stat().st_mtime_ns for path in done.root.rglob("*") if path.is_file()}
    assert {path for path in before | after if before.get(path) != after.get(path)} <= {
        done.root / "results/.footscan/files.json",
        done.root / "results/.footscan/known.sqlite",
    }


def test_another_outlier_parameter_runs_from_the_filter_on(done: Any) -> None:
    done.set_parameters("{outliers: {shortest: 2}}")
    _, reasons = done.plan()
    assert set(reasons) == FROM_CLEAN
    assert reasons["clean"] == "parameter shortest changed"
    _, ran = done.run()
    assert "clean" in ran
    assert ran <= FROM_CLEAN
    assert done.plan() == (21, {})
    done.set_parameters("{}")
    assert done.plan() == (21, {})


def test_another_calibration_leaves_the_extraction_alone(done: Any, calibration: Callable[..., Calibration]) -> None:
    path = done.root / "calibration.json"
    path.write_text(calibration(1.01).model_dump_json())
    _, reasons = done.plan()
    assert set(reasons) == ALL - {"ingest-1", "ingest-5", "extract-1", "extract-5"}
    assert reasons["map-1"] == reasons["map-5"] == "input calibration changed"
    scaled = calibration(1.01)
    cameras = [scaled.camera(1), calibration().camera(5)]
    path.write_text(scaled.model_copy(update={"cameras": cameras}).model_dump_json())
    _, reasons = done.plan()
    assert "map-1" in reasons
    assert "map-5" not in reasons


def test_another_pass_runs_from_the_filter_on(done: Any) -> None:
    document = done.scan / "scan.yaml"
    content = yaml.safe_load(document.read_text())
    content["cameras"][1]["pass_number"] = 2
    document.write_text(yaml.safe_dump(content))
    _, reasons = done.plan()
    assert set(reasons) == FROM_CLEAN
    [scan], _ = done.run()
    assert scan.problem is None
    quality = Quality.model_validate_json((done.results / "quality.json").read_text())
    assert quality.movement is not None
    assert quality.movement.first_moments.keys() == {5}
    opened = open_scan(done.scan, done.root / "calibration.json")
    assert opened.movement == quality.movement


def test_changed_byte_runs_its_camera_and_what_follows(done: Any) -> None:
    film = done.scan / "cam5.avi"
    before = film.stat()
    change_byte(film)
    os.utime(film, ns=(before.st_atime_ns, before.st_mtime_ns))
    _, reasons = done.plan()
    assert reasons["ingest-5"] == "input film changed"
    assert set(reasons) == {"ingest-5", "extract-5", "map-5", "heads"} | FROM_CLEAN
    assert all(reason.startswith("waits for ") for name, reason in reasons.items() if name != "ingest-5")
    [scan], ran = done.run()
    assert scan.problem is None
    assert {"ingest-5", "extract-5"} <= ran
    assert not ran & {"ingest-1", "extract-1", "map-1"}
    assert done.plan() == (21, {})


def test_film_that_is_put_back_is_extracted_from_its_own_frames(done: Any) -> None:
    film = done.scan / "cam5.avi"
    original = film.read_bytes()
    change_byte(film)
    done.run()
    film.write_bytes(original)
    done.set_parameters("{extraction: {red_threshold: 20}}")  # what must be extracted lies under other frames now
    [scan], ran = done.run()
    assert scan.problem is None
    assert {"ingest-5", "extract-5"} <= ran
    assert done.plan() == (21, {})


@pytest.mark.parametrize("damage", ["removed", "changed"])
def test_results_come_back_without_a_step(done: Any, damage: str) -> None:
    stl = done.results / "foot.stl"
    content = stl.read_bytes()
    if damage == "removed":
        stl.unlink()
    else:
        stl.write_bytes(b"solid")
    assert done.plan() == (21, {})
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, set())
    assert stl.read_bytes() == content


def test_damaged_frame_is_ingested_anew_within_the_run(done: Any) -> None:
    array = done.scan / "frames.zarr/cam1"
    whole = frame_bytes(array, 6)
    put_frame(array, 6, whole[:-9])
    done.set_parameters("{extraction: {red_threshold: 20}}")
    [scan], ran = done.run()
    assert scan.problem is None
    assert "ingest-1" in ran
    assert "ingest-5" not in ran
    assert frame_bytes(array, 6) == whole


def test_removed_frames_are_ingested_and_the_rest_is_a_hit(done: Any) -> None:
    import shutil

    shutil.rmtree(done.scan / "frames.zarr")
    _, reasons = done.plan()
    assert (reasons["ingest-1"], reasons["ingest-5"]) == ("cam1 is not there", "cam5 is not there")
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {"ingest-1", "ingest-5"})


def test_results_are_the_same_to_the_byte_in_another_place(archive: Any, done: Any) -> None:
    archive.run()
    for name in DELIVERED:
        assert (archive.results / name).read_bytes() == (done.results / name).read_bytes(), name


def test_positions_and_travel(done: Any) -> None:
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("file: cam5.avi", "file: cam5.avi, positions: cam5.csv"))
    rows = [f"{frame},{frame * 10.0}\n" for frame in range(20)]
    (done.scan / "cam5.csv").write_text("frame,x_mm\n" + "".join(rows[:7] + rows[8:]))
    _, reasons = done.plan()
    assert reasons["map-5"] == "input positions changed, input travel changed"
    assert "map-1" not in reasons
    [scan], _ = done.run()
    problem, _, stays = scan.problem.partition(" (")
    assert (problem, scan.kind) == ("cam5.csv: frame: expected a position for each of 20 frames", "refused")
    assert stays.endswith("P0001/S1 still holds the results of an earlier run)")
    (done.scan / "cam5.csv").write_text("frame,x_mm\n" + "".join(rows))
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {"map-5"})  # the same X as before, and so all the rest


def test_source_files_of_a_folder_follow_names_and_contents(tmp_path: Path) -> None:
    folder = tmp_path / "cam1"
    folder.mkdir()
    for name, content in (("a.png", b"1"), ("b.png", b"2"), ("notes.txt", b"3")):
        (folder / name).write_bytes(content)
    digests = FileDigests(tmp_path / "files.json")
    first = source_files(folder, digests)
    assert [path.name for path, _ in first.states] == ["a.png", "b.png"]
    (folder / "notes.txt").write_bytes(b"4")
    assert source_files(folder, digests).digest == first.digest
    (folder / "b.png").rename(folder / "c.png")
    renamed = source_files(folder, digests)
    (folder / "c.png").write_bytes(b"5")
    assert len({first.digest, renamed.digest, source_files(folder, digests).digest}) == 3
    assert len(source_files(folder / "a.png", digests).states) == 1
    with pytest.raises(RefusedInput, match="no such film"):
        source_files(tmp_path / "missing.avi", digests)


def test_a_posture_is_in_the_measures_and_only_they_are_taken_again(done: Any) -> None:
    description = done.scan / "scan.yaml"
    before = json.loads((done.results / "measures.json").read_bytes())
    assert before["posture"] == "unknown"
    description.write_text(f"{description.read_text()}posture: half_weight\n")
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {"measure", "sizes.json", "quality.json", "report"})
    assert json.loads((done.results / "measures.json").read_bytes()) == before | {"posture": "half_weight"}


def test_the_pictures_of_a_camera_show_one_cut(done: Any) -> None:
    page = (done.results / "report.html").read_text()
    shown = re.findall(r'<b>Camera (\d+)</b> frame (\d+), .*?viewBox="([^"]*)"', page)
    assert len({frame for _, frame, _ in shown}) > 5
    cuts = {(camera, cut) for camera, _, cut in shown}
    assert sorted(camera for camera, _ in cuts) == sorted({camera for camera, _, _ in shown})


def test_the_recording_of_a_scan_adds_to_its_warnings(done: Any) -> None:
    """How a scan was filmed is read by the step that collects the warnings, and by no other."""
    recording = done.scan / "recording.json"
    recording.write_text(recorded(0, None, ["camera 7 is left out: no frame"]).model_dump_json())
    before = json.loads((done.results / "quality.json").read_bytes())["scan_warnings"]
    [scan], ran = done.run()
    assert (scan.problem, ran) == (None, {"quality.json", "report"})
    after = json.loads((done.results / "quality.json").read_bytes())["scan_warnings"]
    assert list(scan.warnings) == after
    assert {*after} - {*before} == {
        "Camera 7 is left out: no frame.",
        "The latency of camera 3 was never measured, so lengths along the foot may be off: run 'footscan calibrate "
        "latency'.",
    }
    page = (done.results / "report.html").read_text()
    assert all(f"<li>{html.escape(warning)}</li>" in page for warning in after)
    recording.write_text("of another program")
    done.run()
    assert json.loads((done.results / "quality.json").read_bytes())["scan_warnings"] == before

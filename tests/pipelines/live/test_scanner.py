"""The live scanner with a virtual board and two cameras that film a made-up foot: stored scans, states, refusals."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from checked import made_check
from live_bench import DAY, FOOT_MM, LENGTH_MM, THREE_HEADS, Bench, open_bench
from waiting import wait_until

from footscan.ahead_of_time import Compilation
from footscan.calibration.travel.body import standard_body
from footscan.capture import frame_positions, latency
from footscan.capture.cameras.usb_bus import Pass
from footscan.frames.film import open_film
from footscan.frames.travel import read_positions
from footscan.recordings.calibration_checks import check_of_scan, checks_of
from footscan.recordings.scans import read_scan
from pipelines.archive.job import Job
from pipelines.archive.planning import PlannedJob, Waiting, plan_job
from pipelines.calibration_check import store_check
from pipelines.live import measuring, scanner, storing
from pipelines.live.calibrating.body_film import film_body
from pipelines.live.calibrating.live import LiveStanding
from pipelines.live.calibrating.stills import live_stills
from pipelines.live.light import light_by_hand
from pipelines.live.state import ScannerState
from pipelines.live.storing import next_scan_name
from pipelines.scan import SHOWN
from schemas.base.errors import Fault, Finding, RefusedInput
from schemas.base.json_files import read_json
from schemas.calibration_check import CalibrationCheck
from schemas.recording import Recording
from schemas.rig import RigHead, RigTravel

pytestmark = pytest.mark.real_time  # cameras stream while heads move


class Compiling(Compilation):
    """Loops that are compiled while one waits for them."""

    is_done = False

    def __init__(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        super().__init__()
        self._meanwhile = meanwhile

    def wait(self, on_look: Callable[[], None] = lambda: None) -> None:
        self._meanwhile()
        on_look()


@pytest.fixture
def lenient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy host times frames badly and reports it; the accuracy of positions is not tested here."""
    monkeypatch.setattr(storing, "LARGEST_SD_MM", 5.0)
    monkeypatch.setattr(frame_positions, "LARGEST_SD_MM", 5.0)


@pytest.fixture
def bench(pristine: Path, tmp_path: Path, lenient: None) -> Iterator[Bench]:  # noqa: ARG001
    with open_bench(pristine, tmp_path) as one:
        yield one


def test_a_foot_is_scanned_and_measured(bench: Bench, pristine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calibration, results = pristine / "calibration.json", bench.home / "results"
    travel = bench.scanner.rig.travel.model_copy(update={"length_mm": FOOT_MM})
    bench.scanner.rig = bench.scanner.rig.model_copy(update={"travel": travel})
    bench.scanner.loops = Compiling()
    files: list[set[str]] = []
    missing: list[Waiting] = []

    def plan(job: Job, *, reasons: bool) -> PlannedJob:
        planned = plan_job(job, reasons=reasons)
        missing.extend(planned.waiting)
        return planned

    monkeypatch.setattr(measuring, "plan_job", plan)
    result = bench.scanner.scan(
        bench.order(calibration=calibration, results=results),
        lambda filmed: files.append({file.name for file in (results / "P7" / filmed.place.name).iterdir()}),
    )
    assert bench.scanner.state.name == "done"
    assert len(files) == 1
    assert files[0] >= set(SHOWN)
    assert "report.html" not in files[0]
    assert {step.kind for step in missing} >= {"quality.json", "report"}
    assert not {step.kind for step in missing} & {"extract", "map"}, "done while the heads returned"
    begun = [name for name, before in zip(bench.states, ["", *bench.states], strict=False) if name != before]
    assert begun == [
        "disconnected", "idle", "filming", "homing", "preparing", "filming", "storing", "reconstructing", "done"
    ]  # fmt: skip
    assert bench.board.laser_at(time.monotonic()) == 0.0
    scan = read_scan(result.stored.place)
    assert (scan.name, scan.document.scanner, scan.document.day) == ("P7/2026-11-20-R", "bench", DAY)
    assert scan.document.posture == "sitting"
    recording = read_json(scan.folder / "recording.json", Recording)
    assert recording.board.lost_steps_mm == pytest.approx((0.0, 0.0, 0.0), abs=0.06)
    for camera, told in zip(scan.document.cameras, recording.cameras, strict=True):
        x = read_positions(scan.folder / str(camera.positions))
        assert np.all(np.diff(x) > 0)
        assert x[0] < 4 * 3.0
        assert x[-1] > FOOT_MM - 4 * 3.0
        assert open_film(scan.film(camera)).count == len(x) == told.stored + len(told.lost)
        background = scan.background(camera)
        assert background is not None
        assert open_film(background).count == 1
    assert result.measured is not None
    assert result.measured.kind in {None, "finding"}
    assert result.measured.folder == results / "P7/2026-11-20-R"
    assert next_scan_name(bench.home / "archive", "P7", "right", DAY) == "2026-11-20-R-2"


def test_a_stop_ends_the_wait_for_loops(bench: Bench, pristine: Path) -> None:
    bench.scanner.loops = Compiling(bench.scanner.stop)
    with pytest.raises(Fault, match="stopped; nothing of this scan is kept"):
        bench.scanner.scan(bench.order(calibration=pristine / "calibration.json", results=bench.home / "results"))
    bench.assert_dark_and_empty()


@pytest.mark.usefixtures("lenient")
def test_two_cameras_on_two_heads_leave_the_third_axis_where_it_is(pristine: Path, tmp_path: Path) -> None:
    with open_bench(pristine, tmp_path, (RigHead(), RigHead()), {1: 1, 2: 2}) as bench:
        bench.scanner.home()
        before = bench.board.position_at(time.monotonic())[2]
        result = bench.scanner.scan(bench.order())
        assert bench.board.position_at(time.monotonic())[2] == before
        recording = read_json(result.stored.place / "recording.json", Recording)
        assert recording.board.lost_steps_mm == pytest.approx((0.0, 0.0), abs=0.06)
        assert [(camera.id, camera.head) for camera in recording.cameras] == [(1, 1), (2, 2)]
        assert bench.scanner.jog(3.0, 50.0, 2)[1] == pytest.approx(bench.scanner.heads.position_mm()[0] + 3.0, abs=0.1)
        with pytest.raises(RefusedInput, match="head: expected 1 to 2, found 3"):
            bench.scanner.jog(3.0, 50.0, 3)


@pytest.mark.usefixtures("lenient")
def test_cameras_that_film_in_a_second_pass_say_so(
    pristine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    passes = [Pass((2,), "the bus carries one"), Pass((1,), "the other one")]
    with open_bench(pristine, tmp_path, (RigHead(), RigHead()), {1: 1, 2: 2}) as bench:
        monkeypatch.setattr(scanner, "passes_of", lambda *_: passes)
        place = bench.scanner.scan(bench.order()).stored.place
    assert read_scan(place).document.later_passes == {1: 2}
    assert [one.cameras for one in read_json(place / "recording.json", Recording).passes] == [[2], [1]]


@pytest.mark.usefixtures("lenient")
def test_twelve_cameras_on_four_heads_of_which_two_share_an_axis(pristine: Path, tmp_path: Path) -> None:
    heads = (*THREE_HEADS, RigHead(axis=3, offset_mm=-38.0))  # 18 mm behind head 3
    on_head = {camera: 1 + camera % 4 for camera in range(1, 13)}
    with open_bench(pristine, tmp_path, heads, on_head) as bench:
        result = bench.scanner.scan(bench.order())
        assert result.stored.left_out == {}
        recording = read_json(result.stored.place / "recording.json", Recording)
        assert {camera.id: camera.head for camera in recording.cameras} == on_head
        assert recording.passes[0].cameras == list(on_head)
        assert recording.board.lost_steps_mm == pytest.approx((0.0,) * 4, abs=0.06)
        for camera in read_scan(result.stored.place).document.cameras:
            x = read_positions(result.stored.place / str(camera.positions))
            aside = -18.0 if on_head[camera.id] == 4 else 0.0
            assert aside <= x[0] < aside + 4 * 3.0
            assert aside + LENGTH_MM - 4 * 3.0 < x[-1] <= aside + LENGTH_MM
        places = bench.scanner.jog(4.0, 50.0, 4)
        assert places[3] == pytest.approx(places[2] - 18.0, abs=0.01)  # the carriage moves both
        assert places[2] == pytest.approx(places[0] + 4.0, abs=0.1)


def test_a_scan_carries_the_check_that_was_in_force_when_it_began(bench: Bench, pristine: Path) -> None:
    calibration = Path(shutil.copy(pristine / "calibration.json", bench.home))
    assert bench.scanner.scan(bench.order(calibration=calibration)).stored.place.name == "2026-11-20-R"
    assert read_scan(bench.home / "archive/P7/2026-11-20-R").calibration_check is None
    check = made_check(calibration, "2026-11-20T08:00:00+01:00", {1: 0.03, 5: 0.41, 7: None})
    store_check(calibration, check)
    scan = read_scan(bench.scanner.scan(bench.order(calibration=calibration)).stored.place)
    store_check(calibration, made_check(calibration, "2026-11-20T19:00:00+01:00", {1: 0.03, 5: 0.02}))
    assert scan.calibration_check is not None
    assert read_json(scan.calibration_check, CalibrationCheck) == check
    beside = checks_of(calibration, check.calibration_sha256)
    known = check_of_scan(scan, check.calibration_sha256, beside)
    assert known is not None
    assert (known.drifted, known.unseen, known.age_days) == ([5], [], 0)


def test_a_damaged_check_is_refused_before_anything_moves(bench: Bench, pristine: Path) -> None:
    calibration = Path(shutil.copy(pristine / "calibration.json", bench.home))
    calibration.with_name("calibration.check.json").write_text("{}")
    with pytest.raises(RefusedInput, match=r"calibration\.check\.json: checked: is missing"):
        bench.scanner.scan(bench.order(calibration=calibration))
    bench.assert_dark_and_empty()
    assert "homing" not in bench.states


def test_a_head_that_was_held_costs_the_scan(bench: Bench) -> None:
    def hold_for_a_while() -> None:
        bench.board.stick(2)
        threading.Timer(0.3, lambda: bench.board.stick(2, False)).start()

    bench.scanner.home()
    when_filming(bench, hold_for_a_while)
    with pytest.raises(Fault, match=r"heads are not where their steps say: head 2|switch"):
        bench.scanner.scan(bench.order())
    assert bench.scanner.state.name in ("failed", "alarm")
    bench.assert_dark_and_empty()
    assert bench.scanner.scan(bench.order()).stored.left_out == {}


def test_a_camera_that_fails_costs_the_scan_unless_it_is_to_be_kept(bench: Bench) -> None:
    bench.scanner.home()
    cut = bench.streams._cameras[5]
    when_filming(bench, lambda: cut._cut(True))
    with pytest.raises(Finding, match="the scan is incomplete: camera 5"):
        bench.scanner.scan(bench.order())
    assert bench.scanner.state.name == "failed"
    bench.assert_dark_and_empty()
    cut._cut(False)
    when_filming(bench, lambda: cut._cut(True))
    result = bench.scanner.scan(bench.order(keep_partial=True))
    assert set(result.stored.films) == {1}
    assert set(result.stored.left_out) == {5}
    assert [camera.id for camera in read_scan(result.stored.place).document.cameras] == [1]
    recording = read_json(result.stored.place / "recording.json", Recording)
    assert any("camera 5 is left out" in warning for warning in recording.warnings)
    cut._cut(False)
    assert len(bench.scanner.scan(bench.order()).stored.films) == 2


def test_stopping_leaves_nothing_and_the_next_scan_works(bench: Bench) -> None:
    bench.scanner.home()
    when_filming(bench, bench.scanner.stop)
    with pytest.raises(Fault, match="stopped; nothing of this scan is kept"):
        bench.scanner.scan(bench.order())
    bench.assert_dark_and_empty()
    assert bench.scanner.scan(bench.order()).stored.left_out == {}


@pytest.mark.parametrize(
    "doing", ["homing", pytest.param("filming: looking at the light", marks=pytest.mark.slow), "filming 0 %"]
)
def test_a_stop_ends_a_scan_while_nothing_is_filmed_yet(bench: Bench, doing: str) -> None:
    if doing != "homing":
        bench.scanner.home()
    pressed: list[float] = []

    def press(state: ScannerState) -> None:
        if str(state) == doing and not pressed:
            pressed.append(time.monotonic() + 0.2)
            threading.Timer(0.2, bench.scanner.stop).start()

    bench.scanner.listen(press)
    with pytest.raises(Fault, match="stopped; nothing of this scan is kept"):
        bench.scanner.scan(bench.order(light=None) if "light" in doing else bench.order())
    assert time.monotonic() < pressed[0] + 2.0
    assert bench.states[-1] == "failed"
    bench.assert_dark_and_empty()
    time.sleep(0.5)
    seconds = np.arange(pressed[0] + 0.3, time.monotonic(), 0.001)
    assert max(bench.board.laser_at(one) for one in seconds) == 0.0
    assert bench.scanner.scan(bench.order()).stored.left_out == {}


def test_a_scan_that_is_refused_leaves_a_stop_as_it_is(bench: Bench) -> None:
    def stop_and_scan() -> None:
        bench.scanner.stop()
        with pytest.raises(RefusedInput):
            bench.scanner.scan(bench.order())

    bench.scanner.home()
    bench.scanner.listen(lambda state: stop_and_scan() if str(state) == "filming 0 %" else None)
    with pytest.raises(Fault, match="stopped"):
        bench.scanner.scan(bench.order())


def test_one_thing_at_a_time(bench: Bench) -> None:
    refused: list[str] = []

    def home_too() -> None:
        with pytest.raises(RefusedInput) as error:
            bench.scanner.home()
        refused.append(str(error.value))

    bench.scanner.home()
    when_filming(bench, home_too)
    bench.scanner.scan(bench.order())
    assert refused == ["scanner: is filming, expected it to be idle"]


def test_an_open_lid_is_told_and_the_scan_goes_on_when_it_is_closed(bench: Bench) -> None:
    seen: list[str] = []

    def open_and_close() -> None:
        bench.board.open_door()
        wait_until(lambda: bench.scanner.state.name == "door open" and bench.board.laser_at(time.monotonic()) == 0)
        seen.append(bench.scanner.state.name)
        bench.board.close_door()
        wait_until(lambda: "closed again" in bench.scanner.state.words)
        bench.scanner.heads.resume()

    bench.scanner.home()
    when_filming(bench, open_and_close)
    result = bench.scanner.scan(bench.order())
    assert seen == ["door open"]
    assert result.stored.left_out == {}


def test_a_disk_that_fills_up_ends_the_travel(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    from footscan.frames.ingest import FrameWriter

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    bench.scanner.home()
    when_filming(bench, lambda: monkeypatch.setattr(FrameWriter, "add", full))
    with pytest.raises(Fault, match="cannot be written"):
        bench.scanner.scan(bench.order())
    bench.assert_dark_and_empty()


def test_a_camera_without_a_latency_is_refused_before_anything_moves(bench: Bench) -> None:
    cameras = [camera.model_copy(update={"latency": None}) for camera in bench.scanner.rig.cameras]
    bench.scanner.rig = bench.scanner.rig.model_copy(update={"cameras": cameras})
    with pytest.raises(RefusedInput, match="camera 1: latency: is missing in the rig"):
        bench.scanner.scan(bench.order())
    bench.assert_dark_and_empty()


@pytest.mark.slow
def test_the_light_is_chosen_where_none_is_given(bench: Bench) -> None:
    result = bench.scanner.scan(bench.order(light=None))
    recording = read_json(result.stored.place / "recording.json", Recording)
    assert recording.light.is_measured
    assert recording.light.power == 1.0
    assert recording.light.looks >= 2
    assert all(camera.light_reason for camera in recording.cameras)
    assert all("cannot be set from here" in camera.not_fixed[0] for camera in recording.cameras)


def test_standing_heads_are_filmed_in_the_middle_of_the_travel(bench: Bench) -> None:
    stills = live_stills(bench.scanner, light_by_hand(bench.scanner.rig, 1.0, 10.0))
    assert stills.problems == {}
    for camera, (earlier, later) in stills.frames.items():
        assert simplejpeg.decode_jpeg(earlier).max() > 100, f"camera {camera} in the dark"
        assert simplejpeg.decode_jpeg(later).max() > 100
    assert bench.scanner.heads.position_mm() == pytest.approx((LENGTH_MM / 2,) * 3, abs=0.1)
    assert bench.scanner.state.name == "idle"
    assert bench.board.laser_at(time.monotonic()) == 0.0


def test_a_stop_ends_the_film_of_a_placement(bench: Bench) -> None:
    bench.scanner.home()
    threading.Thread(
        target=lambda: (wait_until(lambda: bench.board.laser_at(time.monotonic()) > 0), bench.scanner.stop()),
        daemon=True,
    ).start()
    with pytest.raises(Fault, match="stopped; what was filmed before is kept"):
        LiveStanding(bench.scanner).stills(light_by_hand(bench.scanner.rig, 1.0, 10.0))
    assert bench.board.laser_at(time.monotonic()) == 0.0
    assert LiveStanding(bench.scanner).stills(light_by_hand(bench.scanner.rig, 1.0, 10.0)).problems == {}


def test_heads_travel_over_a_body_one_after_the_other(bench: Bench) -> None:
    began = time.monotonic()
    place = bench.home / "captures" / "S1" / "body"
    film_body(bench.scanner, place, standard_body(), light_by_hand(bench.scanner.rig, 1.0, 10.0))
    assert bench.scanner.deck.open_cameras == (1, 5)  # not only those of the last pass
    scan = read_scan(place)
    assert (scan.document.side, [camera.id for camera in scan.document.cameras]) == ("unknown", [1, 5])
    for camera in scan.document.cameras:
        x = read_positions(place / str(camera.positions))
        assert x[0] < 12.0
        assert x[-1] > LENGTH_MM - 12.0
    seconds = np.arange(began, time.monotonic(), 0.02)
    lit = np.array([bench.board.position_at(one) for one in seconds if bench.board.laser_at(one) > 0])
    assert len(lit) > 100
    assert np.all((lit > 0.0).sum(axis=1) <= 1)  # the others wait before the travel


def when_filming(bench: Bench, happens: object) -> None:
    """Cause an event in the middle of the next travel with light."""
    assert callable(happens)

    def watch() -> None:
        wait_until(
            lambda: bench.board.laser_at(time.monotonic()) > 0 and bench.board.position_at(time.monotonic())[0] > 60
        )
        happens()

    threading.Thread(target=watch, daemon=True).start()


def test_frames_of_a_camera_whose_latency_is_accepted_are_not_refused_for_it() -> None:
    assert latency.LARGEST_FRAME_SD_S * RigTravel().mm_per_s < storing.LARGEST_SD_MM

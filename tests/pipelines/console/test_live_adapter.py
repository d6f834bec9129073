"""The live scanner in words: missing devices are named with a remedy."""

import datetime
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest
from checked import made_check

from footscan.ahead_of_time import Compilation
from footscan.capture.board.state import state_from
from footscan.capture.cameras.usb_bus import Pass
from footscan.capture.grbl.report import Report
from footscan.virtual.foot.foot import make_foot
from pipelines.calibration_check import store_check
from pipelines.console import live_adapter
from pipelines.console.guidance import guidance
from pipelines.console.live_adapter import KNOWN_FILE, LiveAdapter
from pipelines.console.scanner import Device
from pipelines.live.scanner import STOPPED, LiveScanner
from pipelines.live.state import ScannerState
from pipelines.live.virtual.world import VirtualWorld, obey
from schemas.base.errors import FootscanError, RefusedInput
from schemas.base.json_files import read_json
from schemas.calibration import Calibration
from schemas.known_measures import KnownMeasures
from schemas.rig import Rig

RIG = {
    "format": "footscan.rig/1",
    "scanner": "S1",
    "port": "no-board",
    "cameras": [{"id": 1, "device": "http://127.0.0.1:9/1"}],
}


@pytest.fixture
def over_nothing(tmp_path: Path) -> LiveAdapter:
    """An adapter over a rig without any connected device."""
    rig = Rig.model_validate(
        {
            "format": "footscan.rig/1",
            "scanner": "S1",
            "port": str(tmp_path / "no-board"),
            "cameras": [{"id": camera, "device": f"http://127.0.0.1:9/{camera}"} for camera in (1, 5)],
        }
    )
    rig = rig.model_copy(update={"calibration": str(tmp_path / "calibration.json")})
    return LiveAdapter(LiveScanner(rig), tmp_path / "archive", tmp_path / "results")


def test_what_is_not_connected_is_told(over_nothing: LiveAdapter) -> None:
    health = over_nothing.health()
    told = {device.name: (device.level, device.words) for device in health.devices}
    assert told["Controller"] == ("bad", "not connected")
    assert told["Head 2"] == ("unknown", "position unknown")
    assert told["Camera 5"] == ("unknown", "not open")
    assert told["Passes"] == ("ok", "All 2 cameras in one pass: cameras 1, 5 on no USB bus of this computer.")
    assert told["Calibration"] == ("unknown", "calibration; not checked")
    assert told["Disk"][1].endswith("GB are free for scans")
    assert health.cameras == (1, 5)
    assert not health.resumable
    assert over_nothing.state.name == "disconnected"
    assert over_nothing.picture(1) is None


def test_heads_that_are_not_homed_are_a_warning(over_nothing: LiveAdapter, monkeypatch: pytest.MonkeyPatch) -> None:
    report = Report("Idle", None, None)
    for homed, level, words in (
        (False, "warning", "where the heads stand is not known"),
        (True, "ok", "the heads stand"),
    ):
        board = SimpleNamespace(watches_door=True, homed=homed)
        log = SimpleNamespace(between=lambda *_: [])
        state = state_from(report, homed=homed, alarm=None)
        heads = SimpleNamespace(board=board, log=log, state=state, close=lambda: None)
        monkeypatch.setattr(over_nothing._scanner, "_heads", heads)
        controller, head, *_ = over_nothing.health().devices
        assert (controller.name, controller.level, controller.words) == ("Controller", level, words)
        assert controller.remedy == head.remedy == ("" if homed else "home the heads")


def calibration_of(over: LiveAdapter) -> Device:
    return next(device for device in over.health().devices if device.name == "Calibration")


def test_the_last_check_of_the_calibration_is_told_before_a_scan(over_nothing: LiveAdapter, tmp_path: Path) -> None:
    calibration = tmp_path / "calibration.json"
    calibration.write_text("{}")
    store_check(calibration, made_check(calibration, "2026-11-20T08:00:00+01:00", {1: 0.03, 5: 0.41, 7: None}))
    device = calibration_of(over_nothing)
    sentence = "camera 5 had moved by 0.41 mm when the calibration was checked on 2026-11-20: calibrate anew"
    assert (device.level, device.remedy) == ("bad", sentence)
    assert f"Calibration: {sentence}." in guidance(ScannerState("idle"), over_nothing.health(), None)
    yesterday = datetime.datetime.now().astimezone() - datetime.timedelta(days=1)
    store_check(calibration, made_check(calibration, yesterday.isoformat(), {1: 0.03, 5: 0.02}))
    device = calibration_of(over_nothing)
    assert (device.level, device.remedy) == ("ok", "")
    assert device.words == f"calibration; checked on {yesterday.date()}, 1 day ago: every camera was within 0.03 mm"
    (tmp_path / "calibration.check.json").write_text("{}")
    device = calibration_of(over_nothing)
    assert (device.level, device.words.partition(": ")[0]) == ("bad", str(tmp_path / "calibration.check.json"))
    calibration.write_text("made anew")
    (tmp_path / "calibration.check.json").unlink()
    assert calibration_of(over_nothing).words == "calibration; not checked"


def test_the_calibration_in_use_and_its_day_are_told(
    over_nothing: LiveAdapter, tmp_path: Path, calibration: Callable[..., Calibration]
) -> None:
    now = datetime.datetime.now().astimezone()
    for days, level, words in (
        (0, "ok", "made today"),
        (1, "unknown", f"made on {now.date() - datetime.timedelta(1)}"),
    ):
        made = calibration().model_copy(update={"created": now - datetime.timedelta(days)})
        (tmp_path / "calibration.json").write_text(made.model_dump_json())
        device = calibration_of(over_nothing)
        age = ", 1 day ago" if days else ""
        assert (device.level, device.words) == (level, f"calibration, {words}{age}; not checked since")


def test_orders_to_nothing_are_faults_and_a_stop_is_none(over_nothing: LiveAdapter, tmp_path: Path) -> None:
    over_nothing.stop()
    for order in (over_nothing.connect, over_nothing.home, over_nothing.resume, over_nothing.shine):
        with pytest.raises(FootscanError):
            order()
    with pytest.raises(FootscanError, match=r"^camera 1: latency: is missing"):
        over_nothing.film("P1", "right", keep_partial=False)
    assert not (tmp_path / "archive").exists()
    over_nothing.close()
    over_nothing.close()


def test_live_pictures_show_the_stripe_once_the_search_for_it_is_compiled(
    over_nothing: LiveAdapter, tmp_path: Path
) -> None:
    assert over_nothing.finds_stripes
    loops = Compilation()
    over = LiveAdapter(LiveScanner(Rig.model_validate(RIG), loops), tmp_path / "archive", tmp_path / "results")
    assert over.finds_stripes
    with patch.object(Compilation, "is_done", False):
        assert not over.finds_stripes


def test_a_foot_that_is_put_onto_the_glass_is_told_and_can_be_stopped(tmp_path: Path) -> None:
    scanner = LiveScanner(Rig.model_validate(RIG))
    told: list[str] = []
    scanner.listen(lambda state: told.append(str(state)))

    class OfTest:
        subject = "right"

        def put(self, subject: str) -> None:
            over.stop()
            assert subject == "left"

        def write_known(self, file: Path) -> None:
            raise AssertionError(f"{file}: nothing was filmed")

    over = LiveAdapter(scanner, tmp_path / "archive", tmp_path / "results", glass=OfTest())
    with pytest.raises(FootscanError, match="stopped"):
        over.film("P1", "left", keep_partial=False)
    words = "putting the virtual left foot onto the glass"
    assert told == [f"preparing: {words}", f"failed: {STOPPED}"]
    assert guidance(ScannerState("preparing", words), over.health(), "scan") == "The scan is being prepared."
    assert guidance(ScannerState("preparing", words), over.health(), "calibrate") == ""


def test_known_measures_are_written_when_all_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, scanner = tmp_path / "archive" / "P1" / "S1", LiveScanner(Rig.model_validate(RIG))
    foot = make_foot(side="left", resolution_mm=4.0)
    world = VirtualWorld.__new__(VirtualWorld)  # without its board and pictures
    world._foot = foot

    class OfTest:
        subject = "left"

        def put(self, subject: str) -> None:
            raise AssertionError(f"{subject} stands there")

        def write_known(self, file: Path) -> None:
            obey(world, {"known": str(file)})

    shown: list[bool] = []

    def scan(_: object, on_shown: Callable[[object], None]) -> SimpleNamespace:
        place.mkdir(parents=True)
        assert not (place / KNOWN_FILE).exists()
        stored = SimpleNamespace(place=place, left_out={})
        on_shown(stored)
        return SimpleNamespace(stored=stored, measured=None)

    monkeypatch.setattr(scanner, "scan", scan)
    LiveAdapter(scanner, tmp_path / "archive", tmp_path / "results", glass=OfTest()).film(
        "P1", "left", keep_partial=False, on_shown=lambda _: shown.append((place / KNOWN_FILE).exists())
    )
    assert shown == [True]
    known = read_json(place / KNOWN_FILE, KnownMeasures)
    assert (known.side, known.measures) == ("left", foot.measures)
    world._foot = None
    with pytest.raises(RefusedInput, match="no foot"):
        world.write_known(place / "other.json")


def test_cameras_of_later_passes_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig.model_validate(RIG | {"cameras": [{"id": n, "device": f"http://127.0.0.1:9/{n}"} for n in (1, 5)]})
    passes = [Pass((1,), "the bus is narrow"), Pass((5,), "the bus is narrow")]
    monkeypatch.setattr(live_adapter, "passes_of", lambda *_: passes)
    over = LiveAdapter(LiveScanner(rig), tmp_path / "archive", tmp_path / "results")
    words = {device.name: device.words for device in over.health().devices}
    assert (words["Camera 1"], words["Camera 5"]) == ("not open", "opened for pass 2")


def test_a_scanner_that_was_not_connected_is_not_ready_after_a_preparation() -> None:
    scanner = LiveScanner(Rig.model_validate(RIG))
    with scanner.waiting_for("judging the placement"):
        assert str(scanner.state) == "preparing: judging the placement"
    assert scanner.state.name == "disconnected"

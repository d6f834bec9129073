"""Sessions on a stand-in that shows the frames of a recorded capture of three placements by three cameras."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from standing_scanner import StandingStandIn

from pipelines.capture_job import check_calibration
from pipelines.live.calibrating.guide import Guide
from pipelines.live.calibrating.outcomes import StoredCalibration
from pipelines.live.calibrating.settings import GuideSettings
from pipelines.live.calibrating.view import View
from pipelines.live.rig_file import read_rig, write_rig
from pipelines.recordings.captures import read_capture
from schemas.base.errors import Fault, RefusedInput
from schemas.base.json_files import read_json
from schemas.calibration import LaserPlane, read_calibration
from schemas.calibration_check import CalibrationCheck
from schemas.parameters.calibration import CaptureCalibrationParameters


@pytest.fixture
def scanner(filmed_capture: Path) -> StandingStandIn:
    return StandingStandIn(filmed_capture)


def guide_of(scanner: StandingStandIn, home: Path, seen: list[View] | None = None) -> Guide:
    write_rig(home / "rig.yaml", scanner.rig)
    settings = GuideSettings(home / "captures", home / "rig.yaml", scanner.capture.reference)
    guide = Guide(scanner, settings, scanner.put)
    guide.listen((seen if seen is not None else []).append)
    return guide


def film_all(guide: Guide) -> None:
    while guide.view.number is not None:
        guide.put()
        guide.take()
        assert guide.view.complaints == ()
        guide.next()


def test_a_scanner_is_calibrated_checked_and_named(scanner: StandingStandIn, tmp_path: Path) -> None:
    views: list[View] = []
    guide = guide_of(scanner, tmp_path, views)
    assert guide.view.actions == ("calibrate",)
    guide.begin("calibration")
    assert "Y = 0 mm, on the glass" in guide.view.words
    film_all(guide)
    assert guide.view.step == "filmed"
    assert all(0.05 < share < 0.9 for share in guide.view.coverage.values())
    assert guide.picture().count("<g ") == 3
    guide.finish()
    assert guide.view.step == "calibrated"
    assert guide.placement_picture() is None
    guide.body()
    assert "150 x 64 x 84 mm, its middle at X = 200 mm" in str(guide.placement_picture())
    made = read_calibration(Path(str(guide.view.outcome and guide.view.outcome.file)))
    assert (made.scanner, [camera.camera for camera in made.cameras]) == ("S1", [1, 2, 5])
    assert max(camera.held_out_rms_mm or 9.0 for camera in made.cameras) < 0.2
    # What was stored is an ordinary capture, and calibrates as one.
    drifts = check_calibration(made, read_capture(Path(guide.view.folder)), CaptureCalibrationParameters(), 0.2, 1)
    assert [drift.verdict for drift in drifts] == ["steady"] * 3
    assert read_rig(tmp_path / "rig.yaml").calibration is None
    guide.use()
    named = read_rig(tmp_path / "rig.yaml").calibration
    assert named == scanner.rig.calibration == str(tmp_path / Path(named or "").name)
    guide.end()
    assert scanner.busy == [*["putting the virtual object onto the glass", "judging the placement"] * 3,
                            "calculating the calibration"]  # fmt: skip
    assert [view.step for view in views[:3]] == ["place", "place", "look"]

    assert guide.view.actions == ("check", "calibrate")
    guide.begin("check")
    guide.put()
    guide.take()
    guide.finish()
    assert guide.view.step == "checked"
    assert guide.view.is_well
    assert guide.view.words.startswith("The calibration holds: every camera is within 0.")
    check = read_json(Path(named or "").with_suffix(".check.json"), CalibrationCheck)
    assert (check.verdict, check.scanner, len(check.cameras)) == ("steady", "S1", 3)


def test_the_laser_planes_of_the_bodys_film_are_told(
    scanner: StandingStandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plane = LaserPlane(head=2, offset_mm=-0.4, yaw=0.01, sd=[0.05, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0])

    def planes(stored: StoredCalibration, *_: object) -> StoredCalibration:
        cameras = [camera.model_copy(update={"plane": plane}) for camera in stored.calibration.cameras]
        return StoredCalibration(stored.file, stored.calibration.model_copy(update={"cameras": cameras}))

    monkeypatch.setattr(scanner, "film_body", lambda *_: None)
    monkeypatch.setattr("pipelines.live.calibrating.guide.add_planes", planes)
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    film_all(guide)
    guide.finish()
    assert guide.view.outcome is not None
    assert guide.view.outcome.planes == []
    guide.body()
    guide.film_body()
    outcome = guide.view.as_json()["outcome"]
    assert outcome["plane_columns"] == ("", "X, mm", "yaw, °", "pitch, °", "bend, mm", "travel, %")
    unsupported = ["not supported by the films"] * 3
    assert outcome["planes"] == [["head 2", "-0.400 ± 0.050", "+0.573 ± 0.057", *unsupported]]


def test_a_camera_that_moved_is_told(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    film_all(guide)
    guide.finish()
    guide.use()
    file = Path(str(scanner.rig.calibration))
    known = read_calibration(file)
    moved = known.cameras[1].map.model_copy(
        update={"centre_px": (known.cameras[1].map.centre_px[0] + 2.0, known.cameras[1].map.centre_px[1])}
    )
    cameras = [known.cameras[0], known.cameras[1].model_copy(update={"map": moved}), known.cameras[2]]
    file.write_text(known.model_copy(update={"cameras": cameras}).model_dump_json())
    guide.end()
    guide.begin("check")
    guide.put()
    guide.take()
    guide.finish()
    assert not guide.view.is_well
    assert guide.view.words.startswith("Camera 2 has moved by 0.")
    assert guide.view.words.endswith(" mm: calibrate anew.")


def test_what_is_wrong_is_told_while_the_object_stands_there(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.take()
    [complaint] = guide.view.complaints
    assert (complaint.kind, complaint.cameras) == ("no stripe", (1, 2, 5))
    guide.put()
    assert guide.view.complaints == ()
    assert guide.view.words == "Placement 1 of 3: a virtual object stands there now. Film it."
    scanner.covered = {5}
    guide.take()
    assert [one.words.split(":")[0] for one in guide.view.complaints] == ["no stripe in camera 5"]
    scanner.covered = set()
    scanner.later = 1
    guide.take()
    assert [one.kind for one in guide.view.complaints] == ["moved"]
    scanner.later = None
    guide.take()
    assert guide.view.complaints == ()
    assert guide.view.actions[0] == "next"
    guide.next()
    guide.take()  # the object was not moved to its second placement
    dy, dz = (b - a for a, b in zip(*guide.view.placements[:2], strict=True))
    [complaint] = guide.view.complaints
    assert complaint.kind == "elsewhere"
    assert f"{abs(dy):.1f} mm too far towards {'-Y' if dy > 0 else '+Y'}" in complaint.words
    assert abs(dz) < 0.1 or f"{abs(dz):.1f} mm too {'low' if dz > 0 else 'high'}" in complaint.words
    assert guide.view.actions[:2] == ("put", "take")


def test_a_camera_without_a_frame_keeps_a_placement_from_being_kept(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.put()
    scanner.silent = {2}
    guide.take()
    assert guide.view.complaints[0].words == "camera 2: connection lost: check cables and hubs"
    assert guide.view.taken == ()
    assert "next" not in guide.view.actions


def test_an_interrupted_session_is_gone_on_with_or_discarded(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.put()
    guide.take()
    guide.next()
    scanner.fault = "stopped; what was filmed before is kept"
    with pytest.raises(Fault):
        guide.take()
    assert (guide.view.step, guide.view.number) == ("place", 1)
    covered = guide.view.coverage

    again = guide_of(scanner, tmp_path)
    again.begin("calibration")
    assert again.view.words.startswith("An interrupted session of ")
    assert (again.view.number, again.view.taken) == (1, (0,))
    assert again.view.coverage == pytest.approx(covered, rel=0.05)
    folder = Path(again.view.folder)
    (folder / "cam2" / "000.jpg").write_bytes(b"damaged")
    third = guide_of(scanner, tmp_path)
    third.begin("calibration")
    assert (third.view.number, third.view.taken) == (0, ())
    again.discard()
    assert not folder.exists()
    again.begin("calibration")
    assert again.view.taken == ()
    assert "interrupted" not in again.view.words


def test_a_placement_whose_judging_was_stopped_is_not_kept(
    scanner: StandingStandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.put()

    @contextmanager
    def stopped(_words: str) -> Iterator[None]:
        yield
        raise Fault("stopped; what was filmed before is kept")

    with monkeypatch.context() as patched:
        patched.setattr(scanner, "waiting_for", stopped)
        with pytest.raises(Fault):
            guide.take()
    assert (guide.view.step, guide.view.taken) == ("place", ())
    guide.go(1)
    assert guide.view.taken == ()


def test_a_refused_capture_leads_back_to_its_placement(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    for standing in (0, 1, 0):
        scanner.standing = standing
        guide.take()
        guide.next()
    assert guide.view.step == "filmed"
    guide.finish()
    assert guide.view.step == "place"
    assert guide.view.complaints[0].words.startswith("the object stood at ")
    assert guide.view.taken == (0, 1, 2)
    guide.go(2)
    guide.put()
    guide.take()
    guide.next()
    guide.finish()
    assert guide.view.step == "calibrated"


def test_a_placement_can_be_left_out(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.go(2)
    guide.put()
    guide.take()
    assert guide.view.taken == (2,)
    assert "finish" not in guide.view.actions
    guide.next()
    assert guide.view.number == 0


def test_what_cannot_be_done_now_is_refused(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    with pytest.raises(RefusedInput, match="cannot take now, expected one of calibrate"):
        guide.take()
    with pytest.raises(RefusedInput, match=r"rig.yaml: calibration: names none that could be checked"):
        guide.begin("check")
    guide.begin("calibration")
    with pytest.raises(RefusedInput, match="expected 1 to 3, found 9"):
        guide.go(8)


def test_light_that_was_wrong_is_chosen_anew(scanner: StandingStandIn, tmp_path: Path) -> None:
    guide = guide_of(scanner, tmp_path)
    guide.begin("calibration")
    guide.put()
    guide.take()
    guide.take()
    assert [light is None for light in scanner.lights] == [True, False]


def test_a_calibration_from_few_placements_has_a_price() -> None:
    view = View("look", "", ("next", "finish"), "calibration", placements=((0, 0),) * 10, taken=range(5))
    assert view.price.startswith("5 of 10 placements: the calibration holds only in the regions")
    assert view.as_json()["price"] == view.price
    for free in ({"taken": range(10)}, {"actions": ("next",)}, {"purpose": "check"}):
        assert replace(view, **free).price == ""

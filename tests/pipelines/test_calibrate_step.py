"""The steps of a calibration from a capture: cached for each camera, refused in one line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from footscan.calibration.capture.as_arrays import view_of
from footscan.calibration.capture.stripe_arrays import stripe_arrays
from pipelines.calibrate import calibration_steps, recorded_inputs
from pipelines.capture_job import calibrate_capture
from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.plan import make_plan
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.run import run_plan
from pipelines.engine.store.store import open_store
from pipelines.recordings.captures import read_capture
from pipelines.simulate import filmed_calibration_steps
from pipelines.steps import capture_stripe
from schemas.base.errors import DamagedError, RefusedInput
from schemas.calibration import Calibration
from schemas.mounting import Mounting
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.simulation import SimulationSettings

Calibrated = tuple[dict[str, Outcome], list[str]]
PARAMETERS = CaptureCalibrationParameters(model="homography")
"""One model: the others are fitted and compared in the tests of the models."""
JOINT = ["all-recognise", "calibrate", "own-side", "place"]


def steps_of(capture: Path, cache: Path) -> list[Step]:
    inputs = recorded_inputs(read_capture(capture), FileDigests.load(cache / "files.json"))
    return calibration_steps("scanner", inputs, PARAMETERS)


def run(capture: Path, cache: Path) -> Calibrated:
    """The result of each step, and the names of the steps that ran."""
    store = open_store(cache)
    ends: list[StepEnd] = []
    plan = make_plan(steps_of(capture, cache), store)
    outcomes = run_plan(plan, store, pool=Threads(2), on_step_end=ends.append)
    return outcomes, sorted(end.step.name.removeprefix("scanner/") for end in ends if end.ran)


def test_only_what_rests_on_a_changed_film_runs_again(capture: Path, tmp_path: Path) -> None:
    outcomes, ran = run(capture, tmp_path / "cache")
    of_cameras = [f"{kind}-{camera}" for kind in ("fit", "recognise", "stripe") for camera in (1, 2, 5)]
    assert ran == sorted([*of_cameras, *JOINT])
    result = outcomes["scanner/calibrate"]
    assert not isinstance(result, Failure)
    calibration = Calibration.model_validate_json(open_store(tmp_path / "cache").get(result.digest) or b"")
    assert [camera.camera for camera in calibration.cameras] == [1, 2, 5]
    made = calibrate_capture(read_capture(capture), PARAMETERS, 2, tmp_path / "other")
    assert made.calibration == calibration
    assert run(capture, tmp_path / "cache")[1] == []

    film = capture / "cam2.avi"
    film.write_bytes(film.read_bytes() + b"JUNK\0\0\0\0")  # an empty chunk behind the film: other bytes, same frames
    assert run(capture, tmp_path / "cache")[1] == ["calibrate", "stripe-2"]  # its sources differ, no stripe does


def test_another_picture_in_a_film_runs_its_camera_and_what_all_share(capture: Path, tmp_path: Path) -> None:
    run(capture, tmp_path / "cache")
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"][2]["file"] = "cam7.avi"  # what another camera filmed
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    outcomes, ran = run(capture, tmp_path / "cache")
    assert {"stripe-5", "recognise-5", "place"} <= set(ran)
    assert not any(name.endswith(("stripe-1", "recognise-1", "stripe-2", "recognise-2")) for name in ran)
    failure = outcomes["scanner/calibrate"]
    assert isinstance(failure, Failure)
    assert failure.kind == "refused"
    with pytest.raises(RefusedInput) as refused:
        calibrate_capture(read_capture(capture), PARAMETERS, 2)
    assert failure.problem == str(refused.value)
    assert failure.problem.startswith(f"{capture / 'capture.yaml'}: camera 5: sees the object from")


def test_a_camera_has_a_map_for_each_laser(capture: Path, tmp_path: Path) -> None:
    plain = calibrate_capture(read_capture(capture), PARAMETERS, 2, tmp_path / "cache").calibration
    file = capture / "capture.yaml"
    document = yaml.safe_load(file.read_text())
    of_two = next(camera for camera in document["cameras"] if camera["id"] == 2)
    # What camera 2 sees stands for what camera 1 sees with the second laser on.
    of_two |= {"id": 1, "laser": 2, "x_mm": document["x_mm"] + 12.0, "stands": ["behind", "left", "above"]}
    file.write_text(yaml.safe_dump(document))
    made = calibrate_capture(read_capture(capture), PARAMETERS, 2, tmp_path / "cache").calibration
    assert [camera.name for camera in made.cameras] == ["1", "5", "1 (laser 2)"]
    first, second = made.maps(1)
    assert (first.laser, first.ahead_mm, second.laser, second.ahead_mm) == (1, 0.0, 2, 12.0)
    assert first.map == plain.camera(1).map
    assert second.map == plain.camera(2).map
    assert Calibration.model_validate_json(made.model_dump_json()) == made


def test_one_film_for_two_cameras_is_refused(capture: Path, tmp_path: Path) -> None:
    shutil.copy(capture / "cam1.avi", capture / "cam2.avi")
    with pytest.raises(RefusedInput, match=r"capture\.yaml: camera 2: has the same film as camera 1"):
        steps_of(capture, tmp_path / "cache")


def test_a_view_is_the_same_behind_its_arrays() -> None:
    stripes = [np.array([[1.5, 2.0], [3.0, 4.25]]), np.empty((0, 2)), np.array([[5.0, 6.0]])]
    view = view_of(7, stripe_arrays(stripes, (640, 480), [1]), Mounting(1, 0, -1))
    assert (view.camera, view.image_px, view.mounting, view.lost) == (7, (640, 480), Mounting(1, 0, -1), (1,))
    assert [stripe.tolist() for stripe in view.stripes] == [stripe.tolist() for stripe in stripes]


@pytest.mark.parametrize("damage", ["changed", "missing"])
@pytest.mark.parametrize("name", ["cam1.avi", "capture.yaml"])
def test_a_capture_that_is_not_what_was_filmed_is_filmed_anew(tmp_path: Path, name: str, damage: str) -> None:
    files = {"cam1.avi": b"a film", "capture.yaml": b"format: footscan.capture/1\n"}
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    listing = json.dumps({file: sha256(content) for file, content in files.items()}).encode()
    if damage == "missing":
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_bytes(b"a fils")
    places = {"film": tmp_path / "cam1.avi", "capture": tmp_path / "capture.yaml"}
    with pytest.raises(DamagedError, match=rf"{name}: is not what was filmed; run again"):
        capture_stripe.run({"film": listing}, ExtractionParameters(), places)
    assert not (tmp_path / "capture.yaml").exists()


def test_each_camera_of_a_capture_that_is_to_be_filmed_has_its_own_stripe(tmp_path: Path) -> None:
    steps = filmed_calibration_steps("demo", tmp_path / "capture", SimulationSettings())
    keys = set()
    for step in steps:
        if step.kind == "stripe":  # all take the same listing of films
            digests = {
                name: "0" * 64 if isinstance(source, Output) else source.digest for name, source in step.inputs.items()
            }
            keys.add(key_of(image_text(step, digests)))
    assert len(keys) == 8

"""`footscan calibrate capture` on films of the virtual scanner, whose true maps are known."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import yaml
from PIL import Image
from shared_folders import MadeOnce

from footscan.calibration.chart.chart import read_chart
from footscan.calibration.models.maps import is_supported, to_world
from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.virtual.optics.scanner import standard_scanner
from schemas.calibration import read_calibration

Footscan = Callable[..., CompletedProcess[str]]
PLACEMENTS = 3
GRID = np.stack(np.meshgrid(np.linspace(-70, 70, 57), np.linspace(0, 114, 39)), -1).reshape(-1, 2)


@pytest.fixture(scope="module")
def filmed(command: Footscan, films: MadeOnce) -> Path:
    def film(folder: Path) -> None:
        done = command("simulate", "capture", "--out", folder, "--placements", PLACEMENTS, "--scanner-seed", 3)
        assert done.returncode == 0, done.stderr

    return films("capture", film)


@pytest.fixture
def capture(filmed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy to spoil, beside which pictures are drawn."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(filmed, tmp_path / "capture"))


@pytest.fixture(scope="module")
def calibrated(command: Footscan, filmed: Path, made_once: MadeOnce) -> Path:
    """The calibration from `filmed`, in a folder with the store of its results."""

    def calibrate(folder: Path) -> None:
        folder.mkdir()
        out = ("--out", folder / "calibration.json")
        done = command("calibrate", "capture", filmed, *out, "--cache", folder / "store")
        assert done.returncode == 0, done.stderr

    return made_once("calibrated-capture", calibrate) / "calibration.json"


@pytest.fixture(scope="module")
def store(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results that these tests share: a film that none of them changed is not extracted and recognised again."""
    return Path(shutil.copytree(calibrated.parent / "store", tmp_path_factory.mktemp("cache") / "store"))


@pytest.fixture
def footscan(footscan: Footscan, store: Path) -> Footscan:
    def run(*arguments: object) -> CompletedProcess[str]:
        is_check = arguments[:2] == ("calibrate", "check")
        uses_store = is_check or arguments[:2] == ("calibrate", "capture")
        shared = ("--no-record",) if is_check else ()  # the calibration lies in a folder that other tests read
        return footscan(*arguments, *shared, *(("--cache", store) if uses_store else ()))

    return run


def test_every_map_is_near_the_truth(footscan: Footscan, capture: Path, tmp_path: Path) -> None:
    done = footscan("calibrate", "capture", capture, "--out", tmp_path / "calibration.json", "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert [camera["camera"] for camera in report["cameras"]] == list(range(1, 9))
    assert all(pair["rms_mm"] < 0.05 for pair in report["pairs"])
    calibration = read_calibration(tmp_path / "calibration.json")
    assert calibration.created is not None
    assert {source.name for source in calibration.sources} >= {"capture.yaml", "reference.yaml", "cam1.avi"}
    scanner = standard_scanner(3)
    for camera in calibration.cameras:
        pixels = scanner.camera(camera.camera).project_plane(GRID[:, 0], GRID[:, 1])
        inside = is_supported(camera, pixels)
        errors = np.linalg.norm(to_world(camera, pixels[inside]) - GRID[inside], axis=1)
        assert inside.sum() > 100
        assert np.sqrt(np.mean(errors**2)) < (0.05 if camera.camera < 5 else 0.08), camera.camera
        assert errors.max() < (0.15 if camera.camera < 5 else 0.3), camera.camera


def test_the_table_names_the_chosen_model_and_the_pairs(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 2)
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 0
    assert "chosen" in done.stdout
    assert "1 and 2" in done.stdout
    assert "nothing was written" in done.stderr


def place(capture: Path, placements: list[list[float]]) -> None:
    file = capture / "reference.yaml"
    document = yaml.safe_load(file.read_text())
    document["placements_mm"] = placements
    file.write_text(yaml.safe_dump(document))


def placements_of(capture: Path) -> list[list[float]]:
    return list(yaml.safe_load((capture / "reference.yaml").read_text())["placements_mm"])


def test_an_object_that_stood_elsewhere_is_refused(footscan: Footscan, capture: Path, tmp_path: Path) -> None:
    said = placements_of(capture)
    place(capture, [said[0], [said[1][0] + 5.0, said[1][1]], said[2]])
    done = footscan("calibrate", "capture", capture, "--out", tmp_path / "calibration.json")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.strip().splitlines()) == 1
    assert "capture.yaml: frame 1: the object stood at" in done.stderr
    assert "as placements_mm says" in done.stderr
    assert not (tmp_path / "calibration.json").exists()
    with Image.open("capture-refused.png") as picture:
        assert picture.size[0] > 1000
    assert done.stderr.rstrip().endswith("as placements_mm says (see capture-refused.png)")


def test_a_dark_frame_of_all_cameras_is_refused(footscan: Footscan, capture: Path) -> None:
    for film in capture.glob("*.avi"):
        film.unlink()
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"] = [{"id": 1, "file": "cam1/"}]
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    (capture / "cam1").mkdir()
    for number in range(PLACEMENTS):
        Image.new("RGB", (640, 480)).save(capture / f"cam1/{number}.png")
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 2
    assert "frame 0: shows no stripe in any camera, expected the object" in done.stderr


def test_a_model_by_name(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 5)
    done = footscan("calibrate", "capture", capture, "--model", "homography-distortion", "--json")
    assert done.returncode == 0
    assert all(camera["map"]["distortion"] is not None for camera in json.loads(done.stdout)["cameras"])
    assert footscan("calibrate", "capture", capture, "--order", 3).returncode == 2


def test_show_draws_and_tells_what_it_was_made_from(footscan: Footscan, calibrated: Path, tmp_path: Path) -> None:
    done = footscan("calibrate", "show", calibrated, "--out", tmp_path / "c.png")
    assert done.returncode == 0
    assert "homography" in done.stdout
    assert "capture.yaml" in done.stdout
    with Image.open(tmp_path / "c.png") as picture:
        assert picture.size[0] > 1000


def test_a_scanner_that_has_not_moved_holds_by_other_placements_too(
    footscan: Footscan, calibrated: Path, films: MadeOnce
) -> None:
    def film(folder: Path) -> None:
        arguments = ("--out", folder, "--placements", 1, "--scanner-seed", 3)
        assert footscan("simulate", "capture", *arguments).returncode == 0

    done = footscan("calibrate", "check", calibrated, films("capture-again", film), "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["verdict"] == "steady"
    assert all(camera["rms_mm"] < 0.05 for camera in report["cameras"])
    assert "holds; every camera is within 0.2 mm" in done.stderr


def test_drift_is_measured_camera_by_camera(
    footscan: Footscan, calibrated: Path, capture: Path, tmp_path: Path
) -> None:
    """One camera's map is moved by 0.5 mm in Z, another has no film any more, and one sees nothing."""
    moved = json.loads(calibrated.read_text())
    matrix = moved["cameras"][1]["map"]["matrix"]
    for term in range(3):
        matrix[3 + term] += 0.5 * [*matrix[6:], 1.0][term]  # Z w + 0.5 w
    (tmp_path / "moved.json").write_text(json.dumps(moved))
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"] = [camera for camera in document["cameras"] if camera["id"] != 7]
    document["cameras"][2]["file"] = "dark/"
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    (capture / "dark").mkdir()
    for number in range(PLACEMENTS):
        Image.new("RGB", (640, 480)).save(capture / f"dark/{number}.png")
    done = footscan("calibrate", "check", tmp_path / "moved.json", capture, "--json")
    assert done.returncode == 1
    cameras = {camera["camera"]: camera for camera in json.loads(done.stdout)["cameras"]}
    assert {number: camera["verdict"] for number, camera in cameras.items()} == {
        1: "steady", 2: "drifted", 3: "not recognised", 4: "steady",
        5: "steady", 6: "steady", 7: "not in the capture", 8: "steady",
    }  # fmt: skip
    assert cameras[2]["shift_mm"] == pytest.approx([0.0, 0.5], abs=0.02)
    assert cameras[2]["rms_mm"] == pytest.approx(0.5, abs=0.02)
    assert "camera 2 is off by 0.50 mm; camera 3 is not recognised" in done.stderr


def test_drift_of_another_scanner_is_what_its_true_maps_say(
    footscan: Footscan, calibrated: Path, recorded: Path, tmp_path: Path
) -> None:
    another = Path(shutil.copytree(recorded / "capture", tmp_path / "another"))
    keep(another, 1, 4, 5, 8)
    done = footscan("calibrate", "check", calibrated, another, "--json")
    assert done.returncode == 1
    scanner, calibration = standard_scanner(1), read_calibration(calibrated)
    told = {camera["camera"]: camera for camera in json.loads(done.stdout)["cameras"]}
    for camera in (camera for camera in calibration.cameras if camera.camera in {1, 4, 5, 8}):
        pixels = scanner.camera(camera.camera).project_plane(GRID[:, 0], GRID[:, 1])
        inside = is_supported(camera, pixels)
        true = np.mean(to_world(camera, pixels[inside]) - GRID[inside], axis=0)
        assert told[camera.camera]["verdict"] == "drifted"
        assert told[camera.camera]["shift_mm"] == pytest.approx(true, abs=0.3 * np.hypot(*true) + 0.3)


def test_check_needs_a_camera_that_recognises_the_object(footscan: Footscan, calibrated: Path, capture: Path) -> None:
    document = yaml.safe_load((capture / "reference.yaml").read_text())
    document["profile_mm"] = [[0, 0], [30, 0], [30, 90], [0, 60]]
    (capture / "reference.yaml").write_text(yaml.safe_dump(document))
    done = footscan("calibrate", "check", calibrated, capture, "--picture", "why.png")
    assert done.returncode == 2
    assert "(see why.png)" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert Path("why.png").exists()


def keep(capture: Path, *cameras: int) -> None:
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"] = [camera for camera in document["cameras"] if camera["id"] in cameras]
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))


def test_corners_are_found_without_a_click(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 5)
    done = footscan("calibrate", "capture", capture, "--chart", "found.csv")
    assert done.returncode == 0, done.stderr
    charts = read_chart(Path("found.csv"))
    assert sorted(charts) == [1, 5]
    scanner = standard_scanner(3)
    for number, chart in charts.items():
        assert len(chart.points) >= 5
        exact = scanner.camera(number).project_plane(chart.world[:, 1], chart.world[:, 2])
        assert np.linalg.norm(chart.pixels - exact, axis=1).max() < 0.3
    assert footscan("calibrate", "chart", "found.csv").returncode == 0


@pytest.mark.parametrize("camera", [1, 5])
def test_one_camera_alone_is_calibrated(footscan: Footscan, capture: Path, camera: int) -> None:
    """Stray light is a third of what it sees, and no other camera tells where the object stood."""
    keep(capture, camera)
    done = footscan("calibrate", "capture", capture, "--out", "alone.json")
    assert done.returncode == 0, done.stderr
    assert "sees the object" not in done.stderr


def exchange(capture: Path, a: int, b: int) -> None:
    (capture / f"cam{a}.avi").rename(capture / "kept.avi")
    (capture / f"cam{b}.avi").rename(capture / f"cam{a}.avi")
    (capture / "kept.avi").rename(capture / f"cam{b}.avi")


def test_exchanged_films_are_refused(footscan: Footscan, calibrated: Path, capture: Path) -> None:
    keep(capture, 1, 2, 5)
    exchange(capture, 1, 5)
    done = footscan("calibrate", "capture", capture, "--out", "c.json")
    assert done.returncode == 2
    assert "camera 1: sees the object from front, left, below, expected from front, left, above" in done.stderr
    assert "and camera 5 likewise: is this its film?" in done.stderr
    assert Path("capture-refused.png").exists()
    assert not Path("c.json").exists()
    assert footscan("calibrate", "capture", capture, "--out", "c.json", "--keep-going").returncode == 0
    shown = footscan("calibrate", "show", "c.json")
    assert "Warning: camera 5 sees the object from front, left, above, expected from" in shown.stdout
    checked = footscan("calibrate", "check", calibrated, capture)
    assert checked.returncode == 1
    assert "(sees the object from front, left, below, expected from front, left, above)" in checked.stderr


def test_mirrored_placements_are_refused(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 5)
    place(capture, [[-y, z] for y, z in placements_of(capture)])
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 2
    assert "check the signs and the order of placements_mm" in done.stderr


def test_outputs_never_overwrite_what_is_read(footscan: Footscan, calibrated: Path, capture: Path) -> None:
    for arguments in (
        ("capture", capture, "--out", capture / "capture.yaml"),
        ("capture", capture, "--chart", capture / "reference.yaml"),
        ("check", calibrated, capture, "--picture", capture / "cam1.avi"),
        ("chart", capture / "chart.csv", "--out", capture / "chart.csv"),
        ("show", calibrated, "--out", calibrated),
    ):
        done = footscan("calibrate", *arguments)
        assert done.returncode == 2
        assert f"{arguments[-1]}: is an input, expected another file to write" in done.stderr
    assert "is a folder" in footscan("calibrate", "show", calibrated, "--out", capture).stderr


def test_a_camera_that_the_calibration_lacks_is_part_of_the_verdict(
    footscan: Footscan, calibrated: Path, capture: Path, tmp_path: Path
) -> None:
    keep(capture, 1, 2)
    fewer = json.loads(calibrated.read_text())
    fewer["cameras"] = [camera for camera in fewer["cameras"] if camera["camera"] == 1]
    (tmp_path / "fewer.json").write_text(json.dumps(fewer))
    done = footscan("calibrate", "check", tmp_path / "fewer.json", capture, "--json")
    assert done.returncode == 1
    verdicts = {camera["camera"]: camera["verdict"] for camera in json.loads(done.stdout)["cameras"]}
    assert verdicts == {1: "steady", 2: "not in the calibration"}


def test_a_camera_that_misses_the_object_in_one_frame_is_told(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 2, 5, 6)
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"][2]["file"] = "five/"
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    (capture / "five").mkdir()
    for number, frame in enumerate(pixel_frames(open_film(capture / "cam5.avi"))):
        assert frame is not None
        Image.fromarray(frame[::-1] if number == 2 else frame).save(capture / f"five/{number}.png")
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 0, done.stderr
    assert "camera 5: the object is not recognised in frame 2, which is not used" in done.stderr


def test_one_film_for_two_cameras_is_refused(footscan: Footscan, capture: Path) -> None:
    keep(capture, 1, 5)
    shutil.copy(capture / "cam1.avi", capture / "cam5.avi")
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 2
    assert "capture.yaml: camera 5: has the same film as camera 1" in done.stderr


def test_a_capture_of_links_is_read(footscan: Footscan, capture: Path, tmp_path: Path) -> None:
    keep(capture, 1)
    outside = tmp_path / "outside.yaml"
    (capture / "capture.yaml").rename(outside)
    (capture / "capture.yaml").symlink_to(outside)
    (tmp_path / "linked").symlink_to(capture, target_is_directory=True)
    done = footscan("calibrate", "capture", tmp_path / "linked", "--out", "c.json", "--model", "homography")
    assert done.returncode == 0, done.stderr
    assert [source.name for source in read_calibration(Path("c.json")).sources][:2] == [
        "capture.yaml",
        "reference.yaml",
    ]


def test_a_shift_that_all_cameras_share_may_be_the_objects(footscan: Footscan, calibrated: Path, capture: Path) -> None:
    keep(capture, 1, 2, 5, 6)
    place(capture, [[y + 0.5, z] for y, z in placements_of(capture)])
    done = footscan("calibrate", "check", calibrated, capture)
    assert done.returncode == 1
    assert "all cameras are off alike, by -0.50, " in done.stderr

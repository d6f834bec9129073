"""The stage: pictures are those of where the heads stand, exposures fall where pictures are exact."""

import threading
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.filming.renderers import Shot, Studio
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import MATT_GREY, Mesh, Scene
from footscan.virtual.optics.texture import random_texture
from footscan.virtual.stage.pictures import COARSE, StageLight, StagePictures, Subject
from footscan.virtual.stage.reference_stage import NOTHING, block_subject, foot_subject, reference_subject
from footscan.virtual.stage.stage import FRAMES_PER_SECOND, Stage
from schemas.parameters.simulation import SimulationSettings

SETTINGS = SimulationSettings()


class Clock:
    """Time that passes only when somebody waits for it."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def now(self) -> float:
        return self.seconds

    def wait(self, seconds: float) -> bool:
        self.seconds += seconds
        return False


@pytest.fixture(scope="module")
def block_pictures(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StagePictures]:
    with StagePictures(block_subject(200.0), SETTINGS, tmp_path_factory.mktemp("stage")) as pictures:
        yield pictures


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StagePictures]:
    with StagePictures(NOTHING, SETTINGS, tmp_path_factory.mktemp("empty")) as pictures:
        yield pictures


def stage_with(pictures: StagePictures, monkeypatch: pytest.MonkeyPatch, x_at: object, clock: Clock) -> Stage:
    """A stage all of whose heads stand at `x_at(seconds)`, on a clock that runs by itself."""
    assert callable(x_at)

    def position_at(seconds: float) -> tuple[float, float, float]:
        assert seconds <= clock.seconds + 1e-9, "a camera cannot know the future"
        return (x_at(seconds),) * 3

    stage = Stage(pictures, position_at)
    monkeypatch.setattr("footscan.clock.seconds", clock.now)
    monkeypatch.setattr(stage._closed, "wait", clock.wait)
    return stage


def test_pictures_are_those_of_a_film_but_for_edges_in_the_light_of_the_room(block_pictures: StagePictures) -> None:
    block = block_subject(200.0)
    assert block.mesh is not None
    [filmed] = Studio([block.mesh], MATT_GREY, SETTINGS).shoot(2, [Shot(401, 200.5, 0)])
    pictures = [filmed, block_pictures.picture(2, 401, StageLight())]
    exact, seen = (simplejpeg.decode_jpeg(jpeg, colorspace="RGB").astype(float) for jpeg in pictures)
    assert np.mean(np.abs(seen - exact).max(axis=2) > 8) < 0.02
    stripe = exact[..., 0] - exact[..., 1] > 60
    assert stripe.any()
    assert np.abs(seen - exact)[stripe].mean() < 1.0


def test_pictures_are_exactly_those_of_a_renderer_with_their_light_of_the_room(block_pictures: StagePictures) -> None:
    block = block_subject(200.0)
    assert block.mesh is not None
    scanner = standard_scanner(SETTINGS.scanner_seed, SETTINGS.distortion)
    texture = random_texture(SETTINGS.seed, MATT_GREY.unevenness * SETTINGS.texture)
    rendered = CameraRenderer(scanner, 2, SETTINGS, texture, coarse=COARSE).jpeg(
        Scene(block.mesh, MATT_GREY), 200.5, 401
    )
    assert block_pictures.picture(2, 401, StageLight()) == rendered


def test_less_light_makes_a_darker_picture_and_no_laser_none_of_its_red(block_pictures: StagePictures) -> None:
    full, half, off = (
        simplejpeg.decode_jpeg(block_pictures.picture(2, 401, light), colorspace="RGB").astype(float)
        for light in (StageLight(), StageLight(exposure=0.5), StageLight(power=0.0))
    )
    assert half.mean() < 0.85 * full.mean()
    redness = [(picture[..., 0] - picture[..., 1:].max(axis=2)).max() for picture in (full, off)]
    assert redness[0] > 100 > redness[1]


def test_levels_are_a_quarter_of_a_stop_apart() -> None:
    assert StageLight(0.001, 1.05, 2.0).nearest_level() == StageLight(0.0, 1.0, 2.0)
    assert StageLight(0.5, 1.15, 1.0).nearest_level() == StageLight(0.5, pytest.approx(2**0.25), 1.0)


def test_an_empty_scanner_looks_the_same_everywhere(empty: StagePictures) -> None:
    assert empty.picture(1, 3, StageLight()) == empty.picture(1, 77, StageLight())


def test_another_subject_has_other_pictures(tmp_path: Path) -> None:
    near = Subject(Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])))
    folders = {StagePictures(subject, SETTINGS, tmp_path)._folder for subject in (NOTHING, near)}
    folders |= {StagePictures(near, SETTINGS.model_copy(update={"seed": 2}), tmp_path)._folder}
    folders |= {StagePictures(near, SETTINGS, tmp_path, grid_mm=1.0)._folder}
    assert len(folders) == 4
    assert StagePictures(near, SETTINGS, tmp_path)._folder in folders


@pytest.mark.parametrize("mm_per_s", [36.0, -36.0, 80.0])
def test_moving_heads_are_caught_on_the_grid(
    block_pictures: StagePictures, monkeypatch: pytest.MonkeyPatch, mm_per_s: float
) -> None:
    """Speed with a ripple of 5 %: at 36 mm/s a place of the grid passes every 14 ms, within a jitter of 20."""
    clock = Clock()

    def x_at(seconds: float) -> float:
        t = seconds - 100.0
        return mm_per_s * (t + 0.05 / (2 * np.pi) * np.sin(2 * np.pi * t)) + 0.123

    stage = stage_with(block_pictures, monkeypatch, x_at, clock)
    times = list(islice(stage.exposures(1), 200))
    places = np.array([x_at(seconds) for seconds in times]) / 0.5
    assert np.abs(places - np.rint(places)).max() < 1e-3
    number = np.arange(200)
    off_clock = np.array(times) - times[0] - number / FRAMES_PER_SECOND
    assert np.ptp(off_clock) <= 0.02 + 1e-9
    assert 0.003 < off_clock.std() < 0.01


def test_standing_heads_are_seen_all_the_same(block_pictures: StagePictures, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = stage_with(block_pictures, monkeypatch, lambda _: 10.2, Clock())
    times = list(islice(stage.exposures(1), 50))
    assert all(before < after for before, after in pairwise(times))
    assert np.ptp(np.diff(times)) > 0.01  # the jitter stays


def test_a_slow_head_is_caught_where_it_passes_the_grid_and_not_where_it_does_not(
    block_pictures: StagePictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = stage_with(block_pictures, monkeypatch, lambda seconds: 5.0 * (seconds - 100.0), Clock())
    places = 5.0 * (np.array(list(islice(stage.exposures(1), 400))) - 100.0) / 0.5
    exact = np.abs(places - np.rint(places)) < 1e-3
    assert 0.1 < exact.mean() < 0.35  # 20 ms of each 100 that it takes from place to place


def test_pictures_in_a_row_differ_though_nothing_moves(block_pictures: StagePictures) -> None:
    stage = Stage(block_pictures, lambda _: (200.5, 0.0, 0.0))
    pictures = [stage.picture(2, 0.1 * k) for k in range(9)]
    assert all(a != b for a, b in pairwise(pictures))
    first, second = (simplejpeg.decode_jpeg(picture, colorspace="RGB").astype(float) for picture in pictures[:2])
    assert 0.5 < np.abs(first - second).mean() < 3.0


def test_each_camera_goes_by_its_own_head_and_light(block_pictures: StagePictures) -> None:
    stage = Stage(
        block_pictures, lambda _: (200.5, 0.0, 0.0), power_at=lambda _: 0.98, light_of=lambda camera: (2 / camera, 1.0)
    )
    assert stage.picture(2, 0.0) == block_pictures.picture(2, 401, StageLight())


def test_what_stands_on_the_glass_can_be_exchanged(block_pictures: StagePictures, empty: StagePictures) -> None:
    stage = Stage(block_pictures, lambda _: (200.5, 0.0, 0.0))
    before = stage.picture(2, 0.0)
    stage.put(empty)
    assert stage.picture(2, 0.1) == empty.picture(2, 0, StageLight()) != before


def test_closing_ends_exposures_that_are_waited_for(block_pictures: StagePictures) -> None:
    stage = Stage(block_pictures, lambda _: (0.0, 0.0, 0.0))
    ended = threading.Event()

    def take() -> None:
        for _ in stage.exposures(1, frames_per_second=0.01):
            pass
        ended.set()

    threading.Thread(target=take, daemon=True).start()
    stage.close()
    assert ended.wait(30.0)


def test_subjects_stand_on_the_glass_where_they_should() -> None:
    for subject, length in ((foot_subject("left", 150.0), 262.0), (block_subject(150.0), 158.15)):
        assert subject.mesh is not None
        low, high = subject.mesh.vertices.min(axis=0), subject.mesh.vertices.max(axis=0)
        assert (low + high)[:2] / 2 == pytest.approx([150.0, 0.0])
        assert low[2] == pytest.approx(0.0)
        assert high[0] - low[0] == pytest.approx(length, abs=0.05)
    placed = reference_subject(70.0, placement=1)
    assert placed.mesh is not None
    assert placed.mesh.vertices.min(axis=0) == pytest.approx([30.0, -10.0, 14.0])

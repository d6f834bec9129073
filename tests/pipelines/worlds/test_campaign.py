"""Worlds from their seeds to what came of them."""

import datetime
from pathlib import Path

import pytest

from footscan.calibration.travel.body import Body, standard_body
from footscan.virtual.worlds.draw import as_designed, draw_assembled, draw_world
from pipelines.engine.pool import Threads
from pipelines.worlds import campaign
from pipelines.worlds.campaign import run_worlds, world_key
from pipelines.worlds.graph import WorldGraph
from pipelines.worlds.night import fresh_seeds, read_kept, run_night_of_worlds
from schemas.base.errors import Fault, RefusedInput
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.regression import Seeds, SuiteWorlds
from schemas.world import World, WorldCameras, WorldGlass, WorldLaser, WorldSubject

COARSE, FINE = WorldCameras(frames=50, step_mm=8.0), WorldCameras(frames=100, step_mm=4.0)
"""Toes are not separated by stripes 8 mm apart: the foot axis turns, and its standard deviation says so."""
WORLDS = {
    1: World(seed=1, cameras=FINE),
    2: World(seed=2, cameras=COARSE, laser=WorldLaser(power=0.01)),
    4: World(seed=4, cameras=FINE, glass=WorldGlass(height_mm=-1.6, tilt_x_deg=0.4, tilt_y_deg=-0.3)),
    3: World(seed=3, cameras=COARSE, subject=WorldSubject(kind="last", toe_gap_mm=-1.0, leg_mm=90.0)),
}


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("worlds")


@pytest.fixture(scope="module")
def outcomes(out: Path) -> dict[int, WorldOutcome]:
    ran = run_worlds(list(WORLDS.values()), "points", ScanParameters(), out, Threads(2), lambda _: None)
    return {outcome.seed: outcome for outcome in ran}


def test_a_world_without_errors_is_measured_as_it_is(outcomes: dict[int, WorldOutcome]) -> None:
    nominal = outcomes[1]
    assert nominal.problem is None
    assert nominal.covered > 0.95
    assert nominal.shift_mm < 0.2
    assert nominal.surface is not None
    assert nominal.surface.mean < 0.15
    errors = {name: measure.error for name, measure in nominal.measures.items()}
    assert errors["foot_length"] == pytest.approx(0.0, abs=1.0)
    assert errors["instep_girth"] == pytest.approx(0.0, abs=1.0)


@pytest.mark.slow
def test_a_body_shows_where_the_planes_lie(tmp_path: Path) -> None:
    """Heads that are off by millimetres: with the film of the body the surface is nearly that of an ideal scanner."""
    assembled = draw_assembled(4)
    off = assembled.model_copy(update={"cameras": assembled.cameras.model_copy(update={"step_mm": 4.0})})

    def surface_mm(world: World, body: Body | None = None) -> float:
        [outcome] = run_worlds([world], "points", ScanParameters(), tmp_path, Threads(2), lambda _: None, body)
        assert outcome.surface is not None
        return outcome.surface.mean

    ideal, chart, both = surface_mm(as_designed(off)), surface_mm(off), surface_mm(off, standard_body())
    assert chart > 5.0 * ideal
    assert both < 2.5 * ideal


def test_of_steps_of_one_name_the_last_is_taken() -> None:
    """The film of a body takes maps of the cameras before the planes are known; the scan takes them again."""
    graph = WorldGraph(World(seed=1))
    before = graph.camera(1)
    graph.whole = graph.add("planes", "laser_planes", {"calibration": graph.whole})
    assert graph.camera(1) == before
    names = [step.name.rpartition("/")[2] for step in graph.to_last()]
    assert names == ["world", "calibration", "planes", "camera-map-1"]


def test_a_foot_on_a_plate_that_was_moved_is_measured_above_the_plate(outcomes: dict[int, WorldOutcome]) -> None:
    moved = outcomes[4]
    assert moved.measures["instep_height"].status == "ok"
    assert moved.measures["instep_height"].error == pytest.approx(0.0, abs=0.3)
    assert moved.measures["arch_index"].error == pytest.approx(0.0, abs=0.01)
    assert [warning for warning in moved.warnings if "the plate was moved since the calibration" in warning]


def test_a_world_without_light_is_refused_rightly(outcomes: dict[int, WorldOutcome]) -> None:
    dark = outcomes[2]
    assert dark.problem is not None
    assert dark.covered < 0.1
    assert not dark.is_measured
    assert not dark.can_be_measured
    assert dark.silent_errors == []


def test_a_last_has_no_ball(outcomes: dict[int, WorldOutcome]) -> None:
    assert outcomes[3].measures["ball_girth"].truth is None
    assert not outcomes[3].can_be_measured


def test_nothing_runs_again_and_no_intermediate_result_stays(
    outcomes: dict[int, WorldOutcome], out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "_run_window", None)
    again = run_worlds([WORLDS[2], WORLDS[1]], "points", ScanParameters(), out, Threads(1), lambda _: None)
    assert again == [outcomes[2], outcomes[1]]
    assert [path.name for path in out.iterdir()] == ["outcomes"]
    assert sum(file.stat().st_size for file in (out / "outcomes").iterdir()) < 50_000


def test_a_world_on_which_the_program_fails_is_an_outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*_: object) -> bytes:
        raise ZeroDivisionError("of a made-up step")

    monkeypatch.setattr("pipelines.steps.world_calibration.run", crash)
    (outcome,) = run_worlds([WORLDS[2]], "points", ScanParameters(), tmp_path, Threads(1), lambda _: None)
    assert outcome.crashed
    assert outcome.problem == "worlds/2/calibration: ZeroDivisionError: of a made-up step"


def test_a_full_disk_ends_a_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipelines.steps.world_calibration.run", fail)
    with pytest.raises(Fault, match="No space left"):
        run_worlds([WORLDS[2]], "points", ScanParameters(), tmp_path, Threads(1), lambda _: None)
    assert not list((tmp_path / "outcomes").glob("*")), "nothing is kept of a world that was not tried"


def test_a_filmed_world_is_extracted_and_compared(tmp_path: Path) -> None:
    """Half of the lower cameras and every fourth frame of a scan."""
    cameras = WorldCameras(frames=25, step_mm=16.0, missing=[1, 2, 3, 4, 7, 8])
    filmed = World(seed=4, cameras=cameras, subject=WorldSubject(leg_mm=80.0))
    (outcome,) = run_worlds([filmed], "films", ScanParameters(), tmp_path, Threads(2), lambda _: None)
    assert outcome.kind == "films"
    assert outcome.problem is not None or outcome.surface is not None
    assert 0.2 < outcome.covered < 0.9
    assert outcome.measures["foot_length"].truth == pytest.approx(262.0, abs=0.01)
    assert [path.name for path in tmp_path.iterdir()] == ["outcomes"], "films are not kept"


@pytest.mark.slow
def test_a_filmed_world_without_errors_is_measured_as_it_is(tmp_path: Path) -> None:
    weak = WorldLaser(power=6.0)
    plain = World(seed=5, cameras=WorldCameras(frames=200, step_mm=2.0), laser=weak, subject=WorldSubject())
    (outcome,) = run_worlds([plain], "films", ScanParameters(), tmp_path, Threads(2), lambda _: None)
    assert outcome.problem is None
    assert outcome.surface is not None
    assert outcome.surface.mean < 0.05
    assert outcome.measures["foot_length"].error == pytest.approx(0.0, abs=0.5)


def test_a_key_holds_the_world_and_the_parameters() -> None:
    usual = ScanParameters()
    other = usual.model_copy(update={"fusion": usual.fusion.model_copy(update={"spacing_mm": 0.5})})
    keys = {
        world_key(draw_world(1), "points", usual),
        world_key(draw_world(2), "points", usual),
        world_key(draw_world(1), "points", other),
        world_key(draw_world(1), "films", usual),
    }
    assert len(keys) == 4
    assert world_key(draw_world(1), "points", usual) in keys


def test_seeds_of_days_differ() -> None:
    days = [datetime.date(2026, 11, 23), datetime.date(2026, 11, 24), datetime.date(2027, 1, 1)]
    seeds = [seed for day in days for seed in fresh_seeds(day, 20)]
    assert len(set(seeds)) == 60
    assert max(seeds) < 2**32


def test_a_described_world_needs_a_seed_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text(World(seed=3).model_dump_json())
    worlds = SuiteWorlds(points=Seeds(first=1, count=1), films=Seeds(first=1, count=5), described=["mine.json"])
    day = datetime.date(2026, 11, 23)
    with pytest.raises(RefusedInput, match="world 3 is filmed twice"):
        run_night_of_worlds(worlds, ScanParameters(), tmp_path, tmp_path, day, "suite", lambda *_: None)
    missing = worlds.model_copy(update={"described": ["nowhere.json"]})
    with pytest.raises(RefusedInput, match="no such file"):
        run_night_of_worlds(missing, ScanParameters(), tmp_path, tmp_path, day, "suite", lambda *_: None)


def test_kept_seeds_are_read_back(tmp_path: Path) -> None:
    assert read_kept(tmp_path) == []
    (tmp_path / "worlds").mkdir()
    file = tmp_path / "worlds" / "kept.json"
    file.write_text("[3, 5]")
    assert read_kept(tmp_path) == [3, 5]
    file.write_text("{")
    with pytest.raises(RefusedInput, match="expected a list of seeds"):
        read_kept(tmp_path)

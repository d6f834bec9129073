"""The parts of a search: space, samplers, journal, data, winner."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.tuning.data import split
from pipelines.tuning.journal import Journal
from pipelines.tuning.objectives import GOALS, Judged, figures_of, goals_of, mean_of, values_of
from pipelines.tuning.pareto_front import best_compromise, on_front
from pipelines.tuning.report.result import Gain
from pipelines.tuning.sampling import proposals_of
from pipelines.tuning.space import Point, grid, present_point, with_point
from schemas.base.errors import RefusedInput
from schemas.fusion import Disagreement, FusionReport, PairDisagreement
from schemas.parameters.scan import ScanParameters
from schemas.quality import CameraQuality, MeshQuality, Quality
from schemas.tuning import TriedPoint, Tuning

SEARCH: dict[str, Any] = {
    "extraction.red_threshold": {"low": 8, "high": 60},
    "extraction.ridge_px": {"low": 0.5, "high": 4},
    "extraction.centre_method": ["gravity", "fir"],
    "outliers.island_share": {"low": 1e-4, "high": 0.1, "log": True},
    "outliers.z_mm": [[-1, 100], [-2, 90]],
}


def tuning(**values: Any) -> Tuning:
    return Tuning.model_validate({"search": SEARCH, **values})


def scans(*names: str, truth: str = "", side: str = "right") -> list[Any]:
    """Scans with the names `patient/scan`; those in `truth` name a truth."""
    return [
        SimpleNamespace(
            name=name,
            truth=Path("truth.stl") if name in truth.split() else None,
            document=SimpleNamespace(patient=name.partition("/")[0], side=side),
        )
        for name in names
    ]


def test_a_point_is_laid_over_the_parameters() -> None:
    present = ScanParameters.model_validate({"extraction": {"gap_px": 7}})
    point = {"extraction.red_threshold": 30, "outliers.z_mm": [-2.0, 90.0], "outliers.drop_unsupported": False}
    changed = with_point(present, point)
    assert changed.model_dump(exclude_unset=True, mode="json") == {
        "extraction": {"gap_px": 7.0, "red_threshold": 30},
        "outliers": {"z_mm": [-2.0, 90.0], "drop_unsupported": False},
    }
    with pytest.raises(RefusedInput, match="faintest_contrast: expected at most smallest_contrast"):
        with_point(present, {"extraction.smallest_contrast": 3})


def test_the_present_point_holds_what_is_sought() -> None:
    assert present_point(ScanParameters(), tuning()) == {
        "extraction.red_threshold": 18,
        "extraction.ridge_px": 2.5,
        "extraction.centre_method": "gravity",
        "outliers.island_share": 0.005,
        "outliers.z_mm": None,
    }


def test_a_grid_has_every_combination_in_order() -> None:
    search = {
        "extraction.red_threshold": {"low": 8, "high": 20, "step": 5},
        "extraction.ridge_px": {"low": 0.5, "high": 0.8, "step": 0.1},
        "extraction.centre_method": ["gravity", "fir"],
    }
    points = list(grid(tuning(search=search, sampler="grid")))
    assert len(points) == 3 * 4 * 2
    assert [tuple(point.values()) for point in points[:3]] == [
        (8, 0.5, "gravity"),
        (8, 0.5, "fir"),
        (8, 0.6, "gravity"),
    ]
    assert tuple(points[-1].values()) == (18, 0.8, "fir")
    assert isinstance(points[0]["extraction.red_threshold"], int)


@pytest.mark.parametrize(
    ("tried", "problem"),
    [
        ({"extraction.ridge_px": {"low": 1, "high": 2}}, "range without a step"),
        ({"extraction.ridge_px": {"low": 1, "high": 2, "step": 1e-6}}, "at most 10000"),
        ({"extraction.red_threshold": {"low": 1, "high": 200}, "outliers.shortest": {"low": 1, "high": 99}}, "19800"),
    ],
)
def test_a_grid_that_never_ends_is_refused(tried: dict[str, Any], problem: str) -> None:
    with pytest.raises(RefusedInput, match=problem):
        grid(tuning(search=tried, sampler="grid"))


def loss(point: Point) -> list[float]:
    """Least at a threshold of 24 and a width of 1.5; the second objective wants a small threshold."""
    off = abs(point["extraction.red_threshold"] - 24) / 20 + abs(point["extraction.ridge_px"] - 1.5)
    return [off + (point["extraction.centre_method"] == "fir"), point["extraction.red_threshold"]]


def propose(section: Tuning, count: int, known: list[Point], objectives: int = 2) -> list[Point]:
    proposals = proposals_of(section, objectives)
    found = []
    for number in range(count):
        point = proposals.ask()
        assert point is not None
        if number < len(known):
            point = known[number]
        proposals.tell(point, loss(point)[:objectives])
        found.append(point)
    return found


@pytest.mark.parametrize("sampler", ["random", "tpe", "nsga2"])
def test_a_search_goes_on_as_if_it_had_not_been_interrupted(sampler: str) -> None:
    section = tuning(sampler=sampler)
    whole = propose(section, 30, [])
    kept = json.loads(json.dumps(whole[:17]))  # as a journal has them
    assert propose(section, 30, kept) == whole
    assert len({json.dumps(point) for point in whole}) > 25
    assert propose(tuning(sampler=sampler, seed=2), 5, []) != whole[:5]


def test_proposals_lie_within_their_ranges_and_are_plain_numbers() -> None:
    section = tuning()
    for point in propose(section, 30, []):
        assert isinstance(point["extraction.red_threshold"], int)
        assert 8 <= point["extraction.red_threshold"] <= 60
        assert 0.5 <= point["extraction.ridge_px"] <= 4
        assert len(repr(point["extraction.ridge_px"])) <= 6
        assert 1e-4 <= point["outliers.island_share"] <= 0.1
        assert point["outliers.z_mm"] in ([-1.0, 100.0], [-2.0, 90.0])
        with_point(ScanParameters(), point)


def test_steps_of_a_range_are_kept_to() -> None:
    search = {
        "extraction.red_threshold": {"low": 8, "high": 21, "step": 5},
        "extraction.ridge_px": {"low": 0.5, "high": 0.95, "step": 0.2},
    }
    section = tuning(search=search, sampler="random")
    proposals = proposals_of(section, 1)
    points = []
    for _ in range(30):
        point = proposals.ask()
        assert point is not None
        proposals.tell(point, [1.0])
        points.append(point)
    assert {point["extraction.red_threshold"] for point in points} == {8, 13, 18}
    assert {point["extraction.ridge_px"] for point in points} == {0.5, 0.7, 0.9}


def test_tpe_finds_what_forty_random_trials_do_not() -> None:
    best = {
        sampler: sum(
            min(loss(point)[0] for point in propose(section, 40, [], objectives=1))
            for section in (tuning(sampler=sampler, seed=seed) for seed in range(4))
        )
        for sampler in ("tpe", "random")
    }
    assert best["tpe"] < 0.7 * best["random"]


def test_generations_of_nsga2_become_better() -> None:
    losses = [loss(point)[0] for point in propose(tuning(sampler="nsga2"), 72, [], objectives=1)]
    assert sum(losses[-12:]) < 0.5 * sum(losses[:12])


def test_a_journal_keeps_what_is_whole(tmp_path: Path) -> None:
    journal = Journal(tmp_path, tuning())
    assert journal.read() == []
    values = dict.fromkeys(reversed(SEARCH), 1.0)
    points = [TriedPoint(point={**values, "extraction.ridge_px": k / 3}, seconds={f"{k}": 0.5}) for k in range(3)]
    for point in points:
        journal.append(point)
    assert journal.read() == points
    assert [list(tried.point or {}) for tried in journal.read()] == [list(SEARCH)] * 3
    [path] = tmp_path.iterdir()
    whole = path.read_text()
    path.write_text(whole[:-10])  # it was killed as it wrote
    assert journal.read() == points[:2]
    journal.append(points[2])
    assert path.read_text() == whole
    path.write_text(whole.replace('"seconds":{"1"', '"secnds":{"1"'))
    assert journal.read() == points[:1]
    path.write_bytes(b"\xff\xfe")
    assert journal.read() == []


def test_each_search_has_its_journal(tmp_path: Path) -> None:
    first, other = Journal(tmp_path, tuning()), Journal(tmp_path, tuning(seed=2))
    for journal in (first, other):
        journal.read()
    first.append(TriedPoint(point={}, seconds={"a": 1.0}))
    other.append(TriedPoint(point=None, seconds={"b": 2.0}))
    assert Journal(tmp_path, tuning(trials=99, data="P*", held_out=0.5)).read() == first.read()
    assert len(first.read()) == len(other.read()) == 1
    assert first.seconds() == {"a": 1.0, "b": 2.0}


def test_data_are_chosen_by_pattern() -> None:
    every = scans("P1/a", "P1/b", "P2/a", "P3/a")
    data, held_out = split(every, tuning(data=["P1/*", "P2/a"], held_out=["*/b"]))
    assert [scan.name for scan in data] == ["P1/a", "P2/a"]
    assert [scan.name for scan in held_out] == ["P1/b"]
    assert split(every, tuning()) == (every, [])
    with pytest.raises(RefusedInput, match=r"tune.data: no scan .* 'P1/c', did you mean 'P1/"):
        split(every, tuning(data="P1/c"))
    with pytest.raises(RefusedInput, match="holds all scans out"):
        split(every, tuning(held_out="*"))


def test_a_share_is_drawn_by_patient_and_by_seed() -> None:
    every = scans(*(f"P{patient}/{name}" for patient in range(8) for name in "ab"))
    data, held_out = split(every, tuning(held_out=0.25))
    assert len(held_out) == 4
    assert len({scan.document.patient for scan in held_out}) == 2
    assert {scan.document.patient for scan in data}.isdisjoint({scan.document.patient for scan in held_out})
    draws = {tuple(scan.name for scan in split(every, tuning(held_out=0.25, seed=seed))[1]) for seed in range(9)}
    assert len(draws) > 3
    assert [scan.name for scan in split(scans("P1/a", "P1/b", "P1/c"), tuning(held_out=0.1))[1]] != []


def quality(*, removed: int = 0, filled: float | None = 0.2, pairs: tuple[tuple[int, float], ...] = ()) -> Quality:
    camera = CameraQuality(
        camera=1, frames=9, frames_lost=0, frames_with_stripe=9, points=400, removed={"end": removed}
    )
    found = [
        PairDisagreement(
            cameras=(1, 2), points=points,
            before=Disagreement(median_mm=9, deviation_mm=9, rms_mm=9),
            after=Disagreement(median_mm=0, deviation_mm=0, rms_mm=rms),
        )
        for points, rms in pairs
    ]  # fmt: skip
    mesh = MeshQuality(
        vertices=4, triangles=4, open_edges=0, non_manifold_edges=0, components=1, holes=0, filled_share=filled
    )
    return Quality.model_construct(
        cameras=[camera], fusion=FusionReport(pairs=found), cloud_points=9, mesh=mesh, truth=None
    )


def test_figures_of_a_scan_without_truth() -> None:
    figures = figures_of(quality(removed=30, pairs=((100, 0.3), (300, 0.1))), None)
    # (100 * 0.09 + 300 * 0.01) / 400 = 0.03
    assert figures == pytest.approx({"false_points": 7.5, "completeness": 80.0, "disagreement": 0.03**0.5})
    assert figures_of(quality(filled=None), None) == {"false_points": 0.0}
    shares = b'{"false": 0.01, "there": 0.95}'
    assert figures_of(quality(), shares) == pytest.approx({"false_points": 1.0, "completeness": 95.0})


def test_what_stands_in_for_a_truth_is_said() -> None:
    goals, notes = goals_of(["accuracy", "completeness"], scans("P1/a", "P2/a"))
    assert [goal.name for goal in goals] == ["disagreement", "completeness"]
    assert "a camera saw" in goals[1].meaning
    assert "No scan names a truth: agreement of the cameras stands in for accuracy" in notes[0]
    goals, notes = goals_of(["accuracy"], scans("P1/a", "P1/b"))
    assert [goal.name for goal in goals] == ["disagreement", "repeatability"]
    goals, notes = goals_of(["accuracy"], scans("P1/a", "P1/b", truth="P1/b"))
    assert goals == [GOALS["accuracy"]]
    assert notes == ["accuracy is that of the 1 of 2 scans that name a truth."]
    assert goals_of(["accuracy"], scans("P1/a", truth="P1/a"))[1] == []
    with pytest.raises(RefusedInput, match="repeatability needs two scans"):
        goals_of(["repeatability"], scans("P1/a", "P2/a"))
    with pytest.raises(RefusedInput, match="repeatability needs two scans"):
        goals_of(["repeatability"], scans("P1/a", "P1/b", side="unknown"))


def test_repeatability_is_that_of_each_foot() -> None:
    every = scans("P1/a", "P1/b", "P2/a")
    judged = {
        "P1/a": Judged(lengths={"foot_length": 260.0, "ball_girth": 240.0, "heel_girth": 300.0}),
        "P1/b": Judged(lengths={"foot_length": 262.0, "ball_girth": 240.0}),
        "P2/a": Judged(problem="lost"),
    }
    # variances 2 and 0 of what both have
    assert values_of(GOALS["repeatability"], judged, every) == {"P1 right": 1.0}
    judged["P1/b"] = Judged(problem="no stripe")
    assert values_of(GOALS["repeatability"], judged, every) == {"P1 right": None}


def test_a_scan_that_failed_counts_as_the_worst() -> None:
    every = scans("P1/a", "P2/a", "P3/a", truth="P1/a P2/a")
    judged = {"P1/a": Judged({"accuracy": 0.02, "completeness": 98.0, "false_points": 1.0})}
    judged |= {name: Judged(problem="no stripe", kind="finding") for name in ("P2/a", "P3/a")}
    accuracy = values_of(GOALS["accuracy"], judged, every)
    assert accuracy == {"P1/a": 0.02, "P2/a": None}
    assert mean_of(GOALS["accuracy"], accuracy) == pytest.approx(50.01)
    for name, mean in (("completeness", 98 / 3), ("false_points", 201 / 3)):
        values = values_of(GOALS[name], judged, every)
        assert mean_of(GOALS[name], values) == pytest.approx(mean)
    assert values_of(GOALS["accuracy"], judged, every[2:]) == {}


def test_front_and_winner() -> None:
    values = [(5.0, 5.0), (1.0, 9.0), (2.0, 3.0), (9.0, 1.0), (2.0, 3.0), (9.0, 9.0)]
    assert on_front(values) == {1, 2, 3, 4}
    assert best_compromise(values, (0.1, 0.1), on_front(values)) == 2
    # A half of the one is worth more than a third more of the other, in whatever unit.
    assert best_compromise([(100.0, 3.0), (50.0, 4.0), (300.0, 2.0)], (0.1, 0.1), {0, 1, 2}) == 1
    assert best_compromise([(0.5, 3.0), (0.1, 3.1)], (0.5, 0.1), {0, 1}) == 0
    single = [(3.0,), (2.0,), (2.0,)]
    assert on_front(single) == {1, 2}
    assert best_compromise(single, [0.1], on_front(single)) == 1
    assert best_compromise([(2.0,), (2.0,)], [0.1], {0, 1}) == 0


@pytest.mark.parametrize(
    ("sets", "mean", "spread", "verdict"),
    [
        ([(0.05, 0.03), (0.05, 0.04)], 0.015, 0.00707, "real"),
        ([(0.05, 0.03), (0.05, 0.06)], 0.005, 0.02121, "within the spread"),
        ([(0.03, 0.05), (0.04, 0.05)], -0.015, 0.00707, "real loss"),
        ([(0.05, 0.03)], 0.02, None, "unproven"),
        ([(0.05, 0.05), (0.04, 0.04)], 0.0, 0.0, "none"),
        ([(None, 0.03), (0.05, 0.04)], 0.01, None, "fails less"),
        ([(0.05, None), (0.05, 0.04)], 0.01, None, "fails more"),
        ([(None, 0.03)], None, None, "fails less"),
        ([(None, None), (0.05, 0.04)], 0.01, None, "unproven"),
    ],
)
def test_a_gain_is_held_against_its_spread(sets: list[Any], mean: float, spread: float, verdict: str) -> None:
    gain = Gain(GOALS["accuracy"], {str(number): pair for number, pair in enumerate(sets)})
    assert gain.mean == pytest.approx(mean)
    assert gain.spread == (spread if spread is None else pytest.approx(spread, abs=1e-5))
    assert gain.verdict == verdict
    assert (gain.means[0] is None) == (sets[0][0] is None and len(sets) == 1)
    assert gain.means[1] == pytest.approx(sum(known) / len(known) if (known := [b for _, b in gain.both]) else 0.03)
    larger = Gain(GOALS["completeness"], {str(number): (b, a) for number, (a, b) in enumerate(sets)})
    assert larger.mean == pytest.approx(mean)

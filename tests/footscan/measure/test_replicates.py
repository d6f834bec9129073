"""Replicates of a foot: standard deviations that hold what errors of the surface do to its measures."""

import numpy as np
import pytest

from footscan.measure.frame.foot_frame import foot_frame
from footscan.measure.measures import measure_foot
from footscan.measure.replicates import of_replicates
from footscan.measure.uncertainty import SurfaceErrors, scatter_of, with_landmarks
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from footscan.surface.errors.field import ErrorField
from footscan.virtual.foot.foot import make_foot

SD_MM, REACH_MM = 0.03, 10.0


@pytest.fixture(scope="module")
def foot() -> Mesh:
    made = make_foot()
    return Mesh(made.vertices, made.faces)


def drawn_from(errors: SurfaceErrors, random: np.random.Generator) -> np.ndarray:
    """Displacements of the vertices, drawn at random, mm."""
    return errors.displacements(random.normal(size=sum(errors.counts)))


def sigmas(foot: Mesh, count: int) -> np.ndarray:
    """Errors of measures of four feet whose surface errs, in standard deviations as reported."""
    true = measure_foot(foot.vertices, foot.faces, "right").measures
    normals = vertex_normals(foot.vertices, foot.faces)
    errors = [ErrorField("noise", np.full(len(foot.vertices), SD_MM), REACH_MM)]
    found = []
    for seed in range(4):
        away = drawn_from(SurfaceErrors(foot.vertices, errors), np.random.default_rng(seed))
        moved = foot.vertices + away[:, None] * normals
        measures = measure_foot(moved, foot.faces, "right", errors=errors, count=count).measures
        for name, measure in measures.items():
            if measure.value is not None and measure.uncertainty and true[name].value is not None:
                found.append(abs(measure.value - true[name].value) / measure.uncertainty)
    return np.array(found)


@pytest.mark.slow
def test_the_standard_deviations_hold_the_errors(foot: Mesh) -> None:
    by_replicates, linear = sigmas(foot, count=16), sigmas(foot, count=0)
    assert np.mean(by_replicates < 3) >= 0.98
    assert np.mean(by_replicates < 1) > 0.5
    assert np.mean(linear < 3) < np.mean(by_replicates < 3)  # landmarks on plateaus


def test_a_drawn_error_is_as_large_as_said_and_shared_by_neighbours() -> None:
    random = np.random.default_rng(0)
    places = random.uniform(0.0, 300.0, (20_000, 3))
    places[1] = places[0] + [0.0, 0.0, 0.1]
    drawn = np.array([drawn_from(of_places(places, None), random) for _ in range(200)])
    assert drawn.std() == pytest.approx(SD_MM, rel=0.02)
    assert abs(drawn.mean()) < 0.05 * SD_MM
    assert np.corrcoef(drawn[:, 0], drawn[:, 1])[0, 1] > 0.99


def test_all_of_a_section_move_together() -> None:
    random = np.random.default_rng(0)
    places = np.array([[100.0, -40, 0], [100, 40, 60], [160, 0, 0]])
    drawn = np.array([drawn_from(of_places(places, places[:, 0]), random) for _ in range(500)])
    left, right, ahead = np.corrcoef(drawn.T)[0]
    assert left == pytest.approx(1.0)
    assert right == pytest.approx(1.0)
    assert abs(ahead) < 0.15


def of_places(places: np.ndarray, along_mm: np.ndarray | None) -> SurfaceErrors:
    return SurfaceErrors(places, [ErrorField("sway", np.full(len(places), SD_MM), REACH_MM, along_mm)])


def test_replicates_are_the_same_in_every_run(foot: Mesh) -> None:
    frame = foot_frame(foot.vertices, foot.faces, "right")
    errors = SurfaceErrors(frame.vertices, [ErrorField("noise", np.full(len(frame.vertices), SD_MM), REACH_MM)])
    first, again = (of_replicates(frame, errors, 2, lambda one: one) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
    assert np.abs(first[0].vertices - first[1].vertices).max() > SD_MM
    assert abs(first[0].length - frame.length) < 0.5


def test_an_axis_that_was_not_found_is_sought_again(foot: Mesh) -> None:
    frame = foot_frame(foot.vertices, foot.faces, "right", axis="ball_center")
    errors = SurfaceErrors(frame.vertices, [ErrorField("noise", np.full(len(frame.vertices), 0.1 * SD_MM))])
    assert [one.axis for one in of_replicates(frame, errors, 1, lambda one: one)] == ["ball_center"]
    fallback = frame._replace(axis_not_found="toe2")
    [replicate] = of_replicates(fallback, errors, 1, lambda one: one)
    assert replicate.axis == "toe2"
    assert abs(replicate.transform[1, 0] - frame.transform[1, 0]) > np.deg2rad(0.5)


def test_the_turn_from_one_axis_to_the_other_counts_once() -> None:
    values = [{"foot_breadth": 98.0 + 0.1 * (k % 2)} for k in range(16)]
    same, other = (scatter_of(values, 16, is_on_other_axis)["foot_breadth"] for is_on_other_axis in (False, True))
    budget = with_landmarks({}, other, 98.8)
    assert budget == {"landmarks": pytest.approx(0.75, abs=0.01)}
    assert with_landmarks({}, same, 98.8) == {"landmarks": pytest.approx(np.sqrt(0.5) * budget["landmarks"])}


def test_a_measure_that_few_replicates_have_has_no_scatter() -> None:
    values = [{"foot_length": 250.0 + k, **({"ball_girth": 240.0} if k < 4 else {})} for k in range(10)]
    scatter = scatter_of(values, count=20)
    assert set(scatter) == {"foot_length"}
    assert scatter["foot_length"].missing == 0.5
    assert scatter["foot_length"].sd > np.std(np.arange(10.0), ddof=1)

import os
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footscan.measure.definitions.conventions import CONVENTIONS, OWN
from footscan.measure.foot_landmarks import Landmark
from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.frame.glass import glass_sd
from footscan.measure.measures import measure_foot, take_measures
from footscan.mesh.formats.files import read_mesh
from footscan.mesh.topology import vertex_normals
from footscan.surface.errors.field import ErrorField
from footscan.virtual.foot.foot import Foot, make_foot
from schemas.base.errors import Finding
from schemas.glass import GlassPlane
from schemas.measures import Measure, Measures

KNOWN_LANDMARKS = ("metatarsale_tibiale", "metatarsale_fibulare", "landing_point", "junction_point", "pternion")


@lru_cache
def foot() -> Foot:
    return make_foot(resolution_mm=2.0)


@lru_cache
def measured() -> Measures:
    return measure_foot(foot().vertices, foot().faces, "right")


def known_place(vertices: np.ndarray | None = None) -> dict[str, Measure]:
    """Measures of the foot where its landmarks are known."""
    vertices = foot().vertices if vertices is None else vertices
    frame = FootFrame(vertices, foot().faces, vertices, np.eye(4), "toe2", foot().measures["foot_length"])
    landmarks = {name: Landmark(point, "geometric", 1.0) for name, point in foot().landmarks.items()}
    return take_measures(frame, landmarks)


def noisy(noise: float, seed: int) -> np.ndarray:
    vertices = foot().vertices
    away = np.random.default_rng(seed).normal(0, noise, (len(vertices), 1))
    return vertices + away * vertex_normals(vertices, foot().faces)


def values(measures: dict[str, Measure]) -> dict[str, float]:
    return {name: measure.value for name, measure in measures.items() if measure.value is not None}


def statuses(measures: Measures) -> dict[str, str]:
    return {name: measure.status for name, measure in measures.measures.items()}


def test_measures_equal_those_of_the_construction() -> None:
    measures = known_place()
    for name, exact in foot().measures.items():
        tolerance = {"arch_index": 0.001}.get(name, 0.15 if "girth" in name else 0.06)
        assert measures[name].value == pytest.approx(exact, abs=tolerance), name
        assert measures[name].status == "ok"


def test_without_help_too() -> None:
    for name, exact in foot().measures.items():
        tolerance = {"arch_index": 0.001}.get(name, 0.5 if "girth" in name else 0.3)
        assert measured().measures[name].value == pytest.approx(exact, abs=tolerance), name


def test_the_glass_below_a_foot_moves_its_print_and_the_uncertainty_says_so() -> None:
    glass = GlassPlane(below_foot_sd_mm=0.2)
    low, high = (values(known_place(foot().vertices + np.array([0.0, 0.0, mm])))["arch_index"] for mm in (-0.1, 0.1))
    budget = measure_foot(foot().vertices, foot().faces, "right", glass=glass).measures["arch_index"].budget
    assert budget is not None
    assert budget["glass"] == pytest.approx((low - high) / 0.2 * glass_sd(glass), rel=0.2)


def test_what_follows_from_others() -> None:
    result = values(known_place())
    landmarks = foot().landmarks
    across = landmarks["metatarsale_tibiale"] - landmarks["metatarsale_fibulare"]
    assert result["foot_breadth_diagonal"] == pytest.approx(np.hypot(across[0], across[1]), abs=1e-3)
    assert result["ball_angle"] == pytest.approx(np.rad2deg(np.arctan2(across[1], across[0])), abs=0.01)
    assert result["toe_length"] == pytest.approx(result["foot_length"] - result["ball_length"], abs=2e-3)
    assert result["arch_height_index"] == pytest.approx(result["instep_height"] / result["ball_length"], abs=1e-4)
    assert result["foot_breadth_max"] == pytest.approx(result["foot_breadth"], abs=0.1)
    assert result["ball_height"] < result["instep_height"] < result["scan_height"]
    assert result["instep_girth_min"] <= result["instep_girth"] + 3 if "instep_girth_min" in result else True


def test_a_girth_is_never_longer_than_its_surface() -> None:
    girths = {name: measure for name, measure in measured().measures.items() if "girth" in name}
    assert len(girths) == 8
    for name, measure in girths.items():
        if measure.value is not None:
            assert measure.surface_length is not None
            assert measure.value <= measure.surface_length + 0.01, name


@pytest.mark.parametrize("mirrored", [False, True])
def test_motion_and_mirroring_change_nothing(mirrored: bool) -> None:
    turn = Rotation.from_euler("xyz", [20.0, 170.0, 130.0], degrees=True).as_matrix()
    mirror = np.array([1.0, -1.0, 1.0]) if mirrored else np.ones(3)
    faces = foot().faces[:, ::-1] if mirrored else foot().faces
    vertices = (foot().vertices * mirror) @ turn.T + [300.0, -40.0, 700.0]
    posed = measure_foot(vertices, np.ascontiguousarray(faces), "left" if mirrored else "right")
    lying = measure_foot(foot().vertices + np.array([0.0, 0.0, 50.0]), foot().faces, "right")
    assert values(posed.measures).keys() == values(lying.measures).keys()
    for name, value in values(lying.measures).items():
        tolerance = {"foot_volume": 100.0, "foot_surface": 10.0}.get(name, 0.01)
        assert values(posed.measures)[name] == pytest.approx(value, abs=tolerance), name


@pytest.mark.parametrize("resolution", [1.5, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_noise_changes_a_ball_girth_by_less_than_half_a_millimetre(seed: int, resolution: float) -> None:
    fine = foot() if resolution == 2.0 else make_foot(resolution_mm=resolution)
    away = np.random.default_rng(seed).normal(0, 0.3, (len(fine.vertices), 1))
    landmarks = {name: Landmark(point, "geometric", 1.0) for name, point in fine.landmarks.items()}
    girths = []
    for vertices in (fine.vertices, fine.vertices + away * vertex_normals(fine.vertices, fine.faces)):
        frame = FootFrame(vertices, fine.faces, vertices, np.eye(4), "toe2", fine.measures["foot_length"])
        girths.append(take_measures(frame, landmarks, count=0)["ball_girth"].value or 0.0)
    assert girths[1] == pytest.approx(girths[0], abs=0.5)


def test_the_uncertainty_is_the_scatter() -> None:
    repeated = [measure_foot(noisy(0.2, seed), foot().faces, "right", count=0).measures for seed in range(10)]
    ratios = {}
    for name in (
        "foot_length",
        "foot_breadth",
        "ball_length",
        "instep_height",
        "ball_girth",
        "waist_girth",
        "heel_girth",
    ):
        scatter = float(np.std([measures[name].value or 0.0 for measures in repeated], ddof=1))
        ratios[name] = float(np.median([measures[name].uncertainty or 0.0 for measures in repeated])) / scatter
    # Ten repetitions know a scatter to a quarter of it.
    assert np.median(list(ratios.values())) == pytest.approx(1.0, rel=0.4)
    assert all(0.4 < ratio < 2.5 for ratio in ratios.values()), ratios


def test_given_errors_take_the_place_of_roughness() -> None:
    count = len(foot().vertices)
    small, large = (
        measure_foot(
            foot().vertices, foot().faces, "right", errors=[ErrorField("noise", np.full(count, error))]
        ).measures["ball_girth"]
        for error in (0.1, 0.4)
    )
    assert small.value == large.value == measured().measures["ball_girth"].value
    together = measure_foot(
        foot().vertices, foot().faces, "right", errors=[ErrorField("noise", np.full(count, 0.1), 10.0)]
    ).measures["foot_length"]
    alone = measure_foot(
        foot().vertices, foot().faces, "right", errors=[ErrorField("noise", np.full(count, 0.1))]
    ).measures["foot_length"]
    assert (together.uncertainty or 0.0) > 1.2 * (alone.uncertainty or 0.0)
    assert 0.05 < (together.uncertainty or 0.0) < 0.25  # at most 0.1 at each end, and the fits lean a little beyond
    assert large.uncertainty == pytest.approx(4 * (small.uncertainty or 0.0), rel=0.01)


def test_a_measure_that_rests_on_filled_surface_is_uncertain() -> None:
    x = foot().vertices[:, 0] / foot().measures["foot_length"]
    back = (np.abs(x - 0.5) < 0.05) & (foot().vertices[:, 2] > 20)
    measures = measure_foot(foot().vertices, foot().faces, "right", filled=back).measures
    instep = measures["instep_girth"]
    assert instep.status == "uncertain"
    assert instep.filled_share is not None
    assert instep.filled_share > 0.2
    assert "filled, or that one camera alone saw" in (instep.note or "")
    height = measures["instep_height"].filled_share
    assert height is not None
    assert 0.5 < height < 1.0  # where half the length is rests on heel and toe
    assert (measures["foot_length"].status, measures["foot_length"].filled_share) == ("ok", 0.0)
    assert measured().measures["instep_girth"].filled_share is None


def test_measures_of_a_doubted_calibration_are_uncertain() -> None:
    doubt = "camera 3 had moved by 0.41 mm when the calibration was checked on 2026-11-24: calibrate anew"
    usual = measure_foot(foot().vertices, foot().faces, "right")
    doubted = measure_foot(foot().vertices, foot().faces, "right", doubts=[doubt])
    assert (usual.doubts, usual.warnings) == ([], [])
    assert (doubted.doubts, doubted.warnings) == ([doubt], [doubt])
    for name, measure in doubted.measures.items():
        before = usual.measures[name]
        assert (measure.value, measure.uncertainty) == (before.value, before.uncertainty)
        assert measure.status == ("incomplete" if before.value is None else "uncertain")
        assert before.value is None or doubt in (measure.note or "")


def test_a_gap_makes_a_measure_incomplete() -> None:
    middle = foot().vertices[foot().faces].mean(axis=1)
    half = 0.5 * foot().measures["foot_length"]
    gap = (np.abs(middle[:, 0] - half) < 5) & (np.abs(middle[:, 1]) < 8) & (middle[:, 2] > 40)
    frame = FootFrame(foot().vertices, foot().faces[~gap], foot().vertices, np.eye(4), "toe2", 2 * half)
    landmarks = {name: Landmark(foot().landmarks[name], "geometric", 1.0) for name in KNOWN_LANDMARKS}
    measures = take_measures(frame, landmarks)
    assert (measures["instep_girth"].value, measures["instep_girth"].status) == (None, "incomplete")
    assert "a gap of 1" in (measures["instep_girth"].note or "")
    assert measures["foot_volume"].status == "incomplete"
    assert measures["ball_girth"].status == "ok"


def test_a_landmark_that_is_missing_is_named() -> None:
    frame = FootFrame(foot().vertices, foot().faces, foot().vertices, np.eye(4), "toe2", 262.0)
    landmarks = {"pternion": Landmark(foot().landmarks["pternion"], "geometric", 1.0)}
    measures = take_measures(frame, landmarks)
    assert measures["ball_girth"].note == "metatarsale tibiale was not found"
    assert measures["instep_girth"].value is not None


def test_a_landmark_set_by_hand_counts() -> None:
    point = foot().landmarks["metatarsale_tibiale"] - [5.0, 0.0, 0.0]
    result = measure_foot(foot().vertices, foot().faces, "right", manual={"metatarsale_tibiale": point})
    before = measured().measures["ball_length"].value or 0.0
    assert result.measures["ball_length"].value == pytest.approx(foot().measures["ball_length"] - 5.0, abs=0.05)
    assert before == pytest.approx(foot().measures["ball_length"], abs=0.3)
    exact, found = result.measures["ball_length"].uncertainty, measured().measures["ball_length"].uncertainty
    assert 0.0 < (exact or 0.0) < 0.2 * (found or 0.0)  # what is left is the end that it is taken from
    assert result.landmarks["metatarsale_tibiale"].method == "manual"
    assert result.landmarks["metatarsale_tibiale"].point == pytest.approx(point, abs=1e-3)


def test_what_the_glass_is_worth_to_a_print_measured_from_a_guessed_landmark_is_unknown() -> None:
    frame = FootFrame(foot().vertices, foot().faces, foot().vertices, np.eye(4), "toe2", 262.0)
    for method, is_known in (("manual", True), ("fallback", False)):
        landmarks = {name: Landmark(point, "geometric", 1.0) for name, point in foot().landmarks.items()}
        landmarks["metatarsale_tibiale"] = Landmark(foot().landmarks["metatarsale_tibiale"], method, 0.5)
        angle = take_measures(frame, landmarks, glass_sd_mm=0.3)["clarke_angle"]
        assert angle.value is not None
        assert (angle.uncertainty is not None) == is_known


def test_a_calibration_is_applied_and_told() -> None:
    calibrated = measure_foot(foot().vertices, foot().faces, "right", calibration={"heel_breadth": (1.5, 0.98)})
    plain, changed = measured().measures["heel_breadth"], calibrated.measures["heel_breadth"]
    assert changed.value == pytest.approx(1.5 + 0.98 * (plain.value or 0.0), abs=2e-3)
    assert changed.calibration == (1.5, 0.98)
    assert plain.calibration is None
    assert values(calibrated.measures).keys() == values(measured().measures).keys()


def test_the_document_reads_back() -> None:
    assert Measures.model_validate_json(measured().model_dump_json()) == measured()


def test_a_part_that_is_lifted_has_no_breadth_at_the_floor() -> None:
    """Where the surface does not reach down to the height at which they are taken; nothing else is lost."""
    vertices = foot().vertices.copy()
    x = vertices[:, 0] - vertices[:, 0].min()
    lifted = known_place(vertices + np.column_stack([np.zeros((len(x), 2)), 100.0 * (x < 0.6 * x.max())]))
    for name in ("heel_breadth", "midfoot_breadth", "heel_angle"):
        assert lifted[name].status == "incomplete"
        assert (lifted[name].note or "").startswith("the surface ")
    assert lifted["foot_length"].value == pytest.approx(foot().measures["foot_length"], abs=0.1)


@pytest.mark.parametrize("lift_mm", [10.0, 20.0, 25.0, 30.0, 45.0, 60.0])
def test_no_breadth_of_a_lifted_part_is_ok_and_wrong(lift_mm: float) -> None:
    vertices = foot().vertices.copy()
    x = vertices[:, 0] - vertices[:, 0].min()
    vertices[:, 2] += lift_mm * (x < 0.6 * x.max())
    lifted, flat = known_place(vertices), measured().measures
    for name in ("heel_breadth", "midfoot_breadth"):
        is_right = lifted[name].value == pytest.approx(flat[name].value, abs=0.5)
        assert is_right or lifted[name].status != "ok", (name, lifted[name])
    assert lift_mm > 10.0 or {lifted[name].status for name in ("heel_breadth", "midfoot_breadth")} == {"ok"}


def test_an_empty_mesh_is_a_finding() -> None:
    with pytest.raises(Finding):
        measure_foot(np.zeros((0, 3)), np.zeros((0, 3), np.int32), "right")


def test_a_real_foot() -> None:
    data = os.environ.get("FOOTSCAN_DATA")
    if not data:
        pytest.skip("FOOTSCAN_DATA is not set")
    vertices, faces = read_mesh(Path(data) / "find" / "template.obj")
    vertices = vertices * 1000 - np.array([0, 0, vertices[:, 2].min() * 1000])
    result = values(measure_foot(vertices, faces, "left").measures)
    # Toes and heel are the model's ends along X, and its axis is turned by less than 5 degrees from there.
    assert result["foot_length"] == pytest.approx(np.ptp(vertices[:, 0]), abs=2.0)
    # Ratios to the length within three standard deviations of ANSUR II.
    assert result["ball_length"] / result["foot_length"] == pytest.approx(0.740, abs=0.045)
    assert result["ball_girth"] / result["foot_length"] == pytest.approx(0.93, abs=0.126)
    assert result["heel_breadth"] / result["foot_length"] == pytest.approx(0.27, abs=0.06)


@pytest.mark.parametrize("height", [-2.0, 2.0])
def test_measures_are_taken_above_the_glass(height: float) -> None:
    moved = foot().vertices + np.array([0.0, 0.0, height])
    glass = GlassPlane(height_mm=height, below_foot_mm=height, largest_mm=2.0, corrected=True)
    measures = measure_foot(moved, foot().faces, "right", glass=glass)
    assert measures.doubts == []
    assert values(measures.measures) == pytest.approx(values(measured().measures), rel=1e-3, abs=2e-3)
    assert statuses(measures) == statuses(measured())
    above_zero = measure_foot(moved, foot().faces, "right").measures["instep_height"].value
    assert above_zero == pytest.approx((measured().measures["instep_height"].value or 0.0) + height, abs=0.2)


def test_glass_too_far_from_its_place_makes_measures_uncertain() -> None:
    moved = foot().vertices + np.array([0.0, 0.0, 3.4])
    glass = GlassPlane(height_mm=3.4, below_foot_mm=3.4, largest_mm=3.4, corrected=True)
    measures = measure_foot(moved, foot().faces, "right", glass=glass)
    assert measures.warnings == measures.doubts
    assert "ok" not in statuses(measures).values()
    assert values(measures.measures) == pytest.approx(values(measured().measures), rel=1e-3, abs=2e-3)
    for name in values(measures.measures):
        assert "the glass is up to 3.4 mm from where it was calibrated" in (measures.measures[name].note or "")


def test_a_landmark_at_the_border_of_its_window_passes_its_doubt_on() -> None:
    frame = FootFrame(foot().vertices, foot().faces, foot().vertices, np.eye(4), "toe2", foot().measures["foot_length"])
    landmarks = {name: Landmark(foot().landmarks[name], "geometric", 1.0) for name in KNOWN_LANDMARKS}
    landmarks["metatarsale_tibiale"] = landmarks["metatarsale_tibiale"]._replace(at_border=True)
    measures = take_measures(frame, landmarks)
    for name in ("ball_length", "foot_breadth", "ball_girth", "ball_angle"):
        assert measures[name].status == "uncertain", name
        assert "metatarsale tibiale at the border" in (measures[name].note or "")
    assert measures["lateral_ball_length"].status == measures["instep_girth"].status == "ok"


def test_a_value_that_is_hardly_known_is_uncertain() -> None:
    count = len(foot().vertices)
    for sd, breadth, girth in ((0.3, "ok", "ok"), (0.6, "ok", "uncertain"), (1.0, "uncertain", "uncertain")):
        errors = [ErrorField("cameras", np.full(count, sd), 60.0)]
        measures = measure_foot(foot().vertices, foot().faces, "right", errors=errors).measures
        assert measures["foot_breadth"].status == breadth, sd
        assert measures["instep_girth"].status == girth, sd
    assert "its standard deviation exceeds 1 mm" in (measures["foot_breadth"].note or "")


def test_each_measure_says_whose_definition_it_follows() -> None:
    measures = measure_foot(foot().vertices, foot().faces, "right").measures
    assert CONVENTIONS.keys() < measures.keys()
    conventions = {name: measure.convention for name, measure in measures.items()}
    assert conventions == {name: CONVENTIONS.get(name, OWN) for name in measures}
    iso = {name: one.iso for name, one in CONVENTIONS.items() if one.iso is not None}
    assert iso == {
        "foot_length": "ISO 7250-1, ISO 20685-1: foot length",
        "foot_breadth": "ISO 9407: foot width",
        "foot_breadth_max": "ISO 7250-1, ISO 20685-1: foot breadth",
    }
    assert all(CONVENTIONS[name].iso_differs for name in iso)

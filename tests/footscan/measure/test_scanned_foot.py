"""Measures of a scanned foot: what was not seen is not reported as good."""

import numpy as np
import pytest

from footscan.cloud.lasers.apart import UNKNOWN
from footscan.cloud.points import make_points
from footscan.measure.scanned_foot import measure_scanned_foot
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from footscan.surface.errors.ends import confirmed_ends
from footscan.surface.errors.evidence import Evidence
from footscan.surface.errors.field import ErrorField
from footscan.surface.errors.scan_errors import scan_errors
from footscan.virtual.foot.foot import make_foot
from schemas.fusion import Disagreement, FusionReport, PairDisagreement
from schemas.glass import GlassPlane
from schemas.movement import MovementReport


@pytest.fixture(scope="module")
def foot() -> Mesh:
    made = make_foot(resolution_mm=2.0)
    return Mesh(made.vertices, made.faces)


@pytest.fixture(autouse=True)
def few_replicates(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is tested here does not need the standard deviations to the last digit."""
    monkeypatch.setattr("footscan.measure.scanned_foot.REPLICATES", 6)


def with_filled(foot: Mesh, share: float) -> Mesh:
    """The foot with this share of its sole filled, from the heel on."""
    down = (vertex_normals(foot.vertices, foot.faces)[:, 2] < -0.7) & (foot.vertices[:, 2] < 20.0)
    x = foot.vertices[:, 0]
    return Mesh(foot.vertices, foot.faces, filled=down & (x <= np.quantile(x[down], share)))


STILL = MovementReport(sway_mm=0.07, sway_by_axis_mm=(0.05, 0.05))
"""Of a foot that heads saw standing still."""


def apart_by(mm: float) -> Evidence:
    """Two cameras that disagree by `mm`."""
    apart = Disagreement(median_mm=0.0, deviation_mm=mm, rms_mm=mm + 0.03, systematic_mm=mm)
    return Evidence(
        agreement=FusionReport(pairs=[PairDisagreement(cameras=(1, 2), points=1000, before=apart, after=apart)]),
        movement=STILL,
    )


def alone_up_to(foot: Mesh, mm: float) -> np.ndarray:
    """The cloud of a foot of whose heel one camera alone saw the first millimetres."""
    cloud = make_points(foot.vertices, camera=1)
    cloud["cameras"] = np.where(foot.vertices[:, 0] < foot.vertices[:, 0].min() + mm, 1, 2)
    return cloud


def test_a_foot_whose_sole_was_not_seen_has_no_good_measure(foot: Mesh) -> None:
    measures = measure_scanned_foot(with_filled(foot, 1.0), "right", GlassPlane()).measures
    assert "ok" not in {measure.status for measure in measures.values()}
    assert "100 % of the sole was filled, not measured" in (measures["foot_length"].note or "")


def test_a_foot_whose_sole_was_seen_has_good_measures(foot: Mesh) -> None:
    seen = measure_scanned_foot(with_filled(foot, 0.1), "right", GlassPlane()).measures
    assert seen["foot_length"].status == seen["instep_height"].status == "ok"
    assert measure_scanned_foot(foot, "right", GlassPlane()).measures["arch_index"].status == "ok"


def test_a_reason_that_all_measures_share_is_no_note_of_one(foot: Mesh) -> None:
    measures = measure_scanned_foot(foot, "right", GlassPlane(), ["camera 3 has moved"])
    assert "camera 3 has moved" in (measures.measures["foot_length"].note or "")
    assert {"camera 3 has moved"} == set(measures.doubts)
    assert "camera 3" not in " ".join(filter(None, map(measures.own_note, measures.measures)))


def test_cameras_that_disagree_widen_every_measure(foot: Mesh) -> None:
    agreeing, apart = (
        measure_scanned_foot(foot, "right", GlassPlane(), evidence=apart_by(mm)).measures for mm in (0.0, 0.3)
    )
    for name in ("foot_length", "foot_breadth", "ball_girth", "heel_breadth"):
        assert (apart[name].uncertainty or 0.0) > 2 * (agreeing[name].uncertainty or np.inf)
        assert (apart[name].budget or {})["cameras"] > 0.05
        assert "cameras" not in (agreeing[name].budget or {"cameras": 0.0})


def test_skin_that_one_camera_alone_saw_is_worth_less_where_cameras_err_grossly(foot: Mesh) -> None:
    cloud = make_points(foot.vertices, camera=1)
    alone = np.abs(foot.vertices[:, 0] - 120.0) < 30.0
    cloud["cameras"], cloud["sigma"] = np.where(alone, 1, 2), 0.03
    apart = Disagreement(median_mm=0.0, deviation_mm=0.03, rms_mm=0.1)
    pairs = [PairDisagreement(cameras=(1, 2), points=1000, before=apart, after=apart)]
    deviations = scan_errors(foot, Evidence(cloud, FusionReport(pairs=pairs), movement=STILL)).deviations
    usual = scan_errors(foot, Evidence(cloud, FusionReport(), movement=STILL)).deviations
    assert np.median(deviations[alone]) > 2.0 * np.median(usual[alone])
    np.testing.assert_allclose(np.median(deviations[~alone] - usual[~alone]), 0.0, atol=1e-9)


def test_the_causes_of_an_uncertainty_make_it_up(foot: Mesh) -> None:
    measures = measure_scanned_foot(with_filled(foot, 0.1), "right", GlassPlane(), evidence=apart_by(0.1)).measures
    for name, measure in measures.items():
        if measure.budget is not None and measure.unit == "mm":
            assert measure.uncertainty == pytest.approx(np.hypot.reduce([*measure.budget.values()]), abs=2e-3), name
    assert "filling" in (measures["heel_girth"].budget or {})


def test_an_end_that_one_camera_alone_saw_makes_the_length_uncertain(foot: Mesh) -> None:
    alone = measure_scanned_foot(foot, "right", GlassPlane(), evidence=Evidence(alone_up_to(foot, 2.6))).measures
    assert alone["foot_length"].status == "uncertain"
    assert "one camera alone" in (alone["foot_length"].note or "")
    assert alone["foot_breadth"].status == "ok"
    assert (alone["foot_length"].uncertainty or 0.0) > 0.5
    assert (alone["foot_length"].budget or {})["ends"] > 0.5
    slightly = measure_scanned_foot(foot, "right", GlassPlane(), evidence=Evidence(alone_up_to(foot, 0.2))).measures
    assert slightly["foot_length"].status == "ok"


def test_an_end_beyond_which_stripes_were_dropped_makes_the_length_uncertain(foot: Mesh) -> None:
    x = foot.vertices[:, 0]
    cloud = make_points(foot.vertices, camera=1)
    cloud["cameras"] = 2
    for beyond_mm, status in ((0.0, "ok"), (4.0, "uncertain")):
        evidence = Evidence(cloud, contested_mm=(float(x.min()) - beyond_mm, float(x.max())))
        length = measure_scanned_foot(foot, "right", GlassPlane(), evidence=evidence).measures["foot_length"]
        assert length.status == status
        assert ((length.uncertainty or 0.0) > 1.5) == (beyond_mm > 0.0)


def test_a_doubtful_tip_widens_the_length(foot: Mesh) -> None:
    cloud = make_points(foot.vertices, camera=1)
    cloud["cameras"] = 2
    evidence = Evidence(cloud, tip_doubts_mm=(0.4, 0.3))
    measures = measure_scanned_foot(foot, "right", GlassPlane(), evidence=evidence).measures
    assert 0.4 < (measures["foot_length"].budget or {})["ends"] < 0.6
    assert (measures["foot_breadth"].budget or {}).get("ends", 0.0) < 0.05


def test_an_end_that_falls_short_of_the_outermost_stripe_is_worth_less(foot: Mesh) -> None:
    cloud = make_points(foot.vertices, camera=1)
    cloud["cameras"] = 2
    cloud["x"][np.argsort(cloud["x"])[:10]] -= 0.4
    length = measure_scanned_foot(foot, "right", GlassPlane(), evidence=Evidence(cloud)).measures["foot_length"]
    assert 0.5 < (length.budget or {})["ends"] < 1.0


def test_a_cloud_of_the_leg_alone_says_nothing_of_the_ends(foot: Mesh) -> None:
    leg = make_points(foot.vertices[foot.vertices[:, 2] > 80.0], camera=1)
    assert np.isfinite(scan_errors(foot, Evidence(leg)).deviations).all()


@pytest.mark.parametrize(("apart_mm", "widens"), [(0.0, False), (1.5, True), (3.5, False)])
def test_lasers_so_close_that_their_stripes_are_one_widen_the_heights(
    foot: Mesh, apart_mm: float, widens: bool
) -> None:
    cloud = make_points(foot.vertices, camera=1 + np.arange(len(foot.vertices)) % 2)
    lasers = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [2.0, apart_mm, 0.0, 0.0, 0.0, 0.0]])
    wider = []
    for cameras in (1, 2):
        cloud["cameras"] = cameras
        evidence = Evidence(cloud, FusionReport(heads={1: 1, 2: 2}), movement=STILL, lasers=lasers)
        deviations = scan_errors(foot, evidence).deviations
        usual = scan_errors(foot, evidence._replace(lasers=UNKNOWN)).deviations
        assert widens or deviations == pytest.approx(usual)
        wider.append(np.median(deviations / usual))
    assert wider[0] > 2.0 * wider[1] > 3.0 if widens else wider == [1.0, 1.0]  # less where two cameras agree
    facing = np.abs(vertex_normals(foot.vertices, foot.faces)[:, 0])
    for beside_mm, is_parted in ((apart_mm, facing < 1.0), (5.0, facing > 0.9), (9.0, facing > 1.0)):
        beside = np.full(len(cloud), beside_mm, np.float32)
        with_second = scan_errors(foot, evidence._replace(seen=cloud, parted_mm=beside)).deviations
        assert with_second[is_parted] == pytest.approx(usual[is_parted])
        flat = ~is_parted & (facing < 0.5)  # skin that faces the travel parts stripes by more
        assert with_second[flat] == pytest.approx(deviations[flat])


def test_heads_that_jitter_widen_what_rests_on_x(foot: Mesh) -> None:
    parts = []
    for tremor_mm in (0.03, 0.08):
        evidence = Evidence(movement=MovementReport(tremor_mm=tremor_mm))
        measures = measure_scanned_foot(foot, "right", GlassPlane(), evidence=evidence).measures
        parts.append([(measures[name].budget or {}).get("tremor", 0.0) for name in ("foot_length", "foot_breadth")])
    assert parts[1][0] > max(4.0 * parts[0][0], 0.1)
    assert parts[1][1] < 0.05


def slope_of(sway: ErrorField) -> float:
    """Slope along the travel, per mm, root mean square, of movements with a standard deviation of 1."""
    x = np.arange(0.0, 400.0, 0.1)
    movements = sway._replace(along_mm=x).shares(np.zeros((len(x), 3)))
    assert movements is not None
    movements = movements.toarray()
    return float(np.sqrt(np.mean(np.sum((np.diff(movements, axis=0) / 0.1) ** 2, axis=1))))


def test_a_foot_sways_as_fast_as_people_do(foot: Mesh) -> None:
    sway = next(field for field in scan_errors(foot, Evidence()).fields if field.cause == "sway")
    hertz, frames_per_second, step_mm = np.linspace(0.2, 1.0, 81), 18.0, 2.0
    expected = 2.0 * np.pi * np.sqrt(np.mean(hertz**2)) / frames_per_second / step_mm
    assert slope_of(sway) == pytest.approx(expected, rel=0.1)


def test_what_is_left_of_a_sway_drifts_as_slowly_as_the_report_says(foot: Mesh) -> None:
    movement = STILL.model_copy(update={"left_y_mm": [0.1] * 300, "left_y_frames": 12.0})
    along_x, along_y = (
        field for field in scan_errors(foot, Evidence(movement=movement)).fields if field.cause == "sway"
    )
    assert slope_of(along_y) == pytest.approx(4.5 / 12.0 * slope_of(along_x), rel=0.1)


def test_a_sway_moves_what_one_head_saw_against_what_another_saw(foot: Mesh) -> None:
    parts = []
    for later in (0, 4):
        is_medial = foot.vertices[:, 1] > 0.0
        frames = np.round(foot.vertices[:, 0] / 2.0).astype(np.int32) + np.where(is_medial, later, 0)
        cloud = make_points(foot.vertices, camera=np.where(is_medial, 1, 2), frame=frames + 100)
        evidence = Evidence(cloud=cloud, movement=MovementReport(sway_mm=0.1, sway_by_axis_mm=(0.07, 0.07)))
        measures = measure_scanned_foot(foot, "right", GlassPlane(), evidence=evidence).measures
        parts.append([(measures[name].budget or {})["sway"] for name in ("waist_girth", "instep_girth")])
    assert np.all(np.array(parts[1]) > 2.0 * np.array(parts[0]))


def test_a_sway_that_no_heads_show_counts_more_than_a_small_one(foot: Mesh) -> None:
    seen, *unseen = (
        measure_scanned_foot(foot, "right", GlassPlane(), evidence=Evidence(movement=movement)).measures
        for movement in (STILL, MovementReport(), None)
    )
    for measures in unseen:
        for name in ("foot_length", "foot_breadth"):
            assert (measures[name].budget or {})["sway"] > 1.3 * (seen[name].budget or {})["sway"]


def test_a_landmark_set_by_hand_has_no_part_in_the_uncertainty(foot: Mesh) -> None:
    found = measure_scanned_foot(foot, "right", GlassPlane())
    by_hand = {"metatarsale_tibiale": np.array(found.landmarks["metatarsale_tibiale"].point)}
    measures = measure_scanned_foot(foot, "right", GlassPlane(), manual=by_hand).measures
    assert (measures["ball_length"].uncertainty or np.inf) < 0.5 * (found.measures["ball_length"].uncertainty or 0.0)
    assert (measures["clarke_angle"].budget or {})["glass"] > 0.0


def test_heights_are_worth_less_where_the_glass_was_not_seen(foot: Mesh) -> None:
    seen = GlassPlane(below_foot_sd_mm=0.02, tilt_x_sd_deg=0.01, tilt_y_sd_deg=0.01)
    for glass, least, most in ((seen, 0.02, 0.03), (GlassPlane(), 0.5, 1.0)):
        measures = measure_scanned_foot(foot, "right", glass).measures
        assert least < (measures["instep_height"].budget or {})["glass"] < most
        assert "glass" not in (measures["foot_length"].budget or {"glass": 0.0})


def test_the_ends_that_cameras_confirm() -> None:
    x = np.arange(100.0)
    cloud = make_points(np.column_stack([x, x * 0, x * 0]), camera=1)
    cloud["cameras"] = np.where(x < 20.0, 1, 2)
    assert confirmed_ends(cloud) == (24.0, 95.0)
    cloud["cameras"] = 1
    assert confirmed_ends(cloud) is None


def test_a_vertex_is_less_sure_far_from_what_was_seen(foot: Mesh) -> None:
    half = with_filled(foot, 0.5)
    sure, apart = (scan_errors(half, apart_by(mm)).deviations for mm in (0.03, 0.2))
    assert half.filled is not None
    assert np.median(sure[half.filled]) > 2 * np.median(sure[~half.filled])
    assert (apart > sure).all()


def test_the_cap_of_a_heel_is_less_than_a_step_high_even_if_the_first_stripe_touched_the_foot_beside_it(
    foot: Mesh,
) -> None:
    heel = foot.vertices[np.argmin(foot.vertices[:, 0])]
    is_cap = np.linalg.norm(foot.vertices - heel, axis=1) < 9.0
    beside = np.tile(heel + np.array([0.05, 30.0, 0.0]), (9, 1))
    cloud = make_points(np.concatenate([beside, foot.vertices[~is_cap]]), camera=1)
    cloud["cameras"] = 2
    cap = Mesh(foot.vertices, foot.faces, filled=is_cap)
    length = measure_scanned_foot(cap, "right", GlassPlane(), evidence=Evidence(cloud)).measures["foot_length"]
    assert length.status == "ok"
    assert length.budget is not None
    assert length.budget["ends"] > 0.05
    assert length.budget.get("filling", 0.0) < 0.05


def test_several_cameras_that_deviate_put_all_measures_in_doubt(foot: Mesh) -> None:
    statuses = []
    for distrusted in ([3], [3, 4]):
        evidence = Evidence(agreement=FusionReport(distrusted=distrusted))
        measures = measure_scanned_foot(foot, "right", GlassPlane(), evidence=evidence).measures
        statuses.append({measures[name].status for name in ("foot_length", "foot_breadth", "ball_girth")})
    assert statuses == [{"ok"}, {"uncertain"}]

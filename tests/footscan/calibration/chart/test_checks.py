"""Mistakes in a chart: each kind is told and named, and charts without any are left in peace."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.checks import CERTAIN, ChartWarning, check_charts, refuse_mistakes
from footscan.calibration.chart.plane_fit import fit_homographies, project
from footscan.thesis.printed import printed_charts
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.stage.reference import standard_reference
from schemas.base.errors import RefusedInput

THESIS = printed_charts()
Spoil = Callable[[Chart], Chart]


def virtual_charts(seed: int, points: int | None = None) -> dict[int, Chart]:
    """Corners of the reference object within each picture, clicked to half a pixel; some of them, or all."""
    reference = standard_reference()
    profile = np.asarray(reference.profile_mm)
    corners = np.unique(np.concatenate([profile + np.asarray(place) for place in reference.placements_mm]), axis=0)
    random = np.random.default_rng(seed)
    charts = {}
    for camera in standard_scanner(seed).cameras:
        exact = camera.project_plane(corners[:, 0], corners[:, 1])
        clicked = np.round(2 * (exact + random.normal(0, 0.3, exact.shape))) / 2
        inside = np.flatnonzero(((clicked >= 1) & (clicked <= [638, 478])).all(axis=1))
        chosen = inside if points is None else np.sort(random.choice(inside, points, replace=False))
        names = tuple(f"P{k}" for k in range(1, len(chosen) + 1))
        world = np.column_stack([np.zeros(len(chosen)), corners[chosen]])
        charts[camera.id] = Chart(camera.id, names, world, "mm", clicked[chosen])
    return charts


VIRTUAL = {camera: chart for camera, chart in virtual_charts(1, points=40).items() if camera < 7}


def with_world(chart: Chart, point: int, column: int, value: float) -> Chart:
    world = chart.world.copy()
    world[point, column] = value
    return replace(chart, world=world)


def with_pixel(chart: Chart, point: int, column: int, value: float) -> Chart:
    pixels = chart.pixels.copy()
    pixels[point, column] = value
    return replace(chart, pixels=pixels)


def keys_of(warnings: list[ChartWarning]) -> set[tuple[int, str | None, str]]:
    return {(warning.camera, warning.point, warning.kind) for warning in warnings}


UNCHANGED = [(charts, keys_of(check_charts(charts))) for charts in (THESIS, VIRTUAL)]


def spoilt(charts: dict[int, Chart], camera: int, spoil: Spoil) -> list[ChartWarning]:
    """The warnings for a camera beyond those for the unchanged charts."""
    known = [keys for unchanged, keys in UNCHANGED if unchanged is charts]
    before = known[0] if known else keys_of(check_charts(charts))
    warnings = check_charts({**charts, camera: spoil(charts[camera])})
    findings = [warning for warning in warnings if not keys_of([warning]) <= before]
    assert {warning.camera for warning in findings} <= {camera}
    return findings


def test_the_chart_of_the_thesis() -> None:
    warnings = check_charts(THESIS)
    findings = [(warning.camera, warning.point, warning.kind) for warning in warnings]
    assert findings == [(5, None, "residual"), (5, "P5", "border"), (8, "P1", "border")]
    assert "residual 4.9 px rms" in warnings[0].message
    assert "worst P3 by 9.0 px" in warnings[0].message
    assert "1.2 px is usual for the other cameras" in warnings[0].message
    assert "i = 640" in warnings[1].message
    refuse_mistakes(warnings, "chart.csv")


@pytest.mark.parametrize("seed", range(1, 5))
def test_clean_charts_are_left_in_peace(seed: int) -> None:
    assert check_charts(virtual_charts(seed)) == []
    assert check_charts(virtual_charts(seed, points=12)) == []
    assert [warning for warning in check_charts(virtual_charts(seed, points=8)) if warning.kind != "line"] == []
    assert [warning for warning in check_charts(virtual_charts(seed, points=5)) if warning.kind != "line"] == []


def swap_pixels(chart: Chart) -> Chart:
    return replace(chart, pixels=chart.pixels[:, ::-1].copy())


def swap_world(chart: Chart) -> Chart:
    return replace(chart, world=chart.world[:, [0, 2, 1]].copy())


def exchange(chart: Chart) -> Chart:
    world = np.column_stack([chart.world[:, 0], chart.pixels])
    return replace(chart, world=world, pixels=chart.world[:, 1:].copy())


@pytest.mark.parametrize("charts", [THESIS, VIRTUAL], ids=["thesis", "virtual"])
@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (swap_pixels, "i and j are swapped"),
        (swap_world, "y and z are swapped"),
        (lambda chart: swap_world(swap_pixels(chart)), "i and j are swapped; z reaches"),
        (exchange, "y, z and i, j are swapped"),
        (lambda chart: replace(chart, world=chart.world[:, [1, 0, 2]].copy()), "x_"),
    ],
    ids=["i,j", "y,z", "both", "world and pixels", "x,y"],
)
def test_swapped_columns_are_certain(charts: dict[int, Chart], spoil: Spoil, said: str) -> None:
    for camera, chart in charts.items():
        warnings = check_charts({**charts, camera: spoil(chart)})
        [warning] = [warning for warning in warnings if warning.kind == "swapped"]
        assert (warning.camera, warning.point) == (camera, None)
        assert said in warning.message
    everywhere = check_charts({camera: spoil(chart) for camera, chart in charts.items()})
    assert [warning.camera for warning in everywhere if warning.kind == "swapped"] == list(charts)


@pytest.mark.parametrize("charts", [THESIS, VIRTUAL], ids=["thesis", "virtual"])
@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_another_unit_than_the_headers(charts: dict[int, Chart], factor: float) -> None:
    def scaled(chart: Chart) -> Chart:
        return replace(chart, world=factor * chart.world)

    for camera in charts:
        [warning] = spoilt(charts, camera, scaled)
        assert (warning.kind, warning.point) == ("unit", None)
        assert "another unit" in warning.message
    everywhere = check_charts({camera: scaled(chart) for camera, chart in charts.items()})
    assert [warning.kind for warning in everywhere] == ["unit"] * len(charts)


@pytest.mark.parametrize("rows", [[3, 7], [0, 1, 2, 3, 4, 5, 20, 21, 22], list(range(18))])
def test_rows_in_another_unit(rows: list[int]) -> None:
    def some_in_cm(chart: Chart) -> Chart:
        world = chart.world.copy()
        world[rows] /= 10
        return replace(chart, world=world)

    for camera in (1, 6):
        [warning] = spoilt(VIRTUAL, camera, some_in_cm)
        assert (warning.kind, warning.point) == ("unit", None)
        assert warning.message.startswith("ten times their y and z would fit")
        named = {name.strip() for name in warning.message.split(":")[1].split(",")}
        chart = VIRTUAL[camera]
        assert named <= {chart.points[row] for row in rows}
        assert len(named) >= min(10, sum(np.abs(chart.world[row]).max() > 40 for row in rows))


def test_rows_in_another_unit_of_five() -> None:
    def two_in_mm(chart: Chart) -> Chart:
        world = chart.world.copy()
        world[[1, 3]] *= 10
        return replace(chart, world=world)

    [warning] = spoilt(THESIS, 1, two_in_mm)
    assert (warning.kind, warning.point) == ("unit", None)
    assert warning.message == "a tenth of their y and z would fit with the other points, expected one unit: P2, P4"


def test_a_wrong_coordinate_is_told_with_its_point_and_the_right_one() -> None:
    """The thesis's camera 3 sees P2 at (-5, 7) cm."""
    for column, value, right in ((1, 5.0, "y_cm = -5"), (2, 0.7, "z_cm = 7"), (1, -50.0, "y_cm = -5")):
        [warning] = spoilt(THESIS, 3, lambda chart, c=column, v=value: with_world(chart, 1, c, v))
        assert (warning.kind, warning.point) == ("mistyped", "P2")
        assert f"{right} would fit, found {value:g}" in warning.message


def test_a_coordinate_of_another_corner_among_many_points() -> None:
    chart = VIRTUAL[2]
    for point in (4, 17, 30):
        right = chart.world[point, 2]
        wrong = 30.0 if right != 30.0 else 70.0
        [warning] = spoilt(VIRTUAL, 2, lambda chart, p=point, w=wrong: with_world(chart, p, 2, w))
        assert (warning.kind, warning.point) == ("mistyped", chart.points[point])
        assert f"z_mm = {right:g} would fit, found {wrong:g}" in warning.message


def test_a_mistyped_pixel_is_told_with_its_place() -> None:
    chart = VIRTUAL[4]
    i, j = chart.pixels[9]
    [warning] = spoilt(VIRTUAL, 4, lambda chart: with_pixel(chart, 9, 0, i + 37))
    assert (warning.kind, warning.point) == ("mistyped", "P10")
    off = float(warning.message.split(" px off where the other points place it")[0])
    assert off == pytest.approx(37, abs=2)
    [swapped] = spoilt(VIRTUAL, 4, lambda chart: with_pixel(with_pixel(chart, 9, 0, j), 9, 1, i))
    assert "it fits with i and j swapped" in swapped.message


def test_a_point_outside_of_the_image_is_certain() -> None:
    i = VIRTUAL[3].pixels[5, 0]
    [warning] = spoilt(VIRTUAL, 3, lambda chart: with_pixel(chart, 5, 0, 10 * i))
    assert (warning.kind, warning.point) == ("outside", "P6")
    assert "expected 0 to 639 and 0 to 479" in warning.message
    assert f"i = {i:g} would fit" in warning.message
    with pytest.raises(RefusedInput, match=r"^chart.csv: camera 3, point P6: i = .* lies outside of the image"):
        refuse_mistakes([warning], "chart.csv")


def test_the_border_counts_from_0_or_from_1() -> None:
    five = {1: THESIS[1], 2: THESIS[2], 3: THESIS[3]}
    for j, kind in ((480.0, "border"), (479.0, "border"), (483.0, "outside")):
        pixels = THESIS[1].pixels + np.array([0.0, j - 255.0])
        warnings = check_charts({**five, 1: replace(THESIS[1], pixels=pixels)})
        assert [(warning.kind, warning.point) for warning in warnings] == [(kind, "P5")]
    on_border = {1: replace(THESIS[1], pixels=THESIS[1].pixels + np.array([640.0 - 591.0, 0.0]))}
    assert [(warning.kind, warning.point) for warning in check_charts(on_border)] == [("border", "P5")]


def test_one_corner_at_two_pixels_and_two_corners_at_one() -> None:
    four = replace(THESIS[1], points=("a", "b", "c", "d"), world=THESIS[1].world[:4], pixels=THESIS[1].pixels[:4])
    twice = Chart(
        1, (*four.points, "e"), np.vstack([four.world, four.world[3]]), "cm",
        np.vstack([four.pixels, four.pixels[3] + [0.0, 12.0]]),
    )  # fmt: skip
    [warning] = check_charts({1: twice})
    assert (warning.kind, warning.point) == ("twice", "e")
    assert "is where d is, but seen 12.0 px away" in warning.message
    pixels = np.vstack([four.pixels, four.pixels[3]])
    copied = replace(THESIS[1], pixels=pixels)
    assert {warning.kind for warning in check_charts({1: copied})} & {"twice", "mistyped", "residual"}


def test_points_on_one_line() -> None:
    world = np.column_stack([np.zeros(6), np.linspace(-50, 50, 6), np.linspace(10, 90, 6)])
    pixels = np.column_stack([np.linspace(100, 500, 6), np.linspace(120, 320, 6) + np.array([0, 1, 0, -1, 0, 1])])
    [warning] = check_charts({1: Chart(1, tuple("abcdef"), world, "mm", pixels)})
    assert warning.kind == "line"


@pytest.mark.parametrize("charts", [THESIS, VIRTUAL], ids=["thesis", "virtual"])
def test_a_sign_of_a_whole_column(charts: dict[int, Chart]) -> None:
    [mirrored] = spoilt(charts, 4, lambda chart: replace(chart, world=chart.world * [1, -1, 1]))
    assert mirrored.kind == "mirrored"
    below = spoilt(charts, 4, lambda chart: replace(chart, world=chart.world * [1, 1, -1]))
    assert "below" in {warning.kind for warning in below}


def test_one_point_at_another_x() -> None:
    [warning] = spoilt(THESIS, 2, lambda chart: with_world(chart, 3, 0, 1.0))
    assert (warning.kind, warning.point) == ("plane", "P4")


def test_the_order_of_points_changes_nothing() -> None:
    chart = with_world(VIRTUAL[5], 8, 1, 3.0)
    order = np.random.default_rng(2).permutation(len(chart.points))
    shuffled = Chart(5, tuple(chart.points[k] for k in order), chart.world[order], "mm", chart.pixels[order])
    both = [check_charts({**VIRTUAL, 5: variant}) for variant in (chart, shuffled)]
    there, here = ([(warning.point, warning.kind) for warning in warnings] for warnings in both)
    assert there == here != []
    assert check_charts({**VIRTUAL, 5: chart}) == both[0]


def test_only_what_is_certain_is_refused() -> None:
    for kind in ("mistyped", "residual", "border", "twice", "line", "mirrored", "below", "plane"):
        assert kind not in CERTAIN
        refuse_mistakes([ChartWarning(1, None, kind, "x")], "chart.csv")
    with pytest.raises(RefusedInput, match=r"^chart.csv: camera 1: y \(and 1 more mistakes\)$"):
        refuse_mistakes([ChartWarning(1, None, "unit", "y"), ChartWarning(2, None, "swapped", "z")], "chart.csv")


def test_exact_points_give_their_homography() -> None:
    truth = np.array([[2.1, -1.4, 300.0], [0.3, -2.2, 350.0], [1e-3, 5e-4, 1.0]])
    world = np.random.default_rng(3).uniform([-60, 0], [60, 110], (1, 6, 2))
    found = fit_homographies(world, project(truth[np.newaxis], world))[0]
    np.testing.assert_allclose(found / found[2, 2], truth, rtol=1e-3, atol=1e-5)


numbers = st.sampled_from([0.0, -1.0, 1e-9, 639.0, 1e6, -1e6, 70.0, 240.5])


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.tuples(numbers, numbers, numbers, numbers, numbers), min_size=1, max_size=9),
    unit=st.sampled_from(["cm", "mm"]),
)
def test_any_chart_is_checked(rows: list[tuple[float, ...]], unit: str) -> None:
    values = np.array(rows)
    names = tuple(f"P{k}" for k in range(len(rows)))
    chart = Chart(1, names, values[:, :3], unit, values[:, 3:])
    for warning in check_charts({1: chart, 2: replace(THESIS[2], camera=2)}):
        assert str(warning).isprintable()

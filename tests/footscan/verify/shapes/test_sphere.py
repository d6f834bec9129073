import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from footscan.mesh.sampling import sample_surface
from footscan.verify.shapes.sphere import find_spheres, fit_sphere
from footscan.virtual.foot.foot import make_foot
from schemas.base.errors import Finding

Floats = NDArray[np.float64]


def striped(radius: float, centre: tuple[float, float, float], noise: float = 0.0, seed: int = 1) -> Floats:
    """Circles where the planes X = 0, 2, 4 ... mm cut a sphere, points 0.5 mm apart, with noise along the radius."""
    rings = []
    for x in np.arange(2 * np.ceil((centre[0] - radius) / 2), centre[0] + radius, 2.0) - centre[0]:
        ring = np.sqrt(radius**2 - x**2)
        turn = 2 * np.pi * np.arange(int(4 * np.pi * ring)) / max(1, int(4 * np.pi * ring))
        rings.append(np.column_stack([np.full(len(turn), x), ring * np.cos(turn), ring * np.sin(turn)]))
    points = np.concatenate(rings)
    stretch = 1 + np.random.default_rng(seed).normal(0, noise, (len(points), 1)) / radius
    return points * stretch + centre


def test_a_perfect_sphere_a_little_too_large() -> None:
    fit = fit_sphere(striped(20.1, (50, -10, 30)), 40.0)
    assert fit.centre_mm == pytest.approx((50, -10, 30), abs=1e-9)
    assert fit.diameter_mm == pytest.approx(40.2, abs=1e-9)
    assert fit.diameter_error_mm == pytest.approx(0.2, abs=1e-9)
    assert max(fit.radial_sd_mm, fit.radial_range_mm, fit.diameter_uncertainty_mm) < 1e-9
    # About the middle of a whole sphere all points are 0.1 mm outside of the nominal one.
    assert fit.fixed_centre_mm == pytest.approx((50, -10, 30), abs=1e-9)
    assert (fit.fixed_rms_mm, fit.fixed_mean_mm) == pytest.approx((0.1, 0.1), abs=1e-9)
    assert fit.fixed_range95_mm < 1e-9
    assert (fit.points, fit.outliers) == (len(striped(20.1, (50, -10, 30))), 0)
    assert fit.covered > 0.95  # but for the poles, beyond the first and the last stripe


def test_noise_by_its_standard_deviation() -> None:
    fit = fit_sphere(striped(60.0, (80, 0, 60), noise=0.1), 120.0)
    # Of a normal distribution 95 % lie within ±1.96 standard deviations.
    assert fit.radial_sd_mm == pytest.approx(0.1, rel=0.02)
    assert fit.radial_range95_mm == pytest.approx(0.392, rel=0.03)
    assert fit.fixed_rms_mm == pytest.approx(0.1, rel=0.02)
    # Twice 0.1 / sqrt(N), were all points independent and nothing else fitted.
    assert fit.diameter_uncertainty_mm == pytest.approx(0.2 / np.sqrt(fit.points), rel=0.25)
    assert abs(fit.diameter_error_mm) < 4 * fit.diameter_uncertainty_mm


@pytest.mark.parametrize("seed", range(2))
def test_a_cap_is_less_certain_than_a_sphere(seed: int) -> None:
    points = striped(20.0, (30, 0, 20), noise=0.1, seed=seed)
    whole, cap = fit_sphere(points, 40.0), fit_sphere(points[points[:, 2] > 22], 40.0)
    assert cap.covered == pytest.approx(0.45, abs=0.05)
    assert cap.diameter_uncertainty_mm > 2 * whole.diameter_uncertainty_mm
    assert abs(cap.diameter_error_mm) < 4 * cap.diameter_uncertainty_mm


def test_outliers_and_clutter() -> None:
    random = np.random.default_rng(3)
    ball = striped(20.0, (40, 10, 25), noise=0.05)
    stray = random.uniform([0, -30, 0], [80, 50, 60], (len(ball) // 4, 3))
    floor = np.column_stack([random.uniform([0, -30], [80, 50], (4000, 2)), np.zeros(4000)])
    fit = fit_sphere(np.concatenate([ball, stray, floor]), 40.0)
    assert fit.centre_mm == pytest.approx((40, 10, 25), abs=0.01)
    assert fit.diameter_error_mm == pytest.approx(0, abs=0.02)
    assert fit.radial_sd_mm == pytest.approx(0.05, rel=0.1)
    assert fit.outliers > 0


def test_several_spheres_in_one_cloud() -> None:
    centres = [(30.3, -40.0, 20.0), (110.0, 35.0, 20.0), (190.2, 0.0, 85.0)]
    parts = [striped(20.0 + k / 20, centre, noise=0.02) for k, centre in enumerate(centres)]
    parts[0] = parts[0][parts[0][:, 2] > 12]
    found = find_spheres(np.concatenate([*parts, striped(35.0, (110, -50, 60))]), 40.0)  # and one of another size
    assert [fit.points for fit in found] == sorted((len(part) for part in parts), reverse=True)
    errors = {round(fit.centre_mm[0]): fit.diameter_error_mm for fit in found}
    assert errors == pytest.approx({30: 0.0, 110: 0.1, 190: 0.2}, abs=0.01)


def test_an_oval_shows_in_the_spread_and_not_in_the_diameter() -> None:
    # Stretched by 1 % along Z, squeezed by half as much along X and Y: the mean radius stays, to first order. A radius
    # changes by 0.2 (3 cos² - 1) / 2, which over the sphere has the variance 0.2² / 5.
    even = trimesh.creation.icosphere(subdivisions=5, radius=20.0).vertices
    fit = fit_sphere(even * [0.995, 0.995, 1.01], 40.0)
    assert fit.diameter_error_mm == pytest.approx(0, abs=0.01)
    assert fit.radial_sd_mm == pytest.approx(0.2 / np.sqrt(5), rel=0.05)
    assert fit.radial_range_mm == pytest.approx(0.3, rel=0.05)  # from -0.1 to 0.2


def test_a_sphere_of_about_another_size_is_none() -> None:
    # 8 % too large: the rough search takes such a one into view, and must go on from there.
    with pytest.raises(Finding, match="no sphere of about 40 mm"):
        find_spheres(striped(21.6, (30, 0, 20)), 40.0)
    [found] = find_spheres(np.concatenate([striped(21.6, (30, 0, 20)), striped(20, (90, 0, 20))]), 40.0)
    assert found.centre_mm == pytest.approx((90, 0, 20), abs=1e-6)


def test_doubles_and_order_change_nothing() -> None:
    points = striped(20.0, (30, 0, 20), noise=0.1)
    shuffled = np.random.default_rng(1).permutation(np.concatenate([points, points[:500]]))
    assert fit_sphere(shuffled, 40.0) == fit_sphere(points, 40.0)


def test_what_is_no_sphere_is_told() -> None:
    box = trimesh.creation.box(extents=(40.0, 40.0, 40.0))
    line = np.column_stack([np.linspace(0, 99, 1000), np.zeros((1000, 2))])
    plane = np.column_stack([np.random.default_rng(1).uniform(0, 60, (5000, 2)), np.zeros(5000)])
    for points in (
        np.zeros((0, 3)),
        np.ones((1, 3)),
        np.ones((500, 3)),
        line,
        plane,
        sample_surface(box.vertices, box.faces, 20_000),
        striped(30.0, (40, 0, 30)),  # of another size
        np.random.default_rng(1).uniform(0, 60, (5000, 3)),
    ):
        with pytest.raises(Finding, match="no sphere of about 40 mm") as caught:
            fit_sphere(points, 40.0)
        assert "\n" not in str(caught.value)
    with pytest.raises(Finding, match="no numbers"):
        fit_sphere(np.full((200, 3), np.nan), 40.0)


@pytest.mark.parametrize("diameter", [25.0, 60.0, 75.0])
def test_a_foot_has_no_spheres(diameter: float) -> None:
    foot = make_foot()
    with pytest.raises(Finding, match="no sphere"):
        find_spheres(sample_surface(foot.vertices, foot.faces, 15_000), diameter)

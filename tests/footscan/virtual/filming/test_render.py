"""The look of a frame: the saturated core, speckle, glints, and that effects can be switched off."""

import numpy as np
import pytest

from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN, Mesh, Scene
from footscan.virtual.optics.texture import random_texture
from schemas.parameters.simulation import SimulationSettings

SCANNER = standard_scanner(1)
QUIET = SimulationSettings(
    ambient="dark", speckle=0.0, halo=0.0, ghost=0.0, glints=0.0, flicker=0.0, texture=0.0, noise=0.0, bayer=False
)


def plate(facing_down: bool = False) -> Scene:
    corners = np.array([[60.0, -50.0, 30.0], [60.0, 50.0, 30.0], [-60.0, 50.0, 30.0], [-60.0, -50.0, 30.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Scene(Mesh(corners, faces[:, ::-1] if facing_down else faces), SKIN)


def renderer(camera_id: int, settings: SimulationSettings) -> CameraRenderer:
    return CameraRenderer(SCANNER, camera_id, settings, random_texture(settings.seed, 0.0))


def test_core_is_white_and_flanks_are_red() -> None:
    camera = renderer(5, QUIET.model_copy(update={"bayer": True}))
    picture = camera.picture(plate(facing_down=True), 0.0, 0).astype(int)
    i, j = np.rint(camera.camera.project_plane(np.zeros(1), np.array([30.0]))[0]).astype(int)
    red, green, blue = picture[j - 12 : j + 13, i].T
    assert red[12] == 255
    assert green[12] > 230
    assert blue[12] > 200
    for flank in (slice(0, 12), slice(13, 25)):
        assert ((red[flank] > 200) & (green[flank] < 140) & (blue[flank] < 140)).any()


def test_speckle_has_its_contrast_and_grain() -> None:
    even = renderer(5, QUIET).light(plate(True), 0.0, np.random.default_rng(1))[:, :, 0]
    speckled = renderer(5, QUIET.model_copy(update={"speckle": 0.12}))
    ratios = []
    for seed in range(6):
        light = speckled.light(plate(True), 0.0, np.random.default_rng(seed))[:, :, 0]
        ratios.append(np.where(even > 2.0, light / np.maximum(even, 1e-6), np.nan))
    ratio = np.array(ratios)
    assert np.nanstd(ratio) == pytest.approx(0.12, abs=0.012)

    def correlation(step: int) -> float:
        a, b = ratio[:, :, step:] - 1.0, ratio[:, :, :-step] - 1.0
        return float(np.nanmean(a * b) / np.nanvar(ratio))

    assert 0.2 < correlation(1) < 0.7
    assert abs(correlation(4)) < 0.08


def test_glints_stand_still() -> None:
    settings = QUIET.model_copy(update={"glints": 1.0})
    camera = renderer(2, settings)
    far = Scene(Mesh(np.array([[900.0, 0.0, 0.0], [900.0, 1.0, 0.0], [900.0, 0.0, 1.0]]), np.array([[0, 1, 2]])), SKIN)
    first, later = camera.picture(far, 0.0, 0), camera.picture(far, 200.0, 100)
    assert (first.max(axis=2) > 150).sum() > 20
    np.testing.assert_array_equal(first, later)
    assert renderer(2, QUIET).picture(far, 0.0, 0).max() < 60


def test_halo_reaches_beyond_the_line() -> None:
    camera = renderer(1, QUIET)
    i, j = np.rint(camera.camera.project_plane(np.zeros(1), np.array([30.0]))[0]).astype(int)
    without = camera.light(plate(), 0.0, np.random.default_rng(1))[j - 14, i, 0]
    glowing = renderer(1, QUIET.model_copy(update={"halo": 1.0}))
    assert glowing.light(plate(), 0.0, np.random.default_rng(1))[j - 14, i, 0] > without + 0.02


@pytest.mark.parametrize(("camera_id", "passes"), [(1, 1), (5, 3)])
def test_glass_shows_the_stripe_once_more(camera_id: int, passes: int) -> None:
    scene = plate(facing_down=True)  # from above, the mirror image shows what looks down to the glass
    ghostly, plain = renderer(camera_id, QUIET.model_copy(update={"ghost": 1.0})), renderer(camera_id, QUIET)
    both, once = (camera.light(scene, 0.0, np.random.default_rng(1)) for camera in (ghostly, plain))
    more = (both - once)[:, :, 0]
    point = np.array([[0.0, 30.0, 30.0 if passes == 3 else -30.0]])
    i, j = np.rint(ghostly.camera.project(point, passes)[0]).astype(int)
    assert more[j - 2 : j + 3, i - 2 : i + 3].max() > 0.005
    assert more[j - 2 : j + 3, i - 2 : i + 3].max() > 0.5 * more.max()


def test_bright_room_saturates_parts() -> None:
    seen = {}
    for level in ("dark", "ambient", "bright"):
        camera = renderer(1, QUIET.model_copy(update={"ambient": level, "bayer": True}))
        seen[level] = camera.picture(plate(), 0.0, 0)
    assert seen["dark"].mean() < seen["ambient"].mean() < seen["bright"].mean()
    assert (seen["bright"][:, :, 0] == 255).mean() > 0.1
    assert (seen["ambient"][:, :, 0] == 255).mean() < 0.02

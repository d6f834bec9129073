"""Light by what the cameras see: through the virtual scanner's renderer, and at the limits."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Literal

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

from footscan.capture.light_choice import LightLimits, StripeSeen, choose_light, stripe_seen
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN, Scene
from footscan.virtual.optics.sensor import compress, photograph
from footscan.virtual.optics.texture import random_texture
from footscan.virtual.stage.reference_stage import block_subject
from schemas.base.errors import Finding
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.simulation import SimulationSettings

Ambient = Literal["dark", "ambient", "bright"]
Rgb = NDArray[np.uint8]
NOMINAL_MS = 10.0
"""Exposure at which the renderer's light is as its settings say."""


@cache
def scene() -> Scene:
    block = block_subject(200.0).mesh
    assert block is not None
    return Scene(block, SKIN)


class Room:
    """One camera in some surroundings, looking at the block from two places."""

    def __init__(self, camera: int, ambient: Ambient, **changes: float) -> None:
        self.camera = camera
        self.settings = SimulationSettings(ambient=ambient).model_copy(update=changes)
        self.calls: list[tuple[float, float]] = []
        self._texture = random_texture(1, 0.05)
        self._renderers: dict[float, CameraRenderer] = {}

    def look(self, power: float, exposure_ms: Mapping[int, float]) -> dict[int, list[Rgb]]:
        [exposure] = exposure_ms.values()
        self.calls.append((power, exposure))
        if power not in self._renderers:
            lit = self.settings.model_copy(update={"laser_exposure": self.settings.laser_exposure * power})
            self._renderers[power] = CameraRenderer(standard_scanner(), self.camera, lit, self._texture)
        return {self.camera: [self._picture(power, exposure, x) for x in (150.0, 230.0)]}

    def _picture(self, power: float, exposure: float, x: float) -> Rgb:
        random = np.random.default_rng([int(x), len(self.calls)])
        light = self._renderers[power].light(scene(), x, random) * np.float32(exposure / NOMINAL_MS)
        jpeg = compress(photograph(light, random, self.settings), self.settings)
        return np.asarray(simplejpeg.decode_jpeg(jpeg, colorspace="RGB"))


@pytest.mark.parametrize(("ambient", "camera"), [("dark", 5), ("ambient", 2), ("bright", 5)])
def test_light_is_found_in_three_surroundings(ambient: Ambient, camera: int) -> None:
    room = Room(camera, ambient)
    choice = choose_light([camera], room.look)
    assert choice.power == 1.0
    assert choice.looks == len(room.calls) <= 6
    assert room.calls[-1] == (0.0, choice.exposure_ms[camera])
    seen = stripe_seen(room.look(1.0, choice.exposure_ms)[camera], ExtractionParameters())
    assert seen.saturation <= 0.4
    assert seen.peak >= 180.0
    # As much of the stripe as at any exposure around it, within a tenth.
    others = [stripe_seen(room.look(1.0, {camera: ms})[camera], ExtractionParameters()) for ms in (0.4, 1.0, 2.5)]
    assert seen.points >= 0.9 * max(other.points for other in others)
    assert "the stripe just saturates" in choice.reasons[camera]


def test_a_laser_that_is_too_strong_is_turned_down() -> None:
    room = Room(5, "dark", laser_exposure=100.0)
    choice = choose_light([5], room.look, LightLimits(shortest_ms=2.0, start_ms=4.0))
    assert choice.power < 1.0
    assert choice.exposure_ms[5] == 2.0


def test_daylight_that_swamps_the_stripe_is_told() -> None:
    room = Room(2, "bright", laser_exposure=0.1)
    with pytest.raises(Finding, match=r"camera 2.*(daylight|dark)"):
        choose_light([2], room.look, LightLimits(shortest_ms=2.5))


def test_a_laser_that_does_not_shine_is_told() -> None:
    room = Room(2, "dark", laser_exposure=0.0)
    with pytest.raises(Finding, match=r"camera 2 sees 0 points of the stripe at 20 ms.*does its laser shine"):
        choose_light([2], room.look)
    assert [exposure for _, exposure in room.calls] == [5.0, 20.0, 20.0]


def test_each_camera_has_its_own_exposure_and_its_own_reason() -> None:
    def look(power: float, exposure_ms: Mapping[int, float]) -> dict[int, Sequence[Rgb]]:
        return {camera: [stripe(power * exposure_ms[camera] * camera)] for camera in exposure_ms}

    choice = choose_light([1, 16], look, LightLimits(shortest_ms=0.02))
    assert choice.exposure_ms[1] > choice.exposure_ms[16]
    assert choice.reasons.keys() == {1, 16}
    assert all(reason.startswith("the stripe just saturates") for reason in choice.reasons.values())


def test_a_camera_that_even_the_shortest_exposure_dazzles_says_so() -> None:
    def look(power: float, exposure_ms: Mapping[int, float]) -> dict[int, Sequence[Rgb]]:
        return {camera: [stripe(power * exposure_ms[camera] * camera)] for camera in exposure_ms}

    choice = choose_light([1, 16], look)
    assert choice.power == 1.0  # camera 1 would be too dark with less
    assert choice.reasons[16].startswith("the shortest exposure: brighter than wanted")
    assert choose_light([64], look).power < 1.0


def stripe(light: float) -> Rgb:
    """A level stripe of a Gaussian profile, as bright as `light`, 1 being just white."""
    rows = np.arange(480)[:, None, None]
    red = light * np.exp(-0.5 * ((rows - 240.3) / 2.0) ** 2) * np.array([1.0, 0.12, 0.09])
    level = 255 * np.clip(red + 0.002, 0.0, 1.0) ** (1 / 2.2)
    return np.broadcast_to(np.rint(level), (480, 640, 3)).astype(np.uint8)


@pytest.mark.parametrize(
    ("seen", "factor"),
    [
        (StripeSeen(300, 0.2, 240, 0.9, 0.0), 1.0),
        (StripeSeen(300, 0.4, 255, 0.9, 0.0), 0.5),
        (StripeSeen(300, 0.7, 255, 0.9, 0.0), 0.25),
        (StripeSeen(300, 0.0, 150, 0.9, 0.0), 2.0),
        (StripeSeen(300, 0.0, 80, 0.9, 0.0), 4.0),
        (StripeSeen(10, 0.0, 80, 0.9, 0.0), 4.0),
        (StripeSeen(10, 0.0, 80, 0.9, 0.3), 0.25),
        (StripeSeen(300, 0.2, 240, 0.9, 0.1), 0.5),
    ],
)
def test_exposure_follows_the_stripe_and_a_white_picture_comes_first(seen: StripeSeen, factor: float) -> None:
    assert seen.factor() == factor

"""Chooses the power of the lasers and the exposure of the cameras from the stripe in their pictures.

The stripe should just begin to saturate: darker, its faint parts are lost; brighter, its core is a white plain whose
middle is invisible, and glints and reflections grow with it. The room's light is told from the stripe by their ratio,
which exposure does not change: so the lasers shine with all their power, and the exposure of each camera follows,
unless even the shortest one is too long for that.

An exposure that is changed shifts its middle by half of the change: so does the camera's latency, where its times are
those of the start or the end of an exposure. At 36 mm/s, 10 ms more are 0.2 mm.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from footscan.frames.image import Rgb
from footscan.stripe.extract import extract_stripe
from footscan.stripe.laser import laser_of
from schemas.base.errors import Finding
from schemas.parameters.extraction import ExtractionParameters

Look = Callable[[float, Mapping[int, float]], Mapping[int, Sequence[Rgb]]]
"""Given a power (0 to 1, 0 being off) and each camera's exposure in ms: some frames of each camera, at places of the
heads that are the same for every call."""

LARGEST_SATURATION = 0.35
"""Share of the stripe's width that is white, the median over its points. Chosen by hand."""
LEAST_PEAK = 190.0
"""Grey level of red in the stripe's middle, the median over its points. Chosen by hand."""
LEAST_POINTS = 60
"""With fewer points in a frame, the stripe is not seen. Chosen by hand."""
LEAST_SCORE = 0.5
"""Median score of a stripe that stands out. Chosen by hand."""
LARGEST_FALSE_SHARE = 0.25
"""Share of the stripe's points that may be found with the lasers off. Chosen by hand."""
LARGEST_WHITE_SHARE = 0.05
"""Share of the picture; with more the room is too bright for the exposure. Chosen by hand."""
WHITE_GREY = 250
"""Grey level from which a pixel is white. Chosen by hand."""
MOST_LOOKS = 8
"""A bound of time."""
FINEST_STEP = 1.3
"""Exposures within this factor count as the same. Chosen by hand."""


@dataclass(frozen=True)
class LightLimits:
    """Limits of exposure and power. The defaults are chosen by hand."""

    shortest_ms: float = 0.3
    longest_ms: float = 20.0
    """Motion during an exposure smears the stripe: 36 mm/s make 0.7 mm in 20 ms."""
    start_ms: float = 5.0
    weakest: float = 0.1
    """Power below which lasers do not shine evenly."""


@dataclass(frozen=True)
class StripeSeen:
    """The stripe in the test frames of one camera."""

    points: float
    """Mean number per frame."""
    saturation: float
    """Median over points of the share of the width that is white, 0 to 1."""
    peak: float
    """Median grey level of red in the middle."""
    score: float
    """Median of how far the stripe stands out, 0 to 1."""
    white: float
    """Share of the picture that is white."""

    @property
    def is_found(self) -> bool:
        return self.points >= LEAST_POINTS

    def worth(self) -> float:
        """Number of points, weighted by score and by the share of the width that is not white."""
        return self.points * self.score * (1.0 - self.saturation) * (self.white <= LARGEST_WHITE_SHARE)

    def factor(self) -> float:
        """Returns the factor by which the exposure should change; 1 if it is right."""
        if self.white > LARGEST_WHITE_SHARE:
            return 0.25 if self.white > 4 * LARGEST_WHITE_SHARE else 0.5
        if not self.is_found:
            return 4.0
        if self.saturation > LARGEST_SATURATION:
            return 0.25 if self.saturation > 0.6 else 0.5
        if self.peak < LEAST_PEAK:
            return 4.0 if self.peak < LEAST_PEAK / 2.0 else 2.0
        return 1.0


@dataclass(frozen=True)
class LightChoice:
    """The chosen light, with reasons."""

    power: float
    exposure_ms: dict[int, float]
    reasons: dict[int, str]
    """One sentence for each camera."""
    looks: int


@dataclass
class _Search:
    """The search for one camera's exposure."""

    exposure_ms: float
    too_dark_ms: float = 0.0
    too_bright_ms: float = float("inf")
    tried: dict[float, StripeSeen] = field(default_factory=dict)

    def learn(self, seen: StripeSeen, limits: LightLimits) -> bool:
        """Record the stripe at the current exposure; returns True if another exposure is to be tried."""
        self.tried[self.exposure_ms] = seen
        factor = seen.factor()
        if factor > 1.0:
            self.too_dark_ms = max(self.too_dark_ms, self.exposure_ms)
        elif factor < 1.0:
            self.too_bright_ms = min(self.too_bright_ms, self.exposure_ms)
        wanted = self.exposure_ms * factor
        if factor != 1.0 and not self.too_dark_ms < wanted < self.too_bright_ms:
            wanted = (self.too_dark_ms * self.too_bright_ms) ** 0.5
        wanted = min(max(wanted, limits.shortest_ms), limits.longest_ms)
        if 1.0 / FINEST_STEP < wanted / self.exposure_ms < FINEST_STEP:
            return False
        self.exposure_ms = wanted
        return True

    def is_dazzled(self, limits: LightLimits) -> bool:
        """Returns True if even the shortest exposure is too long."""
        shortest = min(self.tried)
        return shortest < FINEST_STEP * limits.shortest_ms and self.tried[shortest].factor() < 1.0

    def best(self) -> float:
        """Returns the last exposure that was right, or else the one of the greatest worth."""
        right = [exposure for exposure, seen in self.tried.items() if seen.factor() == 1.0]
        return right[-1] if right else max(self.tried, key=lambda exposure: (self.tried[exposure].worth(), exposure))

    def reason(self, exposure_ms: float, limits: LightLimits) -> str:
        """Returns the reason for an exposure."""
        seen = self.tried[exposure_ms]
        stripe = f"red {seen.peak:.0f}, white core {100 * seen.saturation:.0f} % of the width"
        if seen.factor() == 1.0:
            return f"the stripe just saturates ({stripe})"
        if seen.factor() > 1.0 and exposure_ms > limits.longest_ms / FINEST_STEP:
            return f"the longest exposure: darker than wanted ({stripe})"
        if seen.factor() < 1.0 and exposure_ms < limits.shortest_ms * FINEST_STEP:
            return f"the shortest exposure: brighter than wanted ({stripe})"
        return f"the best of {len(self.tried)} that were tried ({stripe})"


def choose_light(cameras: Sequence[int], look: Look, limits: LightLimits | None = None) -> LightChoice:
    """Choose the light of a scan; `look` is called at most nine times, the last time with the lasers off.

    Raises
    ------
    Finding
        A camera does not see the stripe, or the room is too bright for it; with what to do.
    """
    limits = limits or LightLimits()
    extraction = ExtractionParameters()
    power, looks = 1.0, 0
    start_ms = min(max(limits.start_ms, limits.shortest_ms), limits.longest_ms)
    searches = {camera: _Search(start_ms) for camera in sorted(cameras)}
    while looks < MOST_LOOKS:
        frames = look(power, {camera: search.exposure_ms for camera, search in searches.items()})
        looks += 1
        everything = [frame for camera in searches for frame in frames[camera]]
        extraction = ExtractionParameters().with_laser(laser_of(everything, ExtractionParameters()) or "red")
        again = [search.learn(stripe_seen(frames[camera], extraction), limits) for camera, search in searches.items()]
        if any(again):
            continue
        dazzled = all(search.is_dazzled(limits) for search in searches.values())
        if not dazzled or power / 2.0 < limits.weakest or looks == MOST_LOOKS:
            break
        power /= 2.0
        searches = {camera: _Search(search.exposure_ms) for camera, search in searches.items()}
    exposures = {camera: search.best() for camera, search in searches.items()}
    dark = look(0.0, exposures)
    for camera, search in searches.items():
        _check(camera, exposures[camera], search.tried[exposures[camera]], stripe_seen(dark[camera], extraction))
    reasons = {camera: search.reason(exposures[camera], limits) for camera, search in searches.items()}
    return LightChoice(power, exposures, reasons, looks + 1)


def stripe_seen(frames: Sequence[Rgb], parameters: ExtractionParameters) -> StripeSeen:
    """Measure the stripe in frames of one camera, (rows, columns, 3) uint8 RGB each."""
    stripes = [extract_stripe(frame, parameters) for frame in frames]
    points = np.concatenate(stripes)
    white = float(np.mean([np.mean(frame.min(axis=2) >= WHITE_GREY) for frame in frames]))
    if not len(points):
        return StripeSeen(0.0, 0.0, 0.0, 0.0, white)
    return StripeSeen(
        points=len(points) / len(frames),
        saturation=float(np.median(points["saturation"])),
        peak=float(np.median(points["peak"])),
        score=float(np.median(points["score"])),
        white=white,
    )


def _check(camera: int, exposure_ms: float, seen: StripeSeen, dark: StripeSeen) -> None:
    if seen.white > LARGEST_WHITE_SHARE:
        raise Finding(
            f"camera {camera}: {100 * seen.white:.0f} % of its picture are white at {exposure_ms:.3g} ms, "
            f"expected {100 * LARGEST_WHITE_SHARE:.0f} % at most: keep daylight and lamps off the scanner"
        )
    if dark.points > LARGEST_FALSE_SHARE * seen.points and dark.is_found:
        raise Finding(
            f"camera {camera}: with the lasers off it still sees {dark.points:.0f} points of a stripe, with them on "
            f"{seen.points:.0f}: take red and shining things out of its view, and keep daylight off the scanner"
        )
    if not seen.is_found:
        raise Finding(
            f"camera {camera} sees {seen.points:.0f} points of the stripe at {exposure_ms:.3g} ms, expected "
            f"{LEAST_POINTS}: is something on the glass, does its laser shine, is its picture sharp, is the room dark?"
        )
    if seen.score < LEAST_SCORE:
        raise Finding(
            f"camera {camera}: the stripe hardly stands out ({seen.score:.2f}, expected {LEAST_SCORE:g}): "
            "darken the room"
        )

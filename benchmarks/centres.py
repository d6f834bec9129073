"""Accuracy of the stripe's centre on frames whose centres are known exactly: every method, in all light there is.

    .venv/bin/python -m benchmarks.centres

Films of lines, waves and foot-like sections go through the virtual scanner's speckle, halo, sensor and JPEG (quality
85, chroma 4:2:0), with glints, a ghost in glass, a second faint stripe, a white bar and a red disc in the picture.
Beside footscan's methods stands the plain one of library calls (`plain_stripe` of benchmarks/extraction.py).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.cramer_rao import ROOMS, centre_bound
from benchmarks.extraction import plain_stripe
from footscan.frames.image import Rgb, decode_image
from footscan.stripe.film import extract_film
from footscan.virtual.filming.stripe_frames import (
    Clutter,
    Curve,
    StripeFilm,
    StripeFilmer,
    cross_profile,
    foot_section,
    signed_distance,
    sinusoid,
    straight_line,
)
from footscan.virtual.optics.scene import SKIN
from footscan.virtual.stage.reference import standard_reference
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]
Room = Literal["dark", "ambient", "bright"]
Method = Callable[[list[Rgb]], Floats]
"""A film's frames to (N, 3): frame, i, j."""

FRAMES = 8
"""Of each film with clutter."""
CLEAN_FRAMES = 4
"""Of each film without: enough for errors that do not depend on the frames before."""
EXPOSURES: dict[Room, tuple[float, float]] = {"dark": (0.6, 24.0), "ambient": (0.6, 24.0), "bright": (4.0, 24.0)}
"""Light of the stripe's centre in units of the sensor's white: within its range, and far beyond, as in a scan."""
SIGMAS_PX = (1.5, 2.5, 4.0)
SPECKLES = (0.10, 0.15)
FOUND_PX = 2.0
"""A true point with a found one this close is found."""
FALSE_PX = 3.0
"""A point further than this and one sigma of the stripe from every true curve is false."""
CORNER_PX = 10.0
"""This close to a corner, a point is one of the corner's."""
PLAIN: dict[tuple[Room, float], tuple[int, int]] = {
    ("dark", 0.6): (72, 9),
    ("dark", 24.0): (110, 25),
    ("ambient", 0.6): (72, 9),
    ("ambient", 24.0): (110, 25),
    ("bright", 4.0): (18, 25),
    ("bright", 24.0): (18, 25),
}
"""Threshold and closing, px, with which the plain method finds the most of the stripe, by a grid on films like these
without their clutter. It is given the light; footscan is not."""
LIMIT_PX = (1, 9)
"""Lengths of stripe that share one centre, for which the Cramér-Rao bound is given."""
UNSMOOTHED: dict[str, object] = {"smoothing_widths": 0.0}
"""Parameters that switch off what smooths along the stripe."""


class Light(NamedTuple):
    """What a film's frames have in common, apart from the curves."""

    room: Room
    exposure: float
    sigma_px: float
    speckle: float

    def __str__(self) -> str:
        return f"{self.room} {self.exposure:g}, sigma {self.sigma_px:g}, speckle {self.speckle:.2f}"


class Held(NamedTuple):
    """Found points beside the true curves."""

    errors: Floats
    """(N,) px across the stripe, signed, of points that are not false."""
    false: int
    found: int
    true: int
    """Points of the true curves, one each half pixel, of which `found` are found."""
    frames: int


def main() -> None:
    lights = _lights(SIGMAS_PX, SPECKLES)
    with ThreadPoolExecutor(2) as pool:
        print("rms, bias, 99 %: across the stripe, of the points that are not false")
        print(f"found: true points with a found one within {FOUND_PX:g} px; the others are lost")
        print(f"false: found points further than {FALSE_PX:g} px + sigma from every true curve")
        held = dict(zip(lights, pool.map(_hold_all, lights), strict=True))
        _print_methods(held)
        _print_lights(held, dict(zip(lights, pool.map(_limits, lights), strict=True)))
        _print_directions(pool)
        _print_widths(pool)
        _print_corners(pool)


def _lights(sigmas_px: Sequence[float], speckles: Sequence[float]) -> list[Light]:
    return [
        Light(room, exposure, sigma, speckle)
        for room, exposures in EXPOSURES.items()
        for exposure, sigma, speckle in product(exposures, sigmas_px, speckles)
    ]


def _hold_all(light: Light) -> dict[str, Held]:
    """Every method on the cluttered films, and the plain one, which knows no clutter, on clean frames too."""
    methods, plain = _methods(), partial(_extract_plainly, *PLAIN[light.room, light.exposure])
    parts: dict[str, list[Held]] = {name: [] for name in (*methods, "plain", "plain, no clutter")}
    for film in _cluttered_films(light):
        filmer = StripeFilmer(film)
        frames = _filmed(filmer, FRAMES)
        for name, method in methods.items():
            parts[name].append(_hold(method(frames), filmer, film.sigma_px, FRAMES))
        parts["plain"].append(_hold(plain(frames), filmer, film.sigma_px, FRAMES))
        filmer = _clean(film.curves[0], light)
        points = plain(_filmed(filmer, CLEAN_FRAMES))
        parts["plain, no clutter"].append(_hold(points, filmer, film.sigma_px, CLEAN_FRAMES))
    return {name: _together(held) for name, held in parts.items()}


def _methods() -> dict[str, Method]:
    default = ExtractionParameters()
    names = get_args(ExtractionParameters.model_fields["centre_method"].annotation)
    return {
        f"{name} (default)" if name == default.centre_method else name: partial(
            _extract, default.model_copy(update={"centre_method": name})
        )
        for name in names
    }


def _extract(parameters: ExtractionParameters, frames: list[Rgb]) -> Floats:
    points = extract_film(iter(frames), parameters)
    return np.column_stack([points["frame"], points["i"], points["j"]])


def _extract_plainly(threshold: int, closed_px: int, frames: list[Rgb]) -> Floats:
    parts = [plain_stripe(frame, threshold, closed_px) for frame in frames]
    return np.column_stack([np.repeat(np.arange(len(parts)), [len(part) for part in parts]), np.concatenate(parts)])


def _cluttered_films(light: Light) -> Iterator[StripeFilm]:
    """Three lines that turn by 12 degrees each, a wave and a section; the clutter differs from film to film."""
    second = Curve(np.array([[60.0, 415.0], [200.0, 440.0]]))
    places = [
        (straight_line(15.0, -20.0), (560.0, 60.0, 30.0), 1.5),
        (straight_line(75.0, 30.0), (560.0, 80.0, 40.0), 1.5),
        (straight_line(135.0, -30.0), (90.0, 80.0, 30.0), 1.5),
        (sinusoid(-8.0, 40.0, 240.0), (540.0, 420.0, 35.0), 0.5),
        (foot_section(130.0, 5.0), (70.0, 70.0, 25.0), 1.0),
    ]
    for number, (curve, red_thing, turn) in enumerate(places):
        clutter = Clutter(second=second, red_thing=red_thing)
        settings = _settings(light, seed=number + 1).model_copy(update={"scanner_seed": number + 1})
        yield StripeFilm((curve,), light.sigma_px, settings, turn_degrees=turn, clutter=clutter)


def _settings(light: Light, seed: int) -> SimulationSettings:
    return SimulationSettings(
        seed=seed, ambient=light.room, laser_exposure=light.exposure, speckle=light.speckle, jpeg_quality=85
    )


def _filmed(filmer: StripeFilmer, frames: int) -> list[Rgb]:
    return [decode_image(filmer.jpeg(frame)) for frame in range(frames)]


def _hold(points: Floats, filmer: StripeFilmer, sigma_px: float, frames: int) -> Held:
    parts = []
    for frame in range(frames):
        centres, true = points[points[:, 0] == frame, 1:], filmer.visible_centres(frame)
        errors = signed_distance(centres, filmer.curves(frame))
        near = np.abs(errors) <= FALSE_PX + sigma_px
        found = _distance(true, centres) <= FOUND_PX
        parts.append(Held(errors[near], int((~near).sum()), int(found.sum()), len(true), 1))
    return _together(parts)


def _together(parts: list[Held]) -> Held:
    errors, false, found, true, frames = zip(*parts, strict=True)
    return Held(np.concatenate(errors), sum(false), sum(found), sum(true), sum(frames))


def _print_methods(held: Mapping[Light, Mapping[str, Held]]) -> None:
    heads = f"{'rms px':>8}{'bias px':>9}{'99 % px':>9}{'found':>10}{'false/frame':>13}{'false':>9}"
    for room, exposures in EXPOSURES.items():
        for exposure in exposures:
            print(f"\n{room + ', stripe ' + format(exposure, 'g') + ' times the white':<40}{heads}")
            some = [methods for light, methods in held.items() if light[:2] == (room, exposure)]
            for name in some[0]:
                part = _together([methods[name] for methods in some])
                print(
                    f"  {name:<38}{_rms(part.errors):8.3f}{_mean(part.errors):9.3f}{_far(part.errors):9.3f}"
                    f"{part.found / part.true:10.2%}{part.false / part.frames:13.2f}"
                    f"{part.false / max(part.false + len(part.errors), 1):9.2%}"
                )


def _print_lights(held: Mapping[Light, Mapping[str, Held]], limits: Mapping[Light, Sequence[float]]) -> None:
    names = list(next(iter(held.values())))
    bounds = "".join(f"{f'limit, {along} px':>14}" for along in LIMIT_PX)
    print(f"\n{'rms px of each, and Cramér-Rao bounds':<40}{''.join(f'{name:>18}' for name in names)}{bounds}")
    for light, methods in held.items():
        errors = "".join(f"{_rms(methods[name].errors):18.3f}" for name in names)
        print(f"  {light!s:<38}{errors}{''.join(f'{limit:14.3f}' for limit in limits[light])}")


def _limits(light: Light) -> list[float]:
    """Least standard deviation px of a centre, in the mean of the room's light, for stretches of `LIMIT_PX`."""
    bound = partial(centre_bound, light.sigma_px, light.exposure, ROOMS[light.room], light.speckle, halo=SKIN.halo)
    return [bound(along_px=along) for along in LIMIT_PX]


def _print_directions(pool: ThreadPoolExecutor) -> None:
    """Bias of lines, towards the side of (-sin, cos), with its standard error from frame to frame.

    The room's light falls off down the picture, and where it counts beside the stripe it draws centres upwards.
    """
    lines = {f"{degrees} degrees": straight_line(float(degrees), 3.3) for degrees in range(0, 180, 15)}
    _print_biases("direction, lines, sigma 2.5", [(name, line, 2.5) for name, line in lines.items()], pool)


def _print_widths(pool: ThreadPoolExecutor) -> None:
    """Bias of lines and of sections; a section's positive side is within, where the halo of skin is brighter."""
    sigmas = (1.5, 2.0, 2.5, 3.0, 4.0)
    for shape, curve in (("lines at 30 degrees", straight_line(30.0, 3.3)), ("sections", foot_section(130.0, 5.0))):
        _print_biases(f"width, {shape}", [(f"sigma {sigma:g}", curve, sigma) for sigma in sigmas], pool)


def _print_biases(title: str, rows: Sequence[tuple[str, Curve, float]], pool: ThreadPoolExecutor) -> None:
    print(f"\nBias px by {title}, speckle 0.12, no clutter, default")
    print(" " * 14 + "".join(f"{f'{light.room} {light.exposure:g}':>17}" for light in _lights([2.5], [0.12])))
    for name, curve, sigma in rows:
        print(f"  {name:<12}{''.join(pool.map(partial(_bias_text, curve), _lights([sigma], [0.12])))}")


def _bias_text(curve: Curve, light: Light) -> str:
    filmer = _clean(curve, light)
    points = _extract(ExtractionParameters(), _filmed(filmer, CLEAN_FRAMES))
    frames = [signed_distance(points[points[:, 0] == frame, 1:], filmer.curves(frame)) for frame in range(CLEAN_FRAMES)]
    biases = [_mean(errors[np.abs(errors) <= FALSE_PX + light.sigma_px]) for errors in frames]
    return f"{np.mean(biases):10.3f} ±{np.std(biases, ddof=1) / np.sqrt(CLEAN_FRAMES):.3f}"


def _print_corners(pool: ThreadPoolExecutor) -> None:
    """What the method does to sharp corners.

    The light falls with the distance to the profile, so that here the stripe's ridge is as sharp as the profile, but
    for halo and pixels. The lens of a real camera rounds the ridge itself, by about the width of the stripe.
    """
    print(f"\nDistance px from the reference object's profile, no clutter; corner: within {CORNER_PX:g} px of one")
    print(f"  {'':<52}{'corner rms':>12}{'max':>8}{'found':>9}{'elsewhere rms':>16}{'max':>8}")
    default = ExtractionParameters()
    ways = {"default": default, "not smoothed along": default.model_copy(update=UNSMOOTHED)}
    for rows in pool.map(partial(_corner_rows, ways), _lights([2.5], [0.12])):
        print("\n".join(rows))


def _corner_rows(ways: Mapping[str, ExtractionParameters], light: Light) -> list[str]:
    filmer = _clean(cross_profile(standard_reference().profile_mm, 3.5, 7.0), light)
    frames, rows = _filmed(filmer, CLEAN_FRAMES), []
    for name, parameters in ways.items():
        points = _extract(parameters, frames)
        corner, elsewhere, found = [], [], []
        for frame in range(CLEAN_FRAMES):
            centres, (profile,) = points[points[:, 0] == frame, 1:], filmer.curves(frame)
            errors = np.abs(signed_distance(centres, [profile]))
            close = _distance(centres, profile.points) <= CORNER_PX
            corner.append(errors[close])
            elsewhere.append(errors[~close & (errors <= FALSE_PX + light.sigma_px)])
            true = filmer.visible_centres(frame)
            found.append(_distance(true[_distance(true, profile.points) <= CORNER_PX], centres) <= FOUND_PX)
        near, far = np.concatenate(corner), np.concatenate(elsewhere)
        rows.append(
            f"  {f'{light}, {name}':<52}{_rms(near):12.3f}{_most(near):8.3f}{np.concatenate(found).mean():9.2%}"
            f"{_rms(far):16.3f}{_most(far):8.3f}"
        )
    return rows


def _clean(curve: Curve, light: Light) -> StripeFilmer:
    settings = _settings(light, seed=1).model_copy(update={"glints": 0.0, "ghost": 0.0})
    return StripeFilmer(StripeFilm((curve,), light.sigma_px, settings, turn_degrees=0.0))


def _distance(points: Floats, others: Floats) -> Floats:
    """(N,) px from each of `points` to the nearest of `others`."""
    return np.asarray(cKDTree(others).query(points)[0]) if len(others) else np.full(len(points), np.inf)


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2))) if len(errors) else np.nan


def _mean(errors: Floats) -> float:
    return float(errors.mean()) if len(errors) else np.nan


def _far(errors: Floats) -> float:
    return float(np.quantile(np.abs(errors), 0.99)) if len(errors) else np.nan


def _most(errors: Floats) -> float:
    return float(errors.max()) if len(errors) else np.nan


if __name__ == "__main__":
    main()

"""Damage to the pictures of a film: what light, hands and cables do to them, and worse."""

from collections.abc import Callable
from random import Random

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

Rgb = NDArray[np.uint8]
Film = list[Rgb]
"""The frames of one camera."""
FrameDamage = Callable[[Random, Rgb], tuple[Rgb, str]]
FilmDamage = Callable[[Random, Film], str]
"""Changes the list of frames and says how."""


def damage_film(random: Random, film: Film) -> str:
    """One thing done to some or all frames of a film that has any."""
    if random.random() < 0.75:
        return _frames_alike(random, film)
    return random.choice(FILM_DAMAGES)(random, film)


def _frames_alike(random: Random, film: Film) -> str:
    """The same kind of damage, of the same size, to one, two or all frames."""
    damage, seed = random.choice(FRAME_DAMAGES), random.getrandbits(32)
    numbers = sorted(random.sample(range(len(film)), min(len(film), random.choice((1, 1, 2, 3)))))
    what = ""
    for number in numbers:
        film[number], what = damage(Random(seed), film[number])
    return f"frames {', '.join(map(str, numbers))}: {what}"


def _of_one_colour(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    colour = random.choice(((0, 0, 0), (255, 255, 255), (255, 0, 0), (90, 90, 90)))
    return np.full_like(frame, colour), f"all {colour}"


def _noise_alone(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    return _numpy(random).integers(0, 256, frame.shape, np.uint8), "noise instead of the picture"


def _noisy(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    sigma = random.choice((5.0, 20.0, 60.0))
    return _clipped(frame + _numpy(random).normal(0, sigma, frame.shape)), f"noise of {sigma:g}"


def _salt(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    share = random.choice((0.001, 0.02, 0.2))
    spoiled = frame.copy()
    spoiled[_numpy(random).random(frame.shape[:2]) < share] = (255, 255, 255)
    return spoiled, f"{share:.1%} of the pixels white"


def _shifted(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    shift = random.choice((1, 3, 10, 40, 200, -5, -60))
    axis = random.randrange(2)
    return np.roll(frame, shift, axis), f"shifted by {shift} px along {'ji'[axis]}, around the border"


def _mirrored(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    way, words = random.choice(
        ((np.s_[:, ::-1], "mirrored"), (np.s_[::-1], "upside down and mirrored"), (np.s_[::-1, ::-1], "upside down"))
    )
    return np.ascontiguousarray(frame[way]), words


def _turned(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    degrees = random.choice((0.5, 2.0, 7.0, 30.0, 90.0, -1.0))
    return np.asarray(
        Image.fromarray(frame).rotate(degrees, Image.Resampling.BICUBIC)
    ), f"turned by {degrees:g} degrees"


def _scaled(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    scale = random.choice((0.5, 0.95, 1.02, 1.3))
    matrix = (1 / scale, 0, 320 * (1 - 1 / scale), 0, 1 / scale, 240 * (1 - 1 / scale))
    image = Image.fromarray(frame)
    return np.asarray(image.transform(image.size, Image.Transform.AFFINE, matrix)), f"{scale:g} times as large"


def _sheared(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    rate = random.choice((0.02, 0.1, 0.4))
    image = Image.fromarray(frame)
    return np.asarray(
        image.transform(image.size, Image.Transform.AFFINE, (1, rate, 0, 0, 1, 0))
    ), f"sheared by {rate:g}"


def _blurred(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    radius = random.choice((1, 3, 8, 30))
    return np.asarray(Image.fromarray(frame).filter(ImageFilter.GaussianBlur(radius))), f"blurred by {radius} px"


def _smeared(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    length = random.choice((5, 20, 60))
    moved = [np.roll(frame, shift, 1).astype(np.float64) for shift in range(0, length, max(1, length // 8))]
    return _clipped(np.mean(moved, axis=0)), f"smeared over {length} px"


def _glints(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    count, size = random.choice((1, 5, 40)), random.choice((2, 8, 40))
    spoiled = frame.copy()
    for _ in range(count):
        j, i = random.randrange(480), random.randrange(640)
        spoiled[j : j + size, i : i + size] = random.choice(((255, 255, 255), (255, 30, 30)))
    return spoiled, f"{count} glints of {size} px"


def _false_stripe(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    i, j = np.arange(640.0), random.uniform(50, 430) + random.uniform(-0.5, 0.5) * np.arange(640.0)
    away = np.arange(480.0)[:, np.newaxis] - j
    bright = 255 * np.exp(-0.5 * (away / random.choice((1.0, 3.0))) ** 2) * (i < random.choice((150, 640)))
    spoiled = frame.astype(np.float64)
    spoiled[..., 0] += bright
    return _clipped(spoiled), "a second stripe, straight"


def _ghost(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    shift = random.choice((6, 30, 100))
    return np.maximum(frame, np.roll(frame, shift, random.randrange(2))), f"seen twice, {shift} px apart"


def _covered(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    share = random.choice((0.1, 0.3, 0.6, 0.9))
    height, width = (max(1, round(n * share**0.5)) for n in frame.shape[:2])
    j, i = random.randrange(480 - height + 1), random.randrange(640 - width + 1)
    spoiled = frame.copy()
    spoiled[j : j + height, i : i + width] = 0
    return spoiled, f"{share:.0%} blacked out from ({i}, {j})"


def _gaps(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    every = random.choice((3, 10, 40))
    spoiled = frame.copy()
    axis = random.randrange(2)
    lines = np.arange(frame.shape[axis]) % every >= every // 2
    spoiled[(lines, slice(None)) if axis == 0 else (slice(None), lines)] = 0
    return spoiled, f"every other {every // 2} px along {'ji'[axis]} black"


def _torn(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    row, shift = random.randrange(100, 400), random.choice((4, 50, 320))
    spoiled = frame.copy()
    spoiled[row:] = np.roll(spoiled[row:], shift, 1)
    return spoiled, f"torn at row {row}, the rest {shift} px aside"


def _other_light(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    gain, offset = random.choice(((0.1, 0), (0.4, 0), (3.0, 0), (1.0, 120), (0.3, 170)))
    return _clipped(frame * gain + offset), f"brightness times {gain:g} plus {offset}"


def _other_colours(random: Random, frame: Rgb) -> tuple[Rgb, str]:
    what = random.choice(("blue for red", "grey", "negative", "16 levels"))
    if what == "blue for red":
        return np.ascontiguousarray(frame[..., ::-1]), what
    if what == "grey":
        return np.repeat(frame.mean(axis=2, keepdims=True).astype(np.uint8), 3, axis=2), what
    return (255 - frame if what == "negative" else frame // 16 * 16), what


def _order_changed(random: Random, film: Film) -> str:
    random.shuffle(film)
    return "frames shuffled"


def _frame_twice(random: Random, film: Film) -> str:
    one, other = (random.randrange(len(film)) for _ in range(2))
    film[one] = film[other].copy()
    return f"frame {one} is frame {other} again"


def _frames_lost(random: Random, film: Film) -> str:
    del film[random.randrange(len(film)) :: random.choice((1, 5))]
    return f"only {len(film)} frames left"


def _frame_added(random: Random, film: Film) -> str:
    film.insert(random.randrange(len(film) + 1), film[0].copy())
    return "a frame too many"


def _other_size(random: Random, film: Film) -> str:
    size = random.choice(((320, 240), (1280, 960), (480, 640), (1, 1), (640, 481)))
    numbers = range(len(film)) if random.random() < 0.6 else [random.randrange(len(film))]
    for number in numbers:
        film[number] = np.asarray(Image.fromarray(film[number]).resize(size))
    return f"{len(numbers)} frames of {size[0]} x {size[1]} pixels"


def _numpy(random: Random) -> np.random.Generator:
    return np.random.default_rng(random.getrandbits(32))


def _clipped(values: NDArray[np.float64]) -> Rgb:
    return np.clip(values, 0, 255).astype(np.uint8)


FRAME_DAMAGES: tuple[FrameDamage, ...] = (
    *(_of_one_colour, _noise_alone, _noisy, _salt, _shifted, _shifted, _mirrored, _turned, _turned, _scaled, _sheared),
    *(
        _blurred,
        _smeared,
        _glints,
        _false_stripe,
        _ghost,
        _covered,
        _covered,
        _gaps,
        _torn,
        _other_light,
        _other_colours,
    ),
)
FILM_DAMAGES: tuple[FilmDamage, ...] = (_order_changed, _frame_twice, _frames_lost, _frame_added, _other_size)

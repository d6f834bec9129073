"""Signal and redness of pixels. Pictures of another laser are brought to red first, see `as_red`.

A pixel is one 32-bit word, with red in its lowest byte, then green, blue and an unused byte, so that one load reads it.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.frames.image import padded_pixels
from schemas.laser import Laser

SIGNAL_SCALE = 4
"""Levels of the signal 2 R + G + B for one grey level. It shows the laser's red and the white of a saturated core."""
WHITE_SCALE = 5
"""Levels of R + 3 G + B for one grey level."""
SUMMED = 4
"""Pixels whose sum is one pixel of the half-size image."""
SATURATED = np.int32(1 << 12)
"""Mark of saturated red, added to the redness of a pixel of the half-size image: more than that can be (4 * 255)."""
_BYTE, _TWO_BYTES, _RED_AND_BLUE = np.uint32(0xFF), np.uint32(0xFFFF), np.uint32(0x00FF00FF)
_EIGHT, _SIXTEEN = np.uint32(8), np.uint32(16)


def as_words(image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """View an image as words: its own memory if it lies in a `pixel_buffer`, otherwise a copy.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.

    Returns
    -------
    (rows, columns) uint32.
    """
    padded = padded_pixels(image)
    if padded is None:
        padded = np.empty((*image.shape[:2], 4), np.uint8)
        padded[..., :3] = image
    words: NDArray[np.uint32] = padded.view("<u4")[..., 0]
    return words if sys.byteorder == "little" else words.astype(np.uint32)


def as_red(words: NDArray[np.uint32], laser: Laser) -> NDArray[np.uint32]:
    """Bring the light of a laser to red: red and the laser's colour change places.

    A picture without colours (`mono`) becomes one of red light alone.

    Returns
    -------
    (rows, columns) uint32: `words` itself for a red laser, otherwise a new array.

    >>> print([f"{word:06x}" for word in as_red(np.array([[0x20_50_C8]], np.uint32), "green")[0]])
    ['20c850']
    """
    if laser == "red":
        return words
    if laser == "mono":
        return (words >> _EIGHT) & _BYTE
    shift = _EIGHT if laser == "green" else _SIXTEEN
    changed: NDArray[np.uint32] = _exchanged(words, shift)
    return changed


@compiled
def _exchanged(words: NDArray[np.uint32], shift: np.uint32) -> NDArray[np.uint32]:
    """Exchange the lowest byte of each word for that `shift` bits higher."""
    changed = np.empty_like(words)
    rows, columns = words.shape
    for y in range(rows):
        for x in range(columns):
            word = words[y, x]
            differs = (word ^ (word >> shift)) & _BYTE
            changed[y, x] = word ^ (differs | (differs << shift))
    return changed


@compiled
def red_of(word: np.uint32) -> int:
    """The level of red, 0 to 255."""
    return int(np.int64(word & _BYTE))  # int() of the word itself would be unsigned


@compiled
def redness_of(word: np.uint32) -> int:
    """The redness R - max(G, B) of a pixel, at least 0.

    >>> redness_of(np.uint32(0x20_50_C8))  # blue 32, green 80, red 200
    120
    """
    red, green, blue = word & _BYTE, (word >> _EIGHT) & _BYTE, (word >> _SIXTEEN) & _BYTE
    return max(int(np.int64(red)) - int(np.int64(max(green, blue))), 0)


@compiled
def lights_of(word: np.uint32) -> int:
    """The signal 2 R + G + B in the lower 32 bits, and R + 3 G + B in the upper 32 bits.

    The second shows the core of an over-exposed stripe: green saturates last, and the mosaic samples it most.

    >>> lights = lights_of(np.uint32(0x20_50_C8))
    >>> lights & 0xFFFFFFFF, lights >> 32
    (512, 472)
    """
    red, green, blue = np.int64(word & _BYTE), np.int64((word >> _EIGHT) & _BYTE), np.int64((word >> _SIXTEEN) & _BYTE)
    return int((2 * red + green + blue) | ((red + 3 * green + blue) << 32))


@compiled
def light_of(word: np.uint32) -> float:
    """The light of a pixel, 1 for white. A camera's levels are about the square root of the light.

    >>> light_of(np.uint32(0xFF_FF_FF))
    1.0
    """
    red, green, blue = float(word & _BYTE), float((word >> _EIGHT) & _BYTE), float((word >> _SIXTEEN) & _BYTE)
    return (red * red + green * green + blue * blue) / (3.0 * 255.0 * 255.0)


@compiled
def take_away(image: NDArray[np.uint8], background: NDArray[np.uint8], light: NDArray[np.uint8]) -> None:
    """Subtract `background` from `image` into `light`, byte by byte, at least 0; all (N,) uint8."""
    for n in range(image.size):
        light[n] = image[n] - min(image[n], background[n])


@compiled
def halve(words: NDArray[np.uint32], saturation: int, excess: NDArray[np.uint16], signal: NDArray[np.uint16]) -> None:
    """Compute redness and signal of the half-size image, each pixel of which is the sum of four.

    Where red is saturated in all four pixels, `SATURATED` is added to the redness. An image of odd size is continued by
    its last row and column.

    Parameters
    ----------
    words : (rows, columns) uint32, the pixels of an image.
    saturation : grey level of red from which a pixel is saturated.
    excess, signal : (ceil(rows / 2), ceil(columns / 2)) uint16, filled with redness and signal.
    """
    rows, columns = words.shape
    whole = columns // 2
    full = np.int32(SUMMED * saturation)
    for y in range(excess.shape[0]):
        upper, lower = words[2 * y], words[min(2 * y + 1, rows - 1)]
        reds, lights = excess[y], signal[y]
        for x in range(whole):
            reds[x], lights[x] = _of_four(upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1], full)
        if columns % 2:
            reds[whole], lights[whole] = _of_four(upper[-1], upper[-1], lower[-1], lower[-1], full)


@compiled
def _of_four(a: np.uint32, b: np.uint32, c: np.uint32, d: np.uint32, full: np.int32) -> tuple[np.uint16, np.uint16]:
    """Redness and signal of the sum of four pixels. Red and blue are added side by side in one word."""
    red_blue = (a & _RED_AND_BLUE) + (b & _RED_AND_BLUE) + (c & _RED_AND_BLUE) + (d & _RED_AND_BLUE)
    green = np.int32(
        ((a >> _EIGHT) & _BYTE) + ((b >> _EIGHT) & _BYTE) + ((c >> _EIGHT) & _BYTE) + ((d >> _EIGHT) & _BYTE)
    )
    red, blue = np.int32(red_blue & _TWO_BYTES), np.int32(red_blue >> _SIXTEEN)
    redness = max(red - max(green, blue), np.int32(0)) + (SATURATED if red >= full else np.int32(0))
    return np.uint16(redness), np.uint16(2 * red + green + blue)


@compiled
def mark_saturated(words: NDArray[np.uint32], saturation: int, excess: NDArray[np.uint16]) -> None:
    """Add `SATURATED` to the redness `excess` of `halve` where red is saturated in `words`, the image of all light."""
    rows, columns = words.shape
    for y in range(excess.shape[0]):
        below = min(2 * y + 1, rows - 1)
        for x in range(excess.shape[1]):
            beside = min(2 * x + 1, columns - 1)
            red = red_of(words[2 * y, 2 * x]) + red_of(words[2 * y, beside])
            red += red_of(words[below, 2 * x]) + red_of(words[below, beside])
            if red >= SUMMED * saturation and excess[y, x] < SATURATED:
                excess[y, x] += np.uint16(SATURATED)

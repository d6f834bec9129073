"""What a pixel says of the laser: how bright it is, and how much redder than white.

A pixel is one word here, red in its lowest byte, then green, blue and one that counts for nothing: one load tells all.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.frames.image import padded_pixels

SIGNAL_SCALE = 4
"""Levels of the signal for one grey level: it is 2 R + G + B, for the laser's red and a saturated core's white."""
WHITE_SCALE = 5
"""The same of R + 3 G + B."""
SUMMED = 4
"""Pixels that one of the half-size image is the sum of."""
SATURATED = np.int32(1 << 12)
"""More than the redness of these."""
_BYTE, _TWO_BYTES, _RED_AND_BLUE = np.uint32(0xFF), np.uint32(0xFFFF), np.uint32(0x00FF00FF)
_EIGHT, _SIXTEEN = np.uint32(8), np.uint32(16)


def as_words(image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(rows, columns) of words: the memory of an image that lies in a `pixel_buffer`, otherwise a copy."""
    padded = padded_pixels(image)
    if padded is None:
        padded = np.empty((*image.shape[:2], 4), np.uint8)
        padded[..., :3] = image
    words: NDArray[np.uint32] = padded.view("<u4")[..., 0]
    return words if sys.byteorder == "little" else words.astype(np.uint32)


@compiled
def red_of(word: np.uint32) -> int:
    """The level of red."""
    return int(np.int64(word & _BYTE))  # of the word itself, int() would be without a sign


@compiled
def redness_of(word: np.uint32) -> int:
    """R - max(G, B), not below 0."""
    red, green, blue = word & _BYTE, (word >> _EIGHT) & _BYTE, (word >> _SIXTEEN) & _BYTE
    return max(int(np.int64(red)) - int(np.int64(max(green, blue))), 0)


@compiled
def lights_of(word: np.uint32) -> int:
    """The signal 2 R + G + B, and in the upper half R + 3 G + B.

    The second tells the core of an over-exposed stripe: green is saturated last, and the mosaic samples it most.
    """
    red, green, blue = np.int64(word & _BYTE), np.int64((word >> _EIGHT) & _BYTE), np.int64((word >> _SIXTEEN) & _BYTE)
    return int((2 * red + green + blue) | ((red + 3 * green + blue) << 32))


@compiled
def light_of(word: np.uint32) -> float:
    """The light of a pixel, 1 for white: a camera's levels are about its root."""
    red, green, blue = float(word & _BYTE), float((word >> _EIGHT) & _BYTE), float((word >> _SIXTEEN) & _BYTE)
    return (red * red + green * green + blue * blue) / (3.0 * 255.0 * 255.0)


@compiled
def take_away(image: NDArray[np.uint8], background: NDArray[np.uint8], light: NDArray[np.uint8]) -> None:
    """Fills `light` with what `image` has more than `background`, byte by byte; all (N,)."""
    for n in range(image.size):
        light[n] = image[n] - min(image[n], background[n])


@compiled
def halve(words: NDArray[np.uint32], saturation: int, excess: NDArray[np.uint16], signal: NDArray[np.uint16]) -> None:
    """Fills redness and signal, both (ceil(rows / 2), ceil(columns / 2)), each of the sum of four pixels.

    Where red is saturated in all four, `SATURATED` is added to the redness. What lies outside an image of odd size is
    as its last row and column.
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
    """Redness and signal of the sum of four pixels; red and blue are added side by side in one word."""
    red_blue = (a & _RED_AND_BLUE) + (b & _RED_AND_BLUE) + (c & _RED_AND_BLUE) + (d & _RED_AND_BLUE)
    green = np.int32(
        ((a >> _EIGHT) & _BYTE) + ((b >> _EIGHT) & _BYTE) + ((c >> _EIGHT) & _BYTE) + ((d >> _EIGHT) & _BYTE)
    )
    red, blue = np.int32(red_blue & _TWO_BYTES), np.int32(red_blue >> _SIXTEEN)
    redness = max(red - max(green, blue), np.int32(0)) + (SATURATED if red >= full else np.int32(0))
    return np.uint16(redness), np.uint16(2 * red + green + blue)


@compiled
def mark_saturated(words: NDArray[np.uint32], saturation: int, excess: NDArray[np.uint16]) -> None:
    """Adds `SATURATED` to the redness of `halve` where red is saturated in another image, that of all light."""
    rows, columns = words.shape
    for y in range(excess.shape[0]):
        below = min(2 * y + 1, rows - 1)
        for x in range(excess.shape[1]):
            beside = min(2 * x + 1, columns - 1)
            red = red_of(words[2 * y, 2 * x]) + red_of(words[2 * y, beside])
            red += red_of(words[below, 2 * x]) + red_of(words[below, beside])
            if red >= SUMMED * saturation and excess[y, x] < SATURATED:
                excess[y, x] += np.uint16(SATURATED)

"""Loops over the pixels of a picture."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]


@compiled
def interpolated(
    face: NDArray[np.int32],
    shares: Singles,
    faces: Ints,
    vertices: Floats,
    vertex_normals: Floats,
    vertex_albedo: Floats,
) -> tuple[Floats, Floats, Floats]:
    count = len(face)
    points, normals, albedo = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    for k in range(count):
        a, b, c = faces[face[k], 0], faces[face[k], 1], faces[face[k], 2]
        u, v = float(shares[k, 0]), float(shares[k, 1])
        w = 1.0 - u - v
        length = 0.0
        for d in range(3):
            points[k, d] = w * vertices[a, d] + u * vertices[b, d] + v * vertices[c, d]
            normals[k, d] = w * vertex_normals[a, d] + u * vertex_normals[b, d] + v * vertex_normals[c, d]
            length += normals[k, d] * normals[k, d]
        length = max(np.sqrt(length), 1e-12)
        for d in range(3):
            normals[k, d] /= length
        albedo[k] = w * vertex_albedo[a] + u * vertex_albedo[b] + v * vertex_albedo[c]
    return points, normals, albedo


@compiled
def add_light(light: Singles, grey: Singles, colour: Singles) -> None:
    """Add light (R, C) of one colour to a picture."""
    rows, columns = grey.shape
    for j in range(rows):
        for i in range(columns):
            if grey[j, i] != np.float32(0.0):
                for c in range(3):
                    light[j, i, c] += grey[j, i] * colour[c]


@compiled
def put_object(
    light: Singles, flat: Ints, normals: Floats, albedo: Floats, lamp: Floats, parts: Floats, colour: Singles
) -> None:
    """Put the subject in the light of the room over what is behind it."""
    pixels = light.reshape(-1, 3)
    for k in range(len(flat)):
        facing = normals[k, 0] * lamp[0] + normals[k, 1] * lamp[1] + normals[k, 2] * lamp[2]
        shade = np.float32((parts[0] + parts[1] * normals[k, 2] + parts[2] * max(facing, 0.0)) * albedo[k])
        for c in range(3):
            pixels[flat[k], c] = shade * colour[c]


@compiled
def blurred(light: Singles, kernel: Singles) -> Singles:
    """Convolve each row and each column with a symmetric kernel; the border pixels go on beyond the border.

    Four pixels of the kernel at a time: each sum is read and written a quarter as often.
    """
    rows, columns, colours = light.shape
    half, width = len(kernel) // 2, columns * colours
    weights = np.zeros((len(kernel) + 3) // 4 * 4, np.float32)
    weights[: len(kernel)] = kernel
    along, out = np.empty((rows, width), np.float32), np.empty((rows, width), np.float32)
    padded = np.empty((columns + len(weights), colours), np.float32)
    flat = padded.reshape(-1)
    for j in range(rows):
        padded[:half], padded[half + columns :] = light[j, 0], light[j, columns - 1]
        padded[half : half + columns] = light[j]
        for k in range(0, len(weights), 4):
            first, step = k * colours, colours
            _sum_up(
                along[j], k == 0, weights[k : k + 4], flat[first:], flat[first + step :],
                flat[first + 2 * step :], flat[first + 3 * step :],
            )  # fmt: skip
    for j in range(rows):
        for k in range(0, len(weights), 4):
            first = j + k - half
            _sum_up(
                out[j], k == 0, weights[k : k + 4], along[_within(first, rows)], along[_within(first + 1, rows)],
                along[_within(first + 2, rows)], along[_within(first + 3, rows)],
            )  # fmt: skip
    return out.reshape(rows, columns, colours)


@compiled
def _within(index: int, count: int) -> int:
    return min(max(index, 0), count - 1)


@compiled
def _sum_up(into: Singles, is_first: bool, w: Singles, a: Singles, b: Singles, c: Singles, d: Singles) -> None:
    """Add the weighted sum of four rows to a fifth one, or begin it."""
    p, q, r, s = w[0], w[1], w[2], w[3]
    if is_first:
        for n in range(len(into)):
            into[n] = p * a[n] + q * b[n] + r * c[n] + s * d[n]
    else:
        for n in range(len(into)):
            into[n] += p * a[n] + q * b[n] + r * c[n] + s * d[n]


@compiled
def mix(picture: Singles, other: Singles, share: Singles) -> None:
    """Put a share (R, C) of another picture in the place of as much of a picture (R, C, 3)."""
    rows, columns = share.shape
    for j in range(rows):
        for i in range(columns):
            for c in range(3):
                picture[j, i, c] += share[j, i] * (other[j, i, c] - picture[j, i, c])


@compiled
def enlarged(blocks: Singles, factor: int) -> Singles:
    """Interpolate (R, C) between the middles of blocks of `factor` x `factor` pixels; constant at the border."""
    rows, columns = blocks.shape
    picture = np.empty((rows * factor, columns * factor), np.float32)
    for j in range(rows * factor):
        y = min(max((j + 0.5) / factor - 0.5, 0.0), rows - 1.0)
        above = min(int(y), rows - 2) if rows > 1 else 0
        below, v = min(above + 1, rows - 1), np.float32(y - above)
        for i in range(columns * factor):
            x = min(max((i + 0.5) / factor - 0.5, 0.0), columns - 1.0)
            left = min(int(x), columns - 2) if columns > 1 else 0
            right, u = min(left + 1, columns - 1), np.float32(x - left)
            upper = blocks[above, left] + u * (blocks[above, right] - blocks[above, left])
            lower = blocks[below, left] + u * (blocks[below, right] - blocks[below, left])
            picture[j, i] = upper + v * (lower - upper)
    return picture

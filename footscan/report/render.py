"""Pictures of a triangle mesh: orthographic, hidden parts removed by depth, smoothly shaded."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from footscan.compiled import compiled
from footscan.mesh.topology import vertex_normals

_SAMPLES = 2
"""Side of the block of samples that a pixel is the mean of, for smooth outlines."""
_LIGHT = np.array([-0.35, 0.5, 0.79]) / np.linalg.norm([-0.35, 0.5, 0.79])
"""Unit vector towards the light, which stands above the viewer's left shoulder."""
_AMBIENT, _FILL, _KEY = 0.30, 0.24, 0.46
"""Shares of the light from all directions, from the viewer (it shapes surfaces in shadow) and from the lamp.

Chosen by hand."""
_COMPRESSION = 3
"""Level of PNG compression, 0 to 9: half the time of the default 6, for a file that is a tenth larger."""
_INNER_SIDE = 0.45
"""Brightness of the inner side of a surface relative to its outer side, so that a hole is visible; chosen by hand."""


def render_mesh(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    colours: NDArray[np.uint8],
    shape: tuple[int, int],
    pixels_per_mm: float,
    normals: NDArray[np.floating] | None = None,
) -> NDArray[np.uint8]:
    """Render a mesh as seen from +Z, shaded, on a transparent ground.

    Parameters
    ----------
    vertices : (V, 3) float, mm, viewer's frame
        X to the right, Y up, Z towards the viewer; the origin is the upper left corner of the picture, so points
        in the picture have X >= 0 and Y <= 0.
    faces : (F, 3) int
        Rows of `vertices`, counter-clockwise as seen from outside.
    colours : (V, 3) uint8
        RGB of each vertex.
    shape : (rows, columns) of the picture
    pixels_per_mm : float
    normals : (V, 3) float
        Outward unit vectors in the viewer's frame; computed by default.

    Returns
    -------
    (rows, columns, 4) uint8, RGBA
    """
    outward = np.asarray(
        vertex_normals(np.asarray(vertices, np.float64), faces) if normals is None else normals, np.float64
    )
    samples_per_mm = pixels_per_mm * _SAMPLES
    # Sample (0, 0) has its centre half a sample inside the corner.
    projected = np.asarray(vertices, np.float64) * [samples_per_mm, -samples_per_mm, 1.0] - [0.5, 0.5, 0.0]
    samples: NDArray[np.float32] = rasterise(
        projected,
        np.ascontiguousarray(faces, np.int64),
        colours * _shade(outward)[:, None],
        colours * (_INNER_SIDE * _shade(-outward))[:, None],
        (shape[0] * _SAMPLES, shape[1] * _SAMPLES),
    )
    return _mean_of_samples(samples)


def _shade(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V,) brightness, 0 to 1, of surfaces with (V, 3) unit `normals`."""
    shade: NDArray[np.float64] = (
        _AMBIENT + _FILL * np.clip(normals[:, 2], 0, 1) + _KEY * np.clip(normals @ _LIGHT, 0, 1)
    )
    return shade


@compiled
def rasterise(
    projected: NDArray[np.float64],
    faces: NDArray[np.int64],
    outer: NDArray[np.float64],
    inner: NDArray[np.float64],
    shape: tuple[int, int],
) -> NDArray[np.float32]:
    """RGB of the nearest triangle at each sample, and 255; zeros at samples without a triangle.

    The result has the shape (rows, columns, 4), where `shape` is (rows, columns). `projected`, (V, 3), holds column,
    row and depth towards the viewer of each vertex; `outer` and `inner` hold its (V, 3) colours, 0 to 255, on the side
    from which the corners of a triangle run counter-clockwise, and on the other side. Colours and depth are linear over
    a triangle, as the projection is orthographic. Among triangles at the same depth the first wins.
    """
    rows, columns = shape
    samples = np.zeros((rows, columns, 4), np.float32)
    nearest = np.full((rows, columns), -np.inf)
    for face in range(len(faces)):
        a, b, c = faces[face]
        xa, ya, za = projected[a]
        xb, yb, zb = projected[b]
        xc, yc, zc = projected[c]
        # Twice the signed area; rows run down, so counter-clockwise is negative.
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        if area == 0.0:
            continue
        colours = outer if area < 0.0 else inner
        for row in range(max(0, int(np.ceil(min(ya, yb, yc)))), min(rows - 1, int(np.floor(max(ya, yb, yc)))) + 1):
            for column in range(
                max(0, int(np.ceil(min(xa, xb, xc)))), min(columns - 1, int(np.floor(max(xa, xb, xc)))) + 1
            ):
                at_b = ((column - xa) * (yc - ya) - (xc - xa) * (row - ya)) / area
                at_c = ((xb - xa) * (row - ya) - (column - xa) * (yb - ya)) / area
                at_a = 1.0 - at_b - at_c
                if at_a < 0.0 or at_b < 0.0 or at_c < 0.0:
                    continue
                depth = at_a * za + at_b * zb + at_c * zc
                if depth <= nearest[row, column]:
                    continue
                nearest[row, column] = depth
                for channel in range(3):
                    samples[row, column, channel] = (
                        at_a * colours[a, channel] + at_b * colours[b, channel] + at_c * colours[c, channel]
                    )
                samples[row, column, 3] = 255.0
    return samples


@compiled
def _mean_of_samples(samples: NDArray[np.float32]) -> NDArray[np.uint8]:
    """RGBA pixels of `_SAMPLES` x `_SAMPLES` samples: colour is the mean of the covered samples, alpha their share."""
    rows, columns = samples.shape[0] // _SAMPLES, samples.shape[1] // _SAMPLES
    pixels = np.zeros((rows, columns, 4), np.uint8)
    for row in range(rows):
        for column in range(columns):
            red = green = blue = 0.0
            covered = 0
            for down in range(_SAMPLES):
                for right in range(_SAMPLES):
                    sample = samples[row * _SAMPLES + down, column * _SAMPLES + right]
                    if sample[3] > 0.0:
                        red, green, blue = red + sample[0], green + sample[1], blue + sample[2]
                        covered += 1
            if covered:
                pixels[row, column, 0] = np.uint8(np.rint(red / covered))
                pixels[row, column, 1] = np.uint8(np.rint(green / covered))
                pixels[row, column, 2] = np.uint8(np.rint(blue / covered))
                pixels[row, column, 3] = np.uint8(np.rint(255.0 * covered / _SAMPLES**2))
    return pixels


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """Encode (rows, columns, 3 or 4) pixels as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=_COMPRESSION)
    return buffer.getvalue()

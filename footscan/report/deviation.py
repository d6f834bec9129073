"""Distances from one shape to another, drawn as colours: a PLY file, and pictures from four sides."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from footscan.mesh.formats.files import Shape
from footscan.report.colours import colour_limit, distance_colours
from footscan.report.render import png_bytes
from footscan.report.surface_views import PIXELS_PER_MM, render_view, upright, views_of
from footscan.verify.distances import Distances
from footscan.verify.regions import FootRegions
from schemas.base.errors import RefusedInput
from schemas.base.model import Side

SEEN_MM = (1.0, 2000.0)
"""Smallest and largest extent of a shape that is drawn at three pixels per mm: a bound of memory."""
DOTS = 60_000
"""Most points of a cloud that are drawn; on a foot one per 1.3 mm²."""
DOT_SPACINGS, LARGEST_DOT = 0.8, 1 / 50
"""Radius of a dot in spacings of as many points on the bounding box, so that dots touch; its largest share of the box.

Chosen by hand."""
PICTURES = ("above", "below", "left", "right")
"""The first four of `views_of`."""
_OCTAHEDRON = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
_OCTAHEDRON_FACES = np.array(
    [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]], np.int32
)
_INK = (70, 70, 70)
_BAR_PX, _ABOVE_PX, _BELOW_PX = 240, 30, 52
"""Width of the colour bar; room above a picture for its title, and below for the bar."""


class Deviation(NamedTuple):
    """A shape, and the distance of each of its vertices to another shape."""

    vertices: NDArray[np.float64]
    """(V, 3) mm; a foot stands in its own frame: X from heel to toes, Y to its own left, Z up."""
    faces: NDArray[np.integer]
    """(F, 3), empty for a cloud."""
    distance: NDArray[np.floating]
    """(V,) mm; if signed, positive outside."""
    signed: bool
    side: Side | None
    """Which foot it is; None if the shape is not a foot."""


def deviation_of(shape: Shape, distances: Distances, regions: FootRegions | None) -> Deviation:
    """Combine a shape with the distances of its vertices; a foot is moved into the frame of its `regions`.

    `regions` : None if the shape is not a foot; it is then not moved
    """
    vertices, faces = shape
    return Deviation(
        vertices=vertices if regions is None else upright(vertices, regions.transform),
        faces=faces,
        distance=distances.unsigned if distances.signed is None else distances.signed,
        signed=distances.signed is not None,
        side=None if regions is None else regions.side,
    )


def deviation_ply(shape: Shape, distance: NDArray[np.floating]) -> bytes:
    """Write a mesh or cloud as a binary PLY file with a colour and a `distance` at each of its V vertices.

    `distance` : (V,) mm
    """
    vertices, faces = shape
    limit = colour_limit(distance)
    vertex = np.zeros(len(vertices), [("place", "<f4", 3), ("colour", "u1", 3), ("distance", "<f4")])
    vertex["place"], vertex["colour"], vertex["distance"] = vertices, distance_colours(distance, limit), distance
    face = np.zeros(len(faces), [("corners", "u1"), ("of", "<i4", 3)])
    face["corners"], face["of"] = 3, faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment unit mm; colours end at {limit:g} mm",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in "xyz"),
        *(f"property uchar {name}" for name in ("red", "green", "blue")),
        "property float distance",
        *([f"element face {len(faces)}", "property list uchar int vertex_indices"] if len(faces) else []),
        "end_header\n",
    ]
    return "\n".join(header).encode("ascii") + vertex.tobytes() + face.tobytes()


def drawn(deviation: Deviation) -> tuple[NDArray[np.float64], NDArray[np.integer], NDArray[np.uint8]]:
    """Vertices, faces and colours of the drawn mesh: the mesh itself, or small octahedra at the points of a cloud.

    Raises
    ------
    RefusedInput
        The shape is smaller or larger than `SEEN_MM`.
    """
    vertices, faces, distance, _, _ = deviation
    box = np.ptp(vertices, axis=0)
    extent = float(box.max())
    if not SEEN_MM[0] <= extent <= SEEN_MM[1]:
        low, high = SEEN_MM
        raise RefusedInput("pictures", f"the shape is {extent:.3g} mm across, expected {low:g} to {high:g} mm")
    limit = colour_limit(distance)
    if len(faces):
        return vertices, faces, distance_colours(distance, limit)
    chosen = np.arange(len(vertices))
    if len(vertices) > DOTS:  # with replacement: a choice without it would shuffle all points
        chosen = np.unique(np.random.default_rng(0).integers(0, len(vertices), DOTS))
    spacing = np.sqrt(2 * float(box @ np.roll(box, 1)) / len(chosen))
    corners = vertices[chosen, None] + _OCTAHEDRON * min(DOT_SPACINGS * spacing, LARGEST_DOT * extent)
    dots = np.arange(len(chosen), dtype=np.int64)[:, None, None] * len(_OCTAHEDRON) + _OCTAHEDRON_FACES
    colours = np.repeat(distance_colours(distance[chosen], limit), len(_OCTAHEDRON), axis=0)
    return corners.reshape(-1, 3), dots.reshape(-1, 3), colours


def deviation_pictures(deviation: Deviation) -> dict[str, bytes]:
    """Draw PNG pictures from above, below and both sides, each with a colour bar in mm; by file name.

    Errors as in `drawn`.
    """
    vertices, faces, colours = drawn(deviation)
    limit = colour_limit(deviation.distance)
    pictures = {}
    for name, view in zip(PICTURES, views_of(deviation.side), strict=False):
        pixels, _, _ = render_view(view, vertices, faces, colours)
        picture = Image.fromarray(pixels)
        size = max(picture.width, 2 * _BAR_PX), picture.height + _ABOVE_PX + _BELOW_PX
        sheet = Image.new("RGB", size, "white")
        sheet.paste(picture, ((sheet.width - picture.width) // 2, _ABOVE_PX), picture)
        pen = ImageDraw.Draw(sheet)
        write(pen, (12, 8), f"{view.title}; {PIXELS_PER_MM:g} pixels are 1 mm")
        draw_colour_bar(pen, ((sheet.width - _BAR_PX) // 2, sheet.height - 44), _BAR_PX, limit, signed=deviation.signed)
        pictures[f"{name}.png"] = png_bytes(np.asarray(sheet))
    return pictures


def draw_colour_bar(
    pen: ImageDraw.ImageDraw, corner: tuple[int, int], width: int, limit: float, *, signed: bool
) -> None:
    """Draw the colours of distances up to `limit` mm, `width` pixels wide from `corner`, with three figures below."""
    x, y = corner
    least = -limit if signed else 0.0
    for step, colour in enumerate(distance_colours(np.linspace(least, limit, width), limit).tolist()):
        pen.line((x + step, y, x + step, y + 11), fill=tuple(colour))
    for share, anchor in ((0.0, "ma"), (0.5, "ma"), (1.0, "ma")):
        at = least + share * (limit - least)
        form = "+g" if signed and at else "g"
        pen.text(
            (x + share * width, y + 15), f"{at:{form}} mm", fill=_INK, font=ImageFont.load_default(14), anchor=anchor
        )


def write(pen: ImageDraw.ImageDraw, corner: tuple[int, int], line: str) -> None:
    """Draw a line of text with its upper left corner at `corner`."""
    pen.text(corner, line, fill=_INK, font=ImageFont.load_default(14))

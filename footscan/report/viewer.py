"""An interactive 3D view of a surface: a decimated mesh in the page, with a choice of colours and sections."""

import base64
import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh, used
from footscan.report.markup import text
from footscan.surface.collapse import collapse_edges
from footscan.surface.decimate import outermost

_MOST_TRIANGLES = 12_000
"""Bound of memory: their corners have 16-bit numbers, and they take some 150 kB of the page."""
_VIEWS = {"above": "Above", "below": "Below", "left": "Left", "right": "Right", "front": "Front", "back": "Back"}

Floats = NDArray[np.float64]


class Colouring(NamedTuple):
    """Colours of a surface that a reader may choose."""

    name: str
    """Any text."""
    colours: NDArray[np.uint8]
    """(V, 3) RGB."""
    meaning: str = ""
    """Legend; markup."""


class Drawing(NamedTuple):
    """Lines and points that are drawn over a surface, mm, in its frame."""

    lines: Sequence[Floats] = ()
    """(N, 3) each."""
    points: Sequence[Floats] = ()
    """(3,) each."""


def viewer(
    vertices: Floats,
    faces: NDArray[np.integer],
    colourings: Sequence[Colouring],
    drawings: Mapping[str, Drawing] | None = None,
    landmarks: Mapping[str, Floats] | None = None,
) -> str:
    """A canvas that shows the surface; it is hidden until `footscan.report.viewer_script.SCRIPT` has run.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, foot's frame, Z up
    faces : (F, 3) int, counter-clockwise as seen from outside
    colourings : at least one; the first is shown until the reader chooses another
    drawings : by name; a drawing is shown by a click in a table row with an element that has the name as `data-shows`
        and a caption as `data-told`
    landmarks : (3,) positions by name (any text), shown on demand
    """
    places, corners, colours = _smaller(vertices, faces, np.hstack([colouring.colours for colouring in colourings]))
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    radius = max(float(np.linalg.norm(places - middle, axis=1).max()), np.finfo(np.float64).tiny)

    def scaled(points: Floats) -> NDArray[np.float64]:
        return np.asarray(np.rint((points - middle) / radius * 32767), np.float64)

    arrays = {
        "points": scaled(places).astype("<i2"),
        # A surface in thousands of shreds cannot be decimated: faces whose corners exceed 16 bits are left out.
        "faces": corners[(corners < 2**16).all(axis=1)].astype("<u2"),
        "colours": np.concatenate(np.split(colours, len(colourings), axis=1)),
    }
    drawn = {
        name: {
            "lines": [scaled(line).astype(int).ravel().tolist() for line in drawing.lines],
            "points": [scaled(point).astype(int).tolist() for point in drawing.points],
        }
        for name, drawing in (drawings or {}).items()
    }
    named = {name: scaled(place).astype(int).tolist() for name, place in (landmarks or {}).items()}
    data = " ".join(f'data-{name}="{base64.b64encode(array.tobytes()).decode()}"' for name, array in arrays.items())
    data += f' data-drawings="{_json(drawn)}" data-landmarks="{_json(named)}"'
    data += f' data-middle="{_json(middle.tolist())}" data-unit="{radius / 32767!r}"'
    return (
        f'<figure id="viewer" hidden>{_choices(colourings)}<canvas id="canvas" tabindex="0" role="application" '
        'aria-label="The surface in 3D: drag or arrow keys turn it, two fingers or plus and minus change its size" '
        f'{data}></canvas><p id="shown" aria-live="polite"></p>{_controls(bool(named))}'
        f"{_meanings(colourings)}</figure>"
    )


def _smaller(
    vertices: Floats, faces: NDArray[np.integer], colours: NDArray[np.uint8]
) -> tuple[Floats, NDArray[np.integer], NDArray[np.uint8]]:
    """Decimate the surface; its (V, K) colours are interpolated."""
    kept = np.unique(faces)
    whole = used(Mesh(vertices, np.asarray(faces, np.int32)))
    if len(faces) <= _MOST_TRIANGLES:
        return whole.vertices, whole.faces, colours[kept]
    fixed = np.zeros(len(whole.vertices), np.bool_)
    fixed[outermost(whole.vertices, np.arange(len(whole.vertices)))] = True
    places, corners, values, _ = collapse_edges(
        whole.vertices, whole.faces, colours[kept].astype(np.float64), fixed, _MOST_TRIANGLES
    )
    return places, corners, np.rint(values).astype(np.uint8)


def _json(value: object) -> str:
    return text(json.dumps(value, separators=(",", ":")))


def _choices(colourings: Sequence[Colouring]) -> str:
    if len(colourings) < 2:
        return ""
    choices = "".join(
        f'<label><input type="radio" name="colouring" value="{number}"{"" if number else " checked"}>'
        f"<span>{text(colouring.name)}</span></label>"
        for number, colouring in enumerate(colourings)
    )
    return f'<div class="choices" role="radiogroup" aria-label="Colours">{choices}</div>'


def _controls(with_landmarks: bool) -> str:
    views = "".join(f'<button type="button" data-view="{name}">{label}</button>' for name, label in _VIEWS.items())
    marks = '<label><input id="landmarks" type="checkbox"> Landmarks</label>' if with_landmarks else ""
    return (
        f'<div class="controls">{views}<input id="zoom" type="range" min="0.8" max="4" step="any" value="1" '
        f'aria-label="Size">{marks}</div>'
    )


def _meanings(colourings: Sequence[Colouring]) -> str:
    return "".join(
        f'<div data-meaning="{number}"{" hidden" if number else ""}>{colouring.meaning}</div>'
        for number, colouring in enumerate(colourings)
        if colouring.meaning
    )

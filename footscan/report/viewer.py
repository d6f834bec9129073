"""The surface in 3D, to be turned by hand: a small mesh on the page, in colours and with sections to choose."""

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
"""They have no more than 36,000 corners, so 16 bits number them; some 150 kB on the page."""
_VIEWS = {"above": "Above", "below": "Below", "left": "Left", "right": "Right", "front": "Front", "back": "Back"}

Floats = NDArray[np.float64]


class Colouring(NamedTuple):
    """Colours of a surface that a person may choose."""

    name: str
    """Any text."""
    colours: NDArray[np.uint8]
    """(V, 3) RGB"""
    meaning: str = ""
    """What they mean; markup."""


class Drawing(NamedTuple):
    """What is drawn over a surface, in its frame, mm."""

    lines: Sequence[Floats] = ()
    """(N, 3) each"""
    points: Sequence[Floats] = ()
    """(3,) each"""


def viewer(
    vertices: Floats,
    faces: NDArray[np.integer],
    colourings: Sequence[Colouring],
    drawings: Mapping[str, Drawing] | None = None,
    landmarks: Mapping[str, Floats] | None = None,
) -> str:
    """A canvas that shows the surface once `footscan.report.viewer_script.SCRIPT` has run, and is not seen without it.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, foot's frame, Z up
    faces : (F, 3) int, counter-clockwise as seen from outside
    colourings : one at least; the first is shown until another is chosen
    drawings : by name; shown by a click in a row of a table that holds an element with the name as `data-shows` and
        what is to be told as `data-told`
    landmarks : (3,) places by name, any text, which a person may have shown
    """
    places, corners, colours = _smaller(vertices, faces, np.hstack([one.colours for one in colourings]))
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    radius = max(float(np.linalg.norm(places - middle, axis=1).max()), np.finfo(np.float64).tiny)

    def scaled(points: Floats) -> NDArray[np.float64]:
        return np.asarray(np.rint((points - middle) / radius * 32767), np.float64)

    arrays = {
        "points": scaled(places).astype("<i2"),
        # Of a surface in thousands of shreds, which has no smaller form, what 16 bits cannot number is not shown.
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
    return (
        f'<figure id="viewer" hidden>{_choices(colourings)}<canvas id="canvas" tabindex="0" role="application" '
        'aria-label="The surface in 3D: drag or arrow keys turn it, two fingers or plus and minus change its size" '
        f'{data}></canvas><p id="shown" aria-live="polite"></p>{_controls(bool(named))}'
        f"{_meanings(colourings)}</figure>"
    )


def _smaller(
    vertices: Floats, faces: NDArray[np.integer], colours: NDArray[np.uint8]
) -> tuple[Floats, NDArray[np.integer], NDArray[np.uint8]]:
    """The surface with fewer triangles, its (V, K) colours interpolated."""
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
        f"<span>{text(one.name)}</span></label>"
        for number, one in enumerate(colourings)
    )
    return f'<div class="choices" role="radiogroup" aria-label="Colours">{choices}</div>'


def _controls(with_landmarks: bool) -> str:
    views = "".join(f'<button type="button" data-view="{name}">{said}</button>' for name, said in _VIEWS.items())
    marks = '<label><input id="landmarks" type="checkbox"> Landmarks</label>' if with_landmarks else ""
    return (
        f'<div class="controls">{views}<input id="zoom" type="range" min="0.8" max="4" step="any" value="1" '
        f'aria-label="Size">{marks}</div>'
    )


def _meanings(colourings: Sequence[Colouring]) -> str:
    return "".join(
        f'<div data-meaning="{number}"{" hidden" if number else ""}>{one.meaning}</div>'
        for number, one in enumerate(colourings)
        if one.meaning
    )

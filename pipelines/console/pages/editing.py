"""The page on which a person moves landmarks and makes choices for a scan."""

from collections.abc import Iterable, Mapping, Sequence
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh
from footscan.recordings.decisions import Decisions
from footscan.report.filled import filled_colours
from footscan.report.markup import UNITS, number_or_dash, section, table, text, words
from footscan.report.scan.measure_drawings import landmark_place
from footscan.report.surface_views import upright
from footscan.report.viewer import Colouring, viewer
from schemas.base.model import Posture
from schemas.choices import ExportFormat
from schemas.landmarks import LANDMARKS
from schemas.measures import Axis, Measures
from schemas.sizes import People

Floats = NDArray[np.float64]
METHODS = {"geometric": "found by its definition", "fallback": "placed by proportion", "manual": "set by a person"}


def editing_page(
    name: str,
    posture: Posture,
    mesh: Mesh,
    measures: Measures,
    decisions: Decisions,
    by: str,
    exports: Sequence[ExportFormat] = (),
) -> str:
    """Return the page of a scan.

    Parameters
    ----------
    name : `patient/scan`
    posture : as scan.yaml has it
    mesh : mm, scanner frame
    measures : the delivered ones
    by : the name with which changes are signed
    exports : formats that the workflow asks for anyway
    """
    seen = upright(mesh.vertices, measures.transform)
    landmarks = {words(one): landmark_place(measures, one) for one in measures.landmarks}
    canvas = viewer(seen, mesh.faces, [Colouring("", filled_colours(mesh.vertices, mesh.filled, None))], {}, landmarks)
    canvas = canvas.replace('<canvas id="canvas"', '<canvas id="canvas" data-movable=""', 1)
    canvas = canvas.replace('<input id="landmarks" type="checkbox">', '<input id="landmarks" type="checkbox" checked>')
    listed = (
        f"{_saving(by)}{_landmarks(measures, decisions)}{_choices(posture, decisions, exports)}{_measures(measures)}"
    )
    return _PAGE.format(
        title=text(name),
        parts="\n".join(
            [
                f'<h1 id="scan" data-name="{text(name)}">{text(name)}</h1>',
                '<p id="told" role="alert" hidden></p>',
                section("Landmarks and measures", f'<div class="foot">{canvas}<div class="list">{listed}</div></div>'),
            ]
        ),
    )


def from_view(point: Iterable[float], measures: Measures) -> tuple[float, float, float]:
    """A point of the page's view in the scanner's frame, mm: the inverse of `upright`."""
    origin = upright(np.zeros((1, 3)), measures.transform)[0]
    axes = upright(np.eye(3), measures.transform) - origin
    x, y, z = np.linalg.solve(axes.T, np.array([*point]) - origin).tolist()
    return x, y, z


def _landmarks(measures: Measures, decisions: Decisions) -> str:
    rows = []
    for name in LANDMARKS:
        found, who = measures.landmarks.get(name), decisions.landmarks.decided.get(name)
        is_set = found is not None and found.method == "manual"
        how = "not found" if found is None else METHODS[found.method]
        if who is not None and is_set:
            when = None if who.at is None else f"{who.at:%Y-%m-%d %H:%M} UTC"
            how += f" ({', '.join(filter(None, [who.by, when]))})"
        arm = (
            f'<label><input type="radio" name="armed" value="{text(words(name))}" data-name="{name}"> '
            f"{text(words(name))}</label>"
        )
        back = f'<button type="button" data-back="{name}"{"" if is_set else " hidden"}>Automatic</button>'
        rows.append([arm, f'<span id="how-{name}" data-set="{"1" if is_set else ""}">{text(how)}</span>', back])
    hint = (
        '<p class="note">Drag a landmark over the surface. Or choose one here, and click the surface where it belongs.'
        "</p>"
    )
    listed = table(["Landmark", "Place", ""], rows, kind="plain")
    return f"<details open><summary>Landmarks</summary>{hint}{listed}</details>"


def _choices(posture: Posture, decisions: Decisions, of_workflow: Sequence[ExportFormat]) -> str:
    choices = decisions.choices
    selects: Mapping[str, tuple[str, tuple[str, ...], str | None, str]] = {
        "axis": ("Axis of the foot", get_args(Axis), choices.axis, "usual: toe2"),
        "posture": ("Posture and load", get_args(Posture), choices.posture, f"as recorded: {words(posture).lower()}"),
        "people": ("Sizes for", get_args(People), choices.people, "everybody"),
    }
    fields = "".join(
        f'<label>{label} <select id="{name}"><option value="">{text(usual)}</option>'
        + "".join(
            f'<option value="{one}"{" selected" if one == chosen else ""}>{text(words(one))}</option>' for one in values
        )
        + "</select></label>"
        for name, (label, values, chosen, usual) in selects.items()
    )
    exports = "".join(
        f'<label><input type="checkbox" name="export" value="{one}"{" checked" if one in choices.exports else ""}> '
        f".{one}{' (the workflow asks for it)' if one in of_workflow else ''}</label>"
        for one in get_args(ExportFormat)
    )
    return (
        f'<details><summary>Choices</summary><div class="choices-form">{fields}<span>Files {exports}</span>'
        f'<label>Notes <textarea id="notes" rows="3" maxlength="2000">{text(choices.notes)}</textarea></label>'
        "</div></details>"
    )


def _saving(by: str) -> str:
    """The buttons, and what an edit changes."""
    return (
        f'<p class="row"><label>Signed by <input id="by" maxlength="80" value="{text(by)}"></label> '
        '<button type="button" id="save" class="main" disabled>Save and measure</button> '
        '<button type="button" id="undo" disabled>Undo all</button></p>'
        '<p id="busy" class="note" aria-live="polite"></p><ul id="changes" aria-live="polite"></ul>'
    )


def _measures(measures: Measures) -> str:
    rows = []
    for name in sorted(measures.measures):
        one = measures.measures[name]
        unit, decimals = UNITS[one.unit]
        value = number_or_dash(one.value, decimals)
        cells = [text(words(name)), value, f'<b data-now="{name}"></b>', f'<span data-change="{name}"></span>', unit]
        rows.append([*cells, f'<span class="status {one.status}" data-status="{name}">{one.status}</span>'])
    return table(["Measure", "Saved", "Now", "Change", "Unit", "Status"], rows, numeric=[1, 2, 3], kind="plain")


_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="/static/console.css">
<script src="/static/viewer.js" defer></script>
<script src="/static/edit.js" defer></script>
</head>
<body>
<main>
{parts}
</main>
</body>
</html>
"""

"""The page of a scanned foot: 3D view, measures, quality, and warnings with what to do."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from footscan.mesh.formats.files import FARTHEST_MM, PARSERS
from footscan.mesh.mesh import Mesh
from footscan.report.filled import CUT, filled_colours, filled_key
from footscan.report.markup import UNITS, key, number, number_or_dash, plus_minus, section, table, text, words
from footscan.report.quality_lights import Level, TrafficLight, quality_lights, worst
from footscan.report.scan.foot_colours import CAMERAS
from footscan.report.scan.measure_drawings import landmark_place, measure_drawings
from footscan.report.scan_warnings import warnings_of
from footscan.report.size_table import size_table
from footscan.report.surface_views import upright
from footscan.report.viewer import Colouring, Drawing, viewer
from pipelines.console.pages.results import read_known, read_measures, read_quality, read_result
from pipelines.console.pages.shell import shell
from schemas.base.errors import RefusedInput
from schemas.base.limits import BeyondLimitError
from schemas.known_measures import KnownMeasures
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.sizes import FootSizes

VERDICTS = {
    "good": "A good scan",
    "fair": "A fair scan",
    "poor": "A poor scan",
    "unknown": "A scan that cannot be fully judged",
}
KNOWN = "The virtual foot’s measures are known from how it was made; no step of the scan reads them."
FIRST = ("foot_length", "foot_breadth", "ball_girth", "instep_girth", "instep_height", "heel_breadth", "arch_index")
FILES = {
    "report.html": "Whole report",
    "foot.stl": "Surface (STL)",
    "measures.json": "Measures (JSON)",
    "sizes.json": "Sizes (JSON)",
}


def foot_page(archive: Path, results: Path, patient: str, scan: str) -> str:
    """Return the page of the results of a scan.

    Raises
    ------
    RefusedInput
        The results are missing or damaged.
    """
    measures, quality = read_measures(results, patient, scan), read_quality(results, patient, scan)
    mesh = _mesh(results, patient, scan)
    drawings = measure_drawings(mesh.vertices, mesh.faces, measures)
    turned = viewer(
        upright(mesh.vertices, measures.transform),
        mesh.faces,
        _colourings(mesh, quality),
        drawings,
        {words(name): landmark_place(measures, name) for name in measures.landmarks},
    )
    lights = quality_lights(measures, quality)
    level = worst(lights)
    heading = {"right": "Right foot", "left": "Left foot"}.get(measures.side, "Foot")
    listed = _measures(measures, drawings, read_known(archive, patient, scan))
    parts = [
        f'<h1 tabindex="-1" id="result" data-patient="{text(patient)}" data-scan="{text(scan)}" '
        f'data-side="{measures.side}" data-posture="{measures.posture}" data-level="{level}">'
        f"{heading} <span>{text(patient)} {text(scan)}</span></h1>",
        _verdict(level, lights, warnings_of(measures, quality)),
        _next(measures.side, patient, scan),
        section("Measures", f'<div class="foot">{turned}<div class="list">{listed}</div></div>'),
        section("Shoe sizes", size_table(sizes)) if (sizes := _sizes(results, patient, scan)) is not None else "",
    ]
    return shell(title=f"{heading} {patient} {scan}", parts=parts, scripts=["viewer.js", "foot.js"])


def _sizes(results: Path, patient: str, scan: str) -> FootSizes | None:
    """Sizes of shoes for the foot; None for results of an earlier version."""
    try:
        return FootSizes.model_validate_json(read_result(results, patient, scan, "sizes.json"))
    except (RefusedInput, ValueError):
        return None


def _mesh(results: Path, patient: str, scan: str) -> Mesh:
    source = results / patient / scan / "foot.ply"
    try:
        mesh = PARSERS[".ply"](read_result(results, patient, scan, "foot.ply"))
    except BeyondLimitError as error:  # the parser does not know the file
        raise BeyondLimitError(source, error.problem) from None
    except ValueError as error:
        raise RefusedInput(source, f"is not a valid PLY file: {error}") from None
    if not len(mesh.vertices) or not len(mesh.faces):
        raise RefusedInput(source, "expected a surface, found no faces")
    if not np.abs(mesh.vertices).max() <= FARTHEST_MM:
        raise RefusedInput(source, f"expected coordinates in mm, up to {FARTHEST_MM:.0f}")
    if not 0 <= int(mesh.faces.min()) <= int(mesh.faces.max()) < len(mesh.vertices):
        raise RefusedInput(source, f"has faces with missing vertices, expected numbers below {len(mesh.vertices)}")
    return mesh


def _verdict(level: Level, lights: Sequence[TrafficLight], lines: Sequence[str]) -> str:
    rows = "".join(
        f'<li><span class="light {light.level}">{light.level}</span> <b>{text(light.name)}</b> {text(light.why)}</li>'
        for light in lights
    )
    listed = "".join(f"<li>{text(line)}</li>" for line in lines)
    todo = f'<h3>What to do</h3><ul class="todo">{listed}</ul>' if lines else ""
    summary = f'<h2>{VERDICTS[level]}</h2><ul class="lights">{rows}</ul>'
    return f'<section id="verdict" class="{level}">{summary}{todo}</section>'


def _next(side: str, patient: str, scan: str) -> str:
    """The buttons for the next steps of the operator; `foot.js` handles them."""
    other = {"right": "left", "left": "right"}.get(side)
    one_more = (
        f'<button id="other" type="button" data-side="{other}">Scan the {other} foot now</button>' if other else ""
    )
    files = "".join(
        f'<a href="/results/{text(patient)}/{text(scan)}/{name}"'
        f"{' target=_blank' if name.endswith('html') else ' download'}>{label}</a>"
        for name, label in FILES.items()
    )
    return (
        f'<div class="row next"><a id="pair" class="button" hidden>Both feet</a>{one_more}'
        f'<button id="again" type="button">Scan this foot again</button><a class="button" href="/">Back</a>'
        f'<a class="button" id="edit" href="/edit/{text(patient)}/{text(scan)}">Landmarks and choices</a>'
        f'<span class="files">{files}</span></div><p id="next-told" class="note" aria-live="polite"></p>'
    )


def _colourings(mesh: Mesh, quality: Quality) -> list[Colouring]:
    plain = filled_colours(mesh.vertices, mesh.filled, None)
    colourings = [Colouring("Measured and filled", plain, filled_key(quality.mesh))]
    if mesh.colours is not None:
        colourings.insert(0, Colouring("Skin", mesh.colours))
    if mesh.camera is not None:
        palette = np.array([CUT, *CAMERAS], np.uint8)
        rows = np.where(mesh.camera == 0, 0, (mesh.camera.astype(int) - 1) % len(CAMERAS) + 1)
        camera_ids = [camera for camera in np.unique(mesh.camera).tolist() if camera]
        meaning = [(f"Camera {camera}", CAMERAS[(camera - 1) % len(CAMERAS)]) for camera in camera_ids]
        colourings.append(Colouring("Camera", palette[rows], key([*meaning, ("Filled", CUT)])))
    return colourings


def _measures(measures: Measures, drawings: Mapping[str, Drawing], known: KnownMeasures | None) -> str:
    if measures.finding is not None:
        return f'<p class="note">Not measured: {text(measures.finding)}</p>'
    names = [*(name for name in FIRST if name in measures.measures), *sorted(measures.measures.keys() - set(FIRST))]
    if known is None or known.side != measures.side:
        rows = (_row(name, measures, name in drawings) for name in names)
        return table(["Measure", "Value", "± sd", "Unit", "Status"], rows, numeric=[1, 2], kind="plain")
    rows = (_row(name, measures, name in drawings, known) for name in names)
    note = f'<p class="note">{KNOWN}</p>'
    columns = ["Measure", "Value", "± sd", "Known", "Value minus known", "Unit", "Status"]
    return table(columns, rows, numeric=[1, 2, 3, 4], kind="plain") + note


def _row(name: str, measures: Measures, is_drawn: bool, known: KnownMeasures | None = None) -> list[str]:
    """The row of a measure; with `known`, what is known of it and how far the value is off follow."""
    measure, own = measures.measures[name], measures.own_note(name)
    unit, decimals = UNITS[measure.unit]
    value = number_or_dash(measure.value, decimals)
    label = text(words(name))
    if is_drawn:
        caption = text(f"{words(name)} {value} {unit}: {measure.definition}")
        attributes = f'data-shows="{text(name)}" data-told="{caption}" aria-pressed="false"'
        label = f'<button type="button" {attributes}>{label}</button>'
    note = f'<p class="note">{text(own)}</p>' if own and measure.status != "ok" else ""
    compared = [] if known is None else _compared(measure.value, known.measures.get(name), decimals)
    status = f'<span class="status {measure.status}">{measure.status}</span>'
    return [label + note, value, plus_minus(measure.uncertainty, decimals), *compared, unit, status]


def _compared(value: float | None, known: float | None, decimals: int) -> list[str]:
    if known is None:
        return ["–", "–"]
    return [number(known, decimals), "–" if value is None else number(value - known, decimals)]

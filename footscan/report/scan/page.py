"""The page of one scan, from which a person judges its quality."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.report.calibration.panels import calibration_panels
from footscan.report.colours import colour_bar, colour_limit, distance_colours
from footscan.report.comparison.figures import figures_facts, moved_note, regions_table
from footscan.report.filled import filled_colours, filled_key
from footscan.report.markup import UNITS, number, number_or_dash, plus_minus, section, table, text, words
from footscan.report.page import page
from footscan.report.sample_frames import FRAMES_SCRIPT
from footscan.report.scan.coverage import coverage_plot
from footscan.report.scan.foot_colours import FootSurface, foot_colourings
from footscan.report.scan.fusion_tables import corrections_table, disagreement_table, heads_table
from footscan.report.scan.glass_facts import glass_facts
from footscan.report.scan.measure_drawings import landmark_place, measure_drawings
from footscan.report.scan.mesh_facts import mesh_facts
from footscan.report.scan.movement_facts import movement_facts
from footscan.report.scan.pictures import ScanPictures
from footscan.report.scan.removed import removed_table
from footscan.report.scan_warnings import warnings_of
from footscan.report.size_table import size_table
from footscan.report.surface_views import surface_views, upright
from footscan.report.viewer import Drawing, viewer
from footscan.report.viewer_script import SCRIPT
from footscan.side_by_side import together
from schemas.calibration import Calibration
from schemas.measures import Measure, Measures
from schemas.quality import Comparison, Quality
from schemas.sizes import Sizes

_FIRST = (
    "foot_length",
    "foot_breadth",
    "foot_height",
    "ball_girth",
    "instep_girth",
    "waist_girth",
    "heel_girth",
    "heel_breadth",
    "instep_height",
    "arch_index",
)
"""Measures in the order in which they are read; others follow by name."""
_TILES = 4
"""Measures that stand out above the table: the first of them that have a value."""


class ScanTitle(NamedTuple):
    """Names of a scan, as in scan.yaml; any text is safe."""

    patient: str
    scan: str
    side: str


def scan_page(
    *,
    title: ScanTitle,
    surface: FootSurface,
    cloud: NDArray[np.void],
    measures: Measures,
    quality: Quality,
    calibration: Calibration,
    pictures: ScanPictures,
    provenance: Mapping[str, str],
    sizes: Sizes | None = None,
    notes: str = "",
) -> str:
    """Return a self-contained HTML page of one scan; the same input gives the same page.

    Parameters
    ----------
    cloud : (M,) of `footscan.cloud.points.POINT_DTYPE`, mm, scanner frame, from which the surface was made
    measures, quality : the content of measures.json and quality.json
    calibration : the calibration that mapped the pixels
    provenance : name and value of each source of the result, in the order shown
    sizes : of shoes for the foot
    notes : remarks of a person
    """
    faces, distance = surface.faces, surface.truth_distance
    seen = upright(surface.vertices, measures.transform)
    plain = filled_colours(surface.vertices, surface.filled, surface.cut_mm)
    drawings = measure_drawings(surface.vertices, faces, measures)
    landmarks = {words(name): landmark_place(measures, name) for name in measures.landmarks}
    turned, views, distances = together(
        [
            lambda: viewer(seen, faces, foot_colourings(surface, quality.mesh, cloud), drawings, landmarks),
            lambda: surface_views(seen, faces, plain, measures.side),
            lambda: "" if distance is None else _distances(seen, faces, measures, quality.truth, distance),
        ]
    )
    parts = [
        section("Warnings", _warnings(warnings_of(measures, quality))),
        section("Measures", _tiles(measures), _measures(measures, drawings, turned)),
        section("Notes", *(f"<p>{text(line)}</p>" for line in notes.splitlines() if line.strip())) if notes else "",
        section("Shoe sizes", size_table(sizes)) if sizes is not None and measures.finding is None else "",
        section("Surface", _GRID_NOTE, filled_key(quality.mesh), views),
        distances,
        section("Stripe over the frames", _FRAMES_NOTE, pictures.frames) if pictures.frames else "",
        section("Mesh", mesh_facts(quality.mesh, quality.cloud_points)),
        section("Cameras", _cameras_table(quality, cloud)),
        section("Removed points", _REMOVED_NOTE, removed_table(quality.cameras), pictures.removed),
        section(
            "Agreement of the cameras",
            _AGREEMENT_NOTE,
            heads_table(quality.heads),
            disagreement_table(quality.fusion),
            corrections_table(quality.fusion),
        ),
        section("Glass", glass_facts(quality.glass)),
        section("Movement of the foot", movement_facts(quality.movement)),
        section("Stripe coverage", _COVERAGE_NOTE, coverage_plot(cloud, quality.cameras)),
        section("Calibration", _calibration(calibration, quality)),
        section("Provenance", table(["", ""], ([text(name), text(value)] for name, value in provenance.items()))),
    ]
    return page(
        title=f"{title.patient} {title.scan}",
        kicker={"right": "Right foot", "left": "Left foot"}.get(title.side, "Foot, side unknown"),
        heading=f"{text(title.patient)} <span>{text(title.scan)}</span>",
        parts=parts,
        scripts=[SCRIPT, *([FRAMES_SCRIPT] if pictures.frames else [])],
    )


def _warnings(warnings: Sequence[str]) -> str:
    """The list of warnings; one sentence without them."""
    if not warnings:
        return "<p>None: all measures were taken, and every camera saw the foot.</p>"
    return '<ul class="missing">' + "".join(f"<li>{text(warning)}</li>" for warning in warnings) + "</ul>"


def _distances(
    seen: NDArray[np.float64],
    faces: NDArray[np.integer],
    measures: Measures,
    figures: Comparison | None,
    distance: NDArray[np.floating],
) -> str:
    """The section on the distance of the surface to the reference model; `seen` is in the foot's frame."""
    limit = colour_limit(distance)
    colours = distance_colours(distance, limit)
    tables = (
        []
        if figures is None
        else [
            figures_facts(figures),
            moved_note(figures.transform, _IN_ONE_FRAME),
            regions_table(figures.regions),
        ]
    )
    views = surface_views(seen, faces, colours, measures.side)
    return section("Distance to the reference model", colour_bar(limit), views, *tables)


def _ordered(measures: Measures) -> Iterator[tuple[str, Measure]]:
    for name in [*_FIRST, *sorted(measures.measures.keys() - set(_FIRST))]:
        if name in measures.measures:
            yield name, measures.measures[name]


def _tiles(measures: Measures) -> str:
    taken = [(name, measure) for name, measure in _ordered(measures) if measure.value is not None][:_TILES]
    tiles = "".join(
        f"<div><span>{text(words(name))}</span><b>{_value(measure)}</b> {UNITS[measure.unit][0]}</div>"
        for name, measure in taken
    )
    return f'<div class="tiles">{tiles}</div>' if tiles else ""


def _measures(measures: Measures, drawings: Mapping[str, Drawing], turned: str) -> str:
    """The viewer, and beside it the table of measures; a click on a measure shows where it was taken."""
    if measures.finding is not None:
        return f'<p class="note">Not measured: {text(measures.finding)}</p>{turned}'
    rows = (
        [
            _name(name, measure, name in drawings),
            _value(measure),
            plus_minus(measure.uncertainty, UNITS[measure.unit][1]),
            UNITS[measure.unit][0],
            f'<span class="status {measure.status}">{measure.status}</span>',
            text(measure.definition) + _note(measure, measures.own_note(name)),
        ]
        for name, measure in _ordered(measures)
    )
    listed = table(["Measure", "Value", "± sd", "Unit", "Status", "Definition"], rows, numeric=[1, 2], kind="measures")
    hint = '<p class="note">A click on a measure shows where it was taken.</p>' if drawings else ""
    return f'<div class="foot">{turned}<div class="list">{hint}{listed}{_STATUS_NOTE}</div></div>'


def _name(name: str, measure: Measure, is_drawn: bool) -> str:
    if not is_drawn:
        return text(words(name))
    caption = f"{words(name)} {_value(measure)} {UNITS[measure.unit][0]}: {measure.definition}"
    return (
        f'<button type="button" data-shows="{text(name)}" data-told="{text(caption)}" aria-pressed="false">'
        f"{text(words(name))}</button>"
    )


def _note(measure: Measure, own: str | None) -> str:
    """The note below the definition: its own remark, the causes of its standard deviation, and its ISO name."""
    decimals = UNITS[measure.unit][1] + 1
    causes = sorted((measure.budget or {}).items(), key=lambda cause: -cause[1])
    shown = [f"{cause} {number(sd, decimals)}" for cause, sd in causes if round(sd, decimals) > 0]
    origin = f"± from {', '.join(shown)}" if len(shown) > 1 else None
    iso = None if measure.convention is None else measure.convention.iso
    note = "; ".join(part for part in (own, origin, iso) if part)
    return f'<p class="note">{text(note)}</p>' if note else ""


def _value(measure: Measure) -> str:
    return number_or_dash(measure.value, UNITS[measure.unit][1])


def _cameras_table(quality: Quality, cloud: NDArray[np.void]) -> str:
    headings = ["Camera", "Frames", "Lost", "With stripe", "Points", "Removed", "In cloud", "Laser"]
    rows = [
        [
            camera.frames,
            camera.frames_lost,
            camera.frames_with_stripe,
            camera.points,
            sum(camera.removed.values()),
            int(np.count_nonzero(cloud["camera"] == camera.camera)),
        ]
        for camera in quality.cameras
    ]
    names = [str(camera.camera) for camera in quality.cameras]
    if len(rows) > 1:
        rows.append([sum(column) for column in zip(*rows, strict=True)])
        names.append("All")
    lasers = [camera.laser or "–" for camera in quality.cameras] + [""]
    cells = (
        [name, *(number(count) for count in row), laser]
        for name, row, laser in zip(names, rows, lasers[: len(rows)], strict=True)
    )
    return table(headings, cells, numeric=range(1, len(headings) - 1))


def _calibration(calibration: Calibration, quality: Quality) -> str:
    file, check = quality.calibration, quality.calibration_check
    created = f"{calibration.created:%Y-%m-%d %H:%M} UTC" if calibration.created else "unknown"
    state = "calibration was not checked" if check is None else check.summary()
    rows = [["File", text(file.name)], ["SHA-256", text(file.sha256)], ["Made", created], ["Check", text(state)]]
    return table(["", ""], rows) + calibration_panels(calibration)


_STATUS_NOTE = (
    '<p class="note">± is one standard deviation. Do not rely on an uncertain measure alone: the reason is below its '
    "definition.</p>"
)
_GRID_NOTE = '<p class="note">The grid is 10 mm wide; its figures are mm from the rearmost heel point on the floor.</p>'
_REMOVED_NOTE = (
    '<p class="note">Before the fusion; each point counts once, and a reason without a column removed nothing. The '
    "pictures show a camera’s points from the side, X to the right, and along the travel, Y to the left; the line is "
    "the calibrated glass.</p>"
)
_AGREEMENT_NOTE = (
    '<p class="note">Distances along the normal between what two cameras see of the same skin, before and after they '
    "were moved onto each other; the median is positive where the first sees it farther out. Held out: over stretches "
    "of the travel that took no part in the fit.</p>"
)
_COVERAGE_NOTE = (
    '<p class="note">Points of the cloud by the frame they come from, all cameras to one scale. '
    "On the right: the most of any frame.</p>"
)
_FRAMES_NOTE = '<p class="note">What the cameras saw along the travel, and the stripe points that were found in it.</p>'
_IN_ONE_FRAME = "The surface was not moved beforehand: both are in the scanner’s frame."

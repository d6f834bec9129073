"""The page of one scan: what a person opens to see whether it is good."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.report.calibration_figure import calibration_figure
from footscan.report.colours import colour_bar, colour_limit, distance_colours
from footscan.report.comparison_figures import figures_facts, moved_note, regions_table
from footscan.report.coverage import coverage_plot
from footscan.report.markup import data_uri, facts, number, section, table, text, words
from footscan.report.page import page
from footscan.report.sample_frames import FrameSample, sample_frames
from footscan.report.surface_views import surface_views
from footscan.report.viewer import viewer
from schemas.calibration import Calibration, Source
from schemas.measures import Measure, Measures
from schemas.quality import MeshQuality, Quality

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
_UNITS = {"mm": ("mm", 1), "mm2": ("mm²", 0), "mm3": ("mm³", 0), "deg": ("°", 1), "1": ("", 3)}
"""How a unit is written, and to how many decimals its values are."""
_PLAIN = np.array([224, 198, 178], np.uint8)


def scan_page(
    *,
    patient: str,
    scan: str,
    side: str,
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    cloud: NDArray[np.void],
    measures: Measures,
    quality: Quality,
    calibration: Calibration,
    samples: Sequence[FrameSample],
    truth_distance: NDArray[np.floating] | None,
    provenance: Mapping[str, str],
) -> str:
    """A self-contained HTML page of one scan, the same for the same input.

    Parameters
    ----------
    patient, scan, side : as in scan.yaml; any text is safe
    vertices : (V, 3) float64, mm, scanner frame, V > 0
    faces : (F, 3) int, counter-clockwise as seen from outside
    cloud : array of `footscan.cloud.points.POINT_DTYPE`, mm, scanner frame
        What the surface was made of.
    measures, quality : the content of measures.json and quality.json
    calibration : what its pixels were mapped by
    samples : a frame of each camera, in the order shown
    truth_distance : (V,) float, mm, signed, positive outside the reference model; None where there is no such model
    provenance : name and value of what the result came from, in the order shown
    """
    parts = [
        section("Measures", _tiles(measures), _measures_table(measures)),
        _surface(vertices, faces, measures, truth_distance),
    ]
    if quality.truth is not None:
        parts.append(
            section(
                "Distance to the reference model",
                figures_facts(quality.truth),
                moved_note(quality.truth.transform, _IN_ONE_FRAME),
                regions_table(quality.truth.regions),
            )
        )
    parts += [
        section("Cameras", _cameras_table(quality, cloud)),
        section("Stripe coverage", _COVERAGE_NOTE, coverage_plot(cloud, quality.cameras)),
        section("Sample frames", sample_frames(samples)) if samples else "",
        section("Calibration", _calibration(calibration, quality.calibration)),
        section("Mesh", _mesh(quality.mesh, quality.cloud_points)),
        section("Provenance", table(["", ""], ([text(name), text(value)] for name, value in provenance.items()))),
    ]
    return page(
        title=f"{patient} {scan}",
        kicker={"right": "Right foot", "left": "Left foot"}.get(side, "Foot, side unknown"),
        heading=f"{text(patient)} <span>{text(scan)}</span>",
        parts=parts,
    )


def upright(
    vertices: NDArray[np.float64], transform: Sequence[Sequence[float]] | NDArray[np.float64]
) -> NDArray[np.float64]:
    """(V, 3) vertices in mm, moved from the scanner's frame to the foot's by the 4 x 4 `transform` of its measures.

    X runs from heel to toes, Y to the foot's own left, Z up. The transform mirrors left feet into right ones; a picture
    shows the foot as it is, so this is undone.
    """
    matrix = np.array(transform, np.float64)
    if np.linalg.det(matrix[:3, :3]) < 0:
        matrix[1] *= -1
    moved: NDArray[np.float64] = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def _surface(
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    measures: Measures,
    truth_distance: NDArray[np.floating] | None,
) -> str:
    seen = upright(vertices, measures.transform)
    if truth_distance is None:
        colours, bar = np.tile(_PLAIN, (len(seen), 1)), ""
    else:
        limit = colour_limit(truth_distance)
        colours, bar = distance_colours(truth_distance, limit), colour_bar(limit)
    views = surface_views(seen, faces, colours, measures.side, last=viewer(seen, faces, colours))
    return section("Surface", _GRID_NOTE, bar, views)


def _ordered(measures: Measures) -> Iterator[tuple[str, Measure]]:
    for name in [*_FIRST, *sorted(measures.measures.keys() - set(_FIRST))]:
        if name in measures.measures:
            yield name, measures.measures[name]


def _tiles(measures: Measures) -> str:
    known = [(name, measure) for name, measure in _ordered(measures) if measure.value is not None][:_TILES]
    tiles = "".join(
        f"<div><span>{text(words(name))}</span><b>{_value(measure)}</b> {_UNITS[measure.unit][0]}</div>"
        for name, measure in known
    )
    return f'<div class="tiles">{tiles}</div>' if tiles else ""


def _measures_table(measures: Measures) -> str:
    if measures.finding is not None:
        return f'<p class="note">Not measured: {text(measures.finding)}</p>'
    rows = (
        [
            text(words(name)),
            _value(measure),
            _UNITS[measure.unit][0],
            f'<span class="status {measure.status}">{measure.status}</span>',
            text(measure.definition) + (f'<p class="note">{text(measure.note)}</p>' if measure.note else ""),
        ]
        for name, measure in _ordered(measures)
    )
    return table(["Measure", "Value", "Unit", "Status", "Definition"], rows, numeric=[1], kind="measures")


def _value(measure: Measure) -> str:
    return "–" if measure.value is None else number(measure.value, _UNITS[measure.unit][1])


def _cameras_table(quality: Quality, cloud: NDArray[np.void]) -> str:
    reasons = sorted({reason for camera in quality.cameras for reason in camera.removed})
    headings = [
        "Camera",
        "Frames",
        "Lost",
        "With stripe",
        "Points",
        *(f"Removed: {text(words(r))}" for r in reasons),
        "In cloud",
    ]
    rows = [
        [
            camera.frames,
            camera.frames_lost,
            camera.frames_with_stripe,
            camera.points,
            *(camera.removed.get(reason, 0) for reason in reasons),
            int(np.count_nonzero(cloud["camera"] == camera.camera)),
        ]
        for camera in quality.cameras
    ]
    names = [str(camera.camera) for camera in quality.cameras]
    if len(rows) > 1:
        rows.append([sum(column) for column in zip(*rows, strict=True)])
        names.append("All")
    cells = ([name, *(number(count) for count in row)] for name, row in zip(names, rows, strict=True))
    return table(headings, cells, numeric=range(1, len(headings)))


def _calibration(calibration: Calibration, file: Source) -> str:
    picture = data_uri("image/png", calibration_figure(calibration))
    made = f"{calibration.created:%Y-%m-%d %H:%M} UTC" if calibration.created else "unknown"
    rows = [["File", text(file.name)], ["SHA-256", text(file.sha256)], ["Made", made]]
    return table(["", ""], rows) + f'<img class="picture" src="{picture}" alt="Residuals and coverage of each camera">'


def _mesh(mesh: MeshQuality, cloud_points: int) -> str:
    closed = "Yes" if mesh.open_edges == 0 and mesh.non_manifold_edges == 0 else "No"
    counts = {
        "Cloud points": cloud_points,
        "Vertices": mesh.vertices,
        "Triangles": mesh.triangles,
        "Parts": mesh.components,
        "Open edges": mesh.open_edges,
        "Holes": mesh.holes,
        "Non-manifold edges": mesh.non_manifold_edges,
    }
    return facts([("Closed", closed), *((name, number(count)) for name, count in counts.items())])


_GRID_NOTE = '<p class="note">The grid is 10 mm wide; its figures are mm from the rearmost heel point on the floor.</p>'
_COVERAGE_NOTE = (
    '<p class="note">Points of the cloud by the frame they come from, all cameras to one scale. '
    "On the right: the most of any frame.</p>"
)
_IN_ONE_FRAME = "The surface was not moved beforehand: both are in the scanner’s frame."

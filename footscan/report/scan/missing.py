"""Refusals and gaps of a scan: what a reader must know before trusting its measures."""

from collections.abc import Iterator

from footscan.report.markup import number, text, words
from schemas.measures import Measures
from schemas.quality import MeshQuality, Quality

_MUCH_FILLED = 0.1
"""Filled share of the area above which the page mentions it; chosen by hand."""


def missing_list(measures: Measures, quality: Quality) -> str:
    """List all defects of a scan, the gravest first, as HTML; a scan without defects gets one sentence."""
    lines = [
        *_measures(measures),
        *_cameras(quality),
        *_mesh(quality.mesh),
        *quality.warnings,
        *quality.heads.warnings,
        *quality.fusion.warnings,
    ]
    if not lines:
        return "<p>Nothing: all measures were taken, no frame was lost, and every camera saw the foot.</p>"
    return '<ul class="missing">' + "".join(f"<li>{text(line)}</li>" for line in lines) + "</ul>"


def _measures(measures: Measures) -> Iterator[str]:
    if measures.finding is not None:
        yield f"Not measured: {measures.finding}."
    for warning in measures.warnings:
        yield f"{warning[:1].upper()}{warning[1:]}."
    in_common = bool(measures.doubts or measures.things)
    if in_common:
        yield "All measures are uncertain for that reason."
    for status, reading in (("incomplete", "could not be taken"), ("uncertain", "is uncertain")):
        for name, measure in measures.measures.items():
            if measure.status == status:
                own = measures.own_note(name)
                if own or not in_common:
                    yield f"{words(name)} {reading}" + (f": {own}." if own else ".")


def _cameras(quality: Quality) -> Iterator[str]:
    for camera in quality.cameras:
        if camera.frames_lost:
            yield f"Camera {camera.camera}: {camera.frames_lost} of {camera.frames} frames are lost."
        if not camera.points:
            yield f"Camera {camera.camera} saw no stripe."


def _mesh(mesh: MeshQuality) -> Iterator[str]:
    if mesh.holes:
        longest = number(mesh.largest_hole_mm)
        yield f"The surface is open: holes {mesh.holes}, the largest {longest} mm around."
    if mesh.filled_share is not None and mesh.filled_share > _MUCH_FILLED:
        yield f"{number(100 * mesh.filled_share, 1)} % of the surface was seen by no camera and is filled."

"""Figures of the results of a scan; for each figure, which values are better, and its tolerance."""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from pipelines.arrays import unpack
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.regression import Suite, Tolerance

Goal = Literal["less", "more", "nearer", "same"]
"""`nearer`: to the true value of the foot; `same`: any value that differs from the accepted one is worse."""

GOALS: dict[str, Goal] = {
    "*.worlds": "same",
    "*.measured": "more",
    "*.right_measures": "more",
    "*.warned": "less",
    "*.crashed": "less",
    "*.refused_rightly": "same",
    "*.silent_*": "less",
    "*.refused_needlessly": "less",
    "accuracy.within_1mm": "more",
    "accuracy.*": "less",
    "cameras.filmed": "more",
    "cameras.frames_lost": "less",
    "cameras.disagreement_mm": "less",
    "files.*": "less",
    "measures.uncertain": "less",
    "measures.missing": "less",
    "measures.*": "nearer",
    "points.*": "same",
    "steps.all": "same",
    "steps.*": "less",
    "surface.coloured_share": "more",
    "surface.triangle_quality": "more",
    "surface.triangles": "same",
    "surface.*": "less",
    "time.*": "less",
    "memory.*": "less",
}
"""Goal of a figure: that of the first pattern that fits."""

WRITING = Tolerance(absolute=12.0, relative=1.0)
"""Tolerance of the time of steps that write many files: no reference computation tells the speed of a shared disk.

Chosen by hand."""
TOLERANCES: dict[str, Tolerance] = {
    "accuracy.within_1mm": Tolerance(absolute=0.002),
    "accuracy.*": Tolerance(absolute=0.003, relative=0.02),
    "cameras.disagreement_mm": Tolerance(absolute=0.005),
    "files.*_mm": Tolerance(absolute=0.001),
    "measures.*_mm": Tolerance(absolute=0.1),
    "measures.*_mm2": Tolerance(relative=0.005),
    "measures.*_mm3": Tolerance(relative=0.005),
    "measures.*_deg": Tolerance(absolute=0.2),
    "measures.*_1": Tolerance(absolute=0.003),
    "surface.filled_share": Tolerance(absolute=0.002),
    "surface.coloured_share": Tolerance(absolute=0.005),
    "surface.largest_hole_mm": Tolerance(absolute=1.0),
    "surface.triangle_quality": Tolerance(absolute=0.005),
    "surface.triangles": Tolerance(relative=0.01),
    "time.ingest": WRITING,
    "time.background": WRITING,
    "time.*": Tolerance(absolute=6.0, relative=0.6),
    "memory.peak_mb": Tolerance(absolute=100.0, relative=0.25),
    "memory.*_mb": Tolerance(absolute=60.0, relative=0.5),
}
"""Tolerance of a figure: that of the first pattern that fits; chosen by hand.

Counts of points, cameras and steps are reproducible, so they have none."""


def goal_of(figure: str) -> Goal:
    """Goal of a figure; default: `same`."""
    return next((goal for pattern, goal in GOALS.items() if fnmatchcase(figure, pattern)), "same")


def tolerance_of(data_set: str, figure: str, suite: Suite) -> Tolerance:
    """Tolerance of a figure of a set: that of the suite, or by default of `TOLERANCES`."""
    for pattern, tolerance in reversed(suite.tolerances.items()):
        if fnmatchcase(f"{data_set}:{figure}", pattern) or fnmatchcase(figure, pattern):
            return tolerance
    return next((t for pattern, t in TOLERANCES.items() if fnmatchcase(figure, pattern)), Tolerance())


def result_figures(documents: Mapping[str, bytes]) -> dict[str, float | None]:
    """Figures of the results of the steps `quality`, `measure` and, if present, `texture`."""
    quality = Quality.model_validate_json(documents["quality"])
    measures = Measures.model_validate_json(documents["measure"])
    figures: dict[str, float | None] = {}
    if (truth := quality.truth) is not None:
        figures |= {"accuracy.mean_mm": truth.mean, "accuracy.p99_mm": truth.p99, "accuracy.max_mm": truth.max}
        if truth.completeness is not None:
            figures["accuracy.within_1mm"] = truth.completeness.within_share
    figures |= _of_cameras(quality)
    figures |= {measure_figure(name, m.unit): m.value for name, m in measures.measures.items()}
    states = [m.status for m in measures.measures.values()]
    figures |= {"measures.uncertain": states.count("uncertain"), "measures.missing": states.count("incomplete")}
    mesh = quality.mesh
    figures |= {
        "surface.triangles": mesh.triangles,
        "surface.holes": mesh.holes,
        "surface.largest_hole_mm": mesh.largest_hole_mm,
        "surface.open_edges": mesh.open_edges,
        "surface.components": mesh.components,
        "surface.filled_share": mesh.filled_share,
        "surface.triangle_quality": mesh.triangle_quality,
    }
    if "texture" in documents:
        colours = unpack(documents["texture"]).get("colours")
        figures["surface.coloured_share"] = 0.0 if colours is None else float(np.mean(np.ptp(colours, axis=1) > 0))
    return figures


def measure_figure(measure: str, unit: str) -> str:
    """Name of the figure of a measure."""
    return f"measures.{measure}_{unit}"


def rounded(figure: str, value: float | None) -> float | None:
    """Round a figure to the decimals that it has in the baseline."""
    return None if value is None else round(value, _decimals(figure))


def _decimals(figure: str) -> int:
    group = figure.partition(".")[0]
    if group in {"time", "memory"}:
        return 1
    if figure.endswith(("_mm2", "_mm3", "_deg")):
        return 2
    return 4 if figure.endswith("_mm") else 5


def _of_cameras(quality: Quality) -> dict[str, float | None]:
    figures: dict[str, float | None] = {
        "cameras.filmed": len(quality.cameras),
        "cameras.frames_lost": sum(camera.frames_lost for camera in quality.cameras),
        "points.cloud": quality.cloud_points,
        "points.stripe": sum(camera.points for camera in quality.cameras),
        "points.removed": sum(sum(camera.removed.values()) for camera in quality.cameras),
    }
    figures |= {f"points.camera-{camera.camera}": camera.points for camera in quality.cameras}
    pairs = [(pair.points, pair.after.rms_mm) for pair in quality.fusion.pairs]
    if compared := sum(points for points, _ in pairs):
        square = sum(points * rms**2 for points, rms in pairs) / compared
        figures["cameras.disagreement_mm"] = float(np.sqrt(square))
    return figures

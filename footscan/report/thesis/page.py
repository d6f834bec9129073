"""The page of `footscan thesis`: what is printed, the thesis's method on our films, and footscan."""

from collections.abc import Callable, Mapping, Sequence

from footscan.report.comparison.figures import histogram_plot
from footscan.report.markup import data_uri, number, section, table, text, words
from footscan.report.page import page
from footscan.thesis.mistakes import mistakes
from footscan.thesis.printed import FOOT_MAX_MM, FOOT_MEAN_MM, RESOLUTION_MM, WITHIN_SHARE
from footscan.thesis.reproduced import CameraFit, Coefficient, camera_fits, coefficients
from schemas.thesis import ClickedCorners, FootMeasure, Method, ReconstructedFoot, Stage, StageOutcome, ThesisResult

METHODS: Mapping[Method, str] = {
    "thesis": "Its method on our films",
    "thesis-all-corners": "The same, quadratic through all corners",
    "footscan": "footscan",
}
STAGES: Mapping[Stage, str] = {
    "calibration": "quadratic through five corners",
    "all-corners": "quadratic through all corners",
    "extraction": "its extraction",
    "outliers": "its outliers",
    "fusion": "its fusion",
    "surface": "its surface",
}
NONE = "–"


def thesis_page(result: ThesisResult, reference_figure: bytes) -> str:
    """Draw the page as HTML.

    `reference_figure` : PNG of the reference object as a cloud of eight cameras
    """
    feet = {foot.method: foot for foot in result.feet}
    parts = [
        section("The block, Table 6-1", _block(result)),
        section("The foot, Table 6-2", _foot(feet), *(_histograms(feet[method]) for method in METHODS)),
        section("Measures of the foot", _measures(feet)),
        section("The reference object, Figures 4-7 and 4-8", _figure(reference_figure), _corners(result.corners)),
        section("Which stage gains what", *_stages(result.stages)),
        section("Coefficients, Table 4-3", _agreement(result), _coefficients(coefficients())),
        section("Observed coordinates, Appendices A and B", *_observed(camera_fits())),
        section("Mistakes in the print", _mistakes()),
    ]
    return page(
        title="The thesis beside footscan", kicker="footscan thesis", heading="The thesis beside footscan", parts=parts
    )


def stage_rows(stages: Sequence[StageOutcome]) -> list[list[str]]:
    """A row for each set of exchanged stages: its name, then mean, p99 and length error of each world, mm."""
    seeds = list(dict.fromkeys(stage.seed for stage in stages))
    rows = []
    for exchanged in dict.fromkeys(stage.exchanged for stage in stages):
        own = {stage.seed: stage for stage in stages if stage.exchanged == exchanged}
        rows.append([stage_name(exchanged), *(_stage(own.get(seed)) for seed in seeds)])
    return rows


def stage_name(exchanged: Sequence[Stage]) -> str:
    """Name of a set of exchanged stages.

    >>> print(stage_name(()), stage_name(("surface",)), stage_name(("calibration", "outliers")), sep="; ")
    footscan; footscan, its surface; the thesis, quadratic through five corners
    """
    if len(exchanged) > 1:
        return f"the thesis, {STAGES[exchanged[0]]}"
    return ", ".join(["footscan", *(STAGES[stage] for stage in exchanged)])


def _stage(stage: StageOutcome | None) -> str:
    if stage is None or stage.mean_mm is None or stage.p99_mm is None:
        return "no result"
    length = "not measured" if stage.length_error_mm is None else f"{stage.length_error_mm:+.2f}"
    doubt = "" if stage.length_status in (None, "ok") else f" ({stage.length_status})"
    return f"{stage.mean_mm:.3f}, {stage.p99_mm:.2f}, {length}{doubt}"


def _block(result: ThesisResult) -> str:
    rows = [
        [number(row.nominal_mm), number(row.printed_mm, 1), *(_mm(row.found_mm[method]) for method in METHODS)]
        for row in result.block
    ]
    return table(["True, mm", "Thesis, print", *METHODS.values()], rows, numeric=range(5))


def _foot(feet: Mapping[Method, ReconstructedFoot]) -> str:
    def row(name: str, printed: str, value: Callable[[ReconstructedFoot], str]) -> list[str]:
        return [name, printed, *(value(feet[method]) for method in METHODS)]

    def of(figure: str) -> Callable[[ReconstructedFoot], str]:
        return lambda foot: NONE if foot.comparison is None else number(getattr(foot.comparison, figure), 3)

    def missing(foot: ReconstructedFoot) -> str:
        complete = None if foot.comparison is None else foot.comparison.completeness
        return (
            NONE if complete is None else f"{number(100 * complete.within_share, 1)} % within {complete.within_mm:g} mm"
        )

    rows = [
        row("Mean distance, mm", number(FOOT_MEAN_MM, 2), of("mean")),
        row("Standard deviation, mm", NONE, of("std")),
        row("99 %, mm", NONE, of("p99")),
        row("Greatest, mm", number(FOOT_MAX_MM, 1), of("max")),
        row("Within 1 mm, scan to truth", f"{100 * WITHIN_SHARE:g} %", _within),
        row("Truth to scan", NONE, missing),
        row("Resolution, mm", number(RESOLUTION_MM, 2), lambda foot: _mm(foot.resolution_mm)),
        row("Holes, perimeter in mm", NONE, _holes),
    ]
    return table(["", "Thesis, print", *METHODS.values()], rows, numeric=range(1, 5))


def _within(foot: ReconstructedFoot) -> str:
    return NONE if foot.within_share is None else f"{number(100 * foot.within_share, 1)} %"


def _holes(foot: ReconstructedFoot) -> str:
    return ", ".join(number(hole) for hole in foot.holes_mm[:5]) or "none"


def _histograms(foot: ReconstructedFoot) -> str:
    if foot.comparison is None:
        return f'<p class="note">{text(foot.problem or "no surface")}</p>'
    plots = [histogram_plot(one) for one in foot.comparison.histograms if not one.signed]
    return f"<h3>{METHODS[foot.method]}</h3>" + "".join(plots)


def _measures(feet: Mapping[Method, ReconstructedFoot]) -> str:
    names = list(dict.fromkeys(name for foot in feet.values() for name in foot.measures))
    rows = []
    for name in names:
        found = [feet[method].measures.get(name) for method in METHODS]
        true = next(measure.truth for measure in found if measure is not None)
        rows.append([text(words(name)), number(true, 2), *map(_measure, found)])
    return table(["Measure", "True", *METHODS.values()], rows, numeric=range(1, 5))


def _measure(measure: FootMeasure | None) -> str:
    if measure is None or measure.value is None:
        return NONE
    return number(measure.value, 2) + ("" if measure.status == "ok" else f" {measure.status}")


def _figure(png: bytes) -> str:
    caption = "The stripes of the eight cameras on the reference object, across the travel, mm; its outline in black."
    return (
        f'<figure><img src="{data_uri("image/png", png)}" alt="{caption}"><figcaption>{caption}</figcaption></figure>'
    )


def _corners(corners: Sequence[ClickedCorners]) -> str:
    rows = [
        ["all" if one.points is None else str(one.points), number(one.median_mm, 2), number(one.worst_mm, 1)]
        for one in corners
    ]
    return table(["Corners of each camera", "Median error at all corners, mm", "Worst, mm"], rows, numeric=range(3))


def _stages(stages: Sequence[StageOutcome]) -> list[str]:
    if not stages:
        return ['<p class="note">No worlds were filmed.</p>']
    seeds = list(dict.fromkeys(stage.seed for stage in stages))
    note = (
        "Each cell: mean and 99 % of the distances from the true surface, error of the foot length; mm. Scanners and "
        "feet are drawn at random, assembled at home, and filmed."
    )
    headings = ["Method", *(f"World {seed}" for seed in seeds)]
    return [
        f'<p class="note">{note}</p>',
        table(headings, [[text(cell) for cell in row] for row in stage_rows(stages)]),
    ]


def _agreement(result: ThesisResult) -> str:
    return (
        f'<p class="note">{result.agreeing} of {result.coefficients} printed rows agree with the fit to Table 4-2.</p>'
    )


def _coefficients(rows: Sequence[Coefficient]) -> str:
    cells = [
        [
            str(row.printed.camera), text(row.printed.term), f"{row.printed.alpha_y:g}", f"{row.alpha_y:.7f}",
            f"{row.printed.alpha_z:g}", f"{row.alpha_z:.7f}", "yes" if row.agrees else "no",
        ]
        for row in rows
    ]  # fmt: skip
    headings = ["Camera", "Term", "Y, print", "Y, fit", "Z, print", "Z, fit", "agrees"]
    return table(headings, cells, numeric=range(2, 6))


def _observed(fits: Sequence[CameraFit]) -> list[str]:
    rows = []
    for camera in fits:
        for k, name in enumerate(camera.chart.points):
            true, exact, rounded = camera.chart.world[k, 1:], camera.observed[k], camera.observed_rounded[k]
            cells = [f"{one[axis]:.4f}" for axis in (0, 1) for one in (true, exact, rounded)]
            rows.append([f"{camera.chart.camera}, {text(name)}", *cells])
    headings = ["Camera, point", "Y, cm", "exact", "rounded", "Z, cm", "exact", "rounded"]
    r2 = [
        [str(camera.chart.camera), *(f"{100 * (one or 0.0):.2f}" for one in (camera.fit.r2_y, camera.fit.r2_z)),
         *(f"{100 * one:.2f}" for one in camera.r2_rounded)]
        for camera in fits
    ]  # fmt: skip
    return [
        table(["Camera", "R² of Y, %", "R² of Z, %", "R² of Y, rounded", "R² of Z, rounded"], r2, numeric=range(1, 5)),
        table(headings, rows, numeric=range(1, 7)),
    ]


def _mistakes() -> str:
    rows = [[text(mistake.place), text(mistake.printed), text(mistake.reason)] for mistake in mistakes()]
    return table(["Where", "Print", "Reason"], rows)


def _mm(value: float | None) -> str:
    return NONE if value is None else number(value, 2)

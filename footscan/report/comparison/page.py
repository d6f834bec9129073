"""The page of one comparison: the distances from one shape to another."""

from footscan.report.colours import colour_bar, colour_limit
from footscan.report.comparison.figures import figures_facts, histogram_plot, moved_note, regions_table
from footscan.report.deviation import Deviation, drawn
from footscan.report.markup import facts, number, section, table, text
from footscan.report.page import page
from footscan.report.surface_views import surface_views
from footscan.report.viewer import Colouring, viewer
from footscan.report.viewer_script import SCRIPT
from footscan.verify.register import Registration
from schemas.quality import Comparison, Completeness


def comparison_page(
    first: str, second: str, comparison: Comparison, deviation: Deviation, registration: Registration | None
) -> str:
    """Return a self-contained HTML page; the same input gives the same page.

    Parameters
    ----------
    first, second : names of the two shapes; any text is safe
    comparison : of the first to the second
    deviation : of each vertex of the first
    registration : the registration of the first to the second before the comparison, if any

    Raises
    ------
    RefusedInput
        The first shape is too small or too large for a picture in mm.
    """
    vertices, faces, colours = drawn(deviation)
    is_mesh = len(deviation.faces) > 0
    turned = viewer(vertices, faces, [Colouring("", colours)]) if is_mesh else ""
    grid = "the rearmost heel point on the floor" if deviation.side else "its own origin"
    parts = [
        section("Distances", figures_facts(comparison), moved_note(comparison.transform, _IN_ONE_FRAME)),
        section(
            "Surface",
            f'<p class="note">The grid is 10 mm wide; its figures are mm from {grid}.</p>',
            colour_bar(colour_limit(deviation.distance), signed=deviation.signed),
            surface_views(vertices, faces, colours, deviation.side, last=turned),
        ),
    ]
    if registration is not None:
        parts.insert(1, _registration(registration))
    if comparison.regions:
        parts.append(section("Regions of the foot", _REGIONS_NOTE, regions_table(comparison.regions)))
    if comparison.histograms:
        parts.append(section("Classes", *map(histogram_plot, comparison.histograms)))
    if comparison.completeness is not None:
        parts.append(_completeness(comparison.completeness))
    return page(
        title=f"{first} to {second}",
        kicker="Comparison",
        heading=f"{text(first)} <span>to {text(second)}</span>",
        parts=parts,
        scripts=[SCRIPT] if is_mesh else [],
    )


def _registration(registration: Registration) -> str:
    names = {"rms": "RMS", "mean": "Mean", "median": "50 %"}
    rows = [
        [moment, *(number(getattr(residuals, name), 3) for name in names), number(100 * residuals.inliers, 1)]
        for moment, residuals in (("Before", registration.before), ("After", registration.after))
    ]
    headings = ["Residuals", *(f"{name}, mm" for name in names.values()), "Inliers, %"]
    agreeing, starts, verdict = registration.agreeing, registration.starts, registration.verdict
    sentence = f"{agreeing} of {starts} starts were followed to this pose; verdict: {verdict}."
    return section("Registration", table(headings, rows, numeric=range(1, 5)), f'<p class="note">{text(sentence)}</p>')


def _completeness(completeness: Completeness) -> str:
    share = f"{number(100 * completeness.within_share, 1)} %"
    return section(
        "Completeness",
        '<p class="note">The other way: distances of the second shape to the first.</p>',
        facts([(f"Within {number(completeness.within_mm, 1)} mm", share)]),
        figures_facts(completeness),
        regions_table(completeness.regions),
    )


_IN_ONE_FRAME = "The surface was not moved beforehand: both are taken to be in one frame."
_REGIONS_NOTE = (
    '<p class="note">Heel, midfoot and ball are thirds of the foot without its toes, which begin at 80 % of '
    "its length; below 4 % of the length is the sole, above 25 % the ankle.</p>"
)

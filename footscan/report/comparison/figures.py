"""Figures of a comparison as markup: facts, regions, classes."""

from collections.abc import Sequence

from footscan.report.markup import facts, number, number_or_dash, table, text, words
from schemas.quality import Figures, Histogram, RegionFigures

_FIGURES = {
    "mean": "Mean",
    "std": "Std. dev.",
    "rms": "RMS",
    "p50": "50 %",
    "p90": "90 %",
    "p95": "95 %",
    "p99": "99 %",
    "min": "Least",
    "max": "Greatest",
    "signed_mean": "Signed mean",
    "signed_std": "Signed std. dev.",
    "signed_min": "Farthest inside",
    "signed_max": "Farthest outside",
}
_OF_REGIONS = ("mean", "std", "rms", "p50", "p95", "max", "signed_mean")
_WIDTH, _HEIGHT, _LEFT, _BELOW = 600, 150, 34, 26
"""Size and margins of the drawn histogram, in units of the drawing."""


def figures_facts(figures: Figures) -> str:
    """Name and value of each known figure."""
    values = [(title, getattr(figures, name)) for name, title in _FIGURES.items()]
    pairs = [(title, f"{number(value, 3)} mm") for title, value in values if value is not None]
    return facts(pairs if figures.points is None else [("Points", number(figures.points)), *pairs])


def moved_note(transform: Sequence[Sequence[float]] | None, unmoved: str) -> str:
    """A note on the matrix that moved the surface before the comparison; `unmoved` without a matrix."""
    rows = "; ".join(", ".join(number(value, 4) for value in line) for line in transform or [])
    sentence = f"The surface was moved beforehand, by the matrix {rows}." if transform else unmoved
    return f'<p class="note">{text(sentence)}</p>'


def regions_table(regions: Sequence[RegionFigures]) -> str:
    """A row for each region of the foot; empty without regions."""
    if not regions:
        return ""
    headings = ["Region", "Points", *(f"{_FIGURES[name]}, mm" for name in _OF_REGIONS)]
    rows = [
        [
            text(words(region.region)),
            number_or_dash(region.points),
            *(number_or_dash(getattr(region, name), 3) for name in _OF_REGIONS),
        ]
        for region in regions
    ]
    return table(headings, rows, numeric=range(1, len(headings)))


def histogram_plot(histogram: Histogram) -> str:
    """Draw the classes as bars over their distances in mm, with a table that opens on demand."""
    edges, most = histogram.edges_mm, max(histogram.shares)
    across, up = (_WIDTH - _LEFT) / (edges[-1] - edges[0]), (_HEIGHT - _BELOW) / most
    bars = "".join(
        f'<rect class="class" x="{_LEFT + (low - edges[0]) * across:.2f}" y="{_HEIGHT - _BELOW - share * up:.2f}" '
        f'width="{(high - low) * across:.2f}" height="{share * up:.2f}"/>'
        for low, high, share in zip(edges, edges[1:], histogram.shares, strict=False)
    )
    ticks = "".join(
        f'<text x="{_LEFT + k / 4 * (_WIDTH - _LEFT):.0f}" y="{_HEIGHT - 12}" '
        f'text-anchor="{"end" if k == 4 else "middle"}">{number(edges[0] + k / 4 * (edges[-1] - edges[0]), 2)}</text>'
        for k in range(5)
    )
    kind = "signed distances" if histogram.signed else "distances"
    caption = f"{len(histogram.counts)} classes of {kind} in mm, share of the points"
    return (
        f'<figure class="histogram"><figcaption>{caption}</figcaption>'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{caption}">{bars}'
        f'<path class="g5" d="M{_LEFT} 0V{_HEIGHT - _BELOW}H{_WIDTH}"/>{ticks}'
        f'<text x="{_LEFT - 3}" y="8" text-anchor="end">{number(100 * most, 1)} %</text></svg>'
        f"<details><summary>Figures</summary>{_classes_table(histogram)}</details></figure>"
    )


def _classes_table(histogram: Histogram) -> str:
    edges = histogram.edges_mm
    rows = [
        [number(low, 4), number(high, 4), number(count), number(100 * share, 2)]
        for low, high, count, share in zip(edges, edges[1:], histogram.counts, histogram.shares, strict=False)
    ]
    return table(["From, mm", "To, mm", "Points", "Share, %"], rows, numeric=range(4))

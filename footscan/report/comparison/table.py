"""CSV of a comparison, for a spreadsheet."""

from collections.abc import Iterator

from schemas.quality import Comparison, Figures, Histogram
from schemas.tables import Cell, csv_text

FIGURES = tuple(Figures.model_fields)


def comparison_csv(comparison: Comparison) -> str:
    """Write one row for the whole shape, one for each region and one for each class.

    The column `table` tells them apart: `whole`, `region`, `completeness` (the reverse comparison; its first row is the
    whole shape), `unsigned` and `signed` (classes). Lengths are mm; values that a row does not have are empty.
    """
    return csv_text(_rows(comparison))


def _rows(comparison: Comparison) -> Iterator[list[Cell]]:
    yield ["table", "name", "from_mm", "to_mm", "share", *FIGURES]
    yield ["whole", *_EMPTY[:4], *_cells(comparison)]
    yield from (["region", region.region, *_EMPTY[:3], *_cells(region)] for region in comparison.regions)
    if (completeness := comparison.completeness) is not None:
        yield ["completeness", "", 0, completeness.within_mm, completeness.within_share, *_cells(completeness)]
        yield from (["completeness", region.region, *_EMPTY[:3], *_cells(region)] for region in completeness.regions)
    for histogram in comparison.histograms:
        yield from _classes(histogram)


_EMPTY = [""] * len(FIGURES)


def _cells(figures: Figures) -> list[float | None]:
    return [getattr(figures, name) for name in FIGURES]


def _classes(histogram: Histogram) -> Iterator[list[Cell]]:
    table = "signed" if histogram.signed else "unsigned"
    edges = histogram.edges_mm
    for number, (count, share) in enumerate(zip(histogram.counts, histogram.shares, strict=True)):
        points = [count if name == "points" else "" for name in FIGURES]
        yield [table, number + 1, edges[number], edges[number + 1], share, *points]

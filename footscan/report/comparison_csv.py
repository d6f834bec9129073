"""A comparison as CSV, for a spreadsheet."""

import csv
import io
from collections.abc import Iterator

from schemas.quality import Comparison, Figures, Histogram

FIGURES = tuple(Figures.model_fields)


def comparison_csv(comparison: Comparison) -> str:
    """One row for the whole, one for each region and one for each class.

    The column `table` tells them apart: `whole`, `region`, `completeness` (the other way; its first row is the whole),
    `unsigned` and `signed` (classes). Lengths are mm; what a row does not have is empty.
    """
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["table", "name", "from_mm", "to_mm", "share", *FIGURES])
    writer.writerow(["whole", *_EMPTY[:4], *_cells(comparison)])
    writer.writerows(["region", region.region, *_EMPTY[:3], *_cells(region)] for region in comparison.regions)
    if (found := comparison.completeness) is not None:
        writer.writerow(["completeness", "", 0, found.within_mm, found.within_share, *_cells(found)])
        writer.writerows(["completeness", region.region, *_EMPTY[:3], *_cells(region)] for region in found.regions)
    for histogram in comparison.histograms:
        writer.writerows(_classes(histogram))
    return out.getvalue()


_EMPTY = [""] * len(FIGURES)


def _cells(figures: Figures) -> list[float | None]:
    return [getattr(figures, name) for name in FIGURES]


def _classes(histogram: Histogram) -> Iterator[list[object]]:
    table = "signed" if histogram.signed else "unsigned"
    edges = histogram.edges_mm
    for number, (count, share) in enumerate(zip(histogram.counts, histogram.shares, strict=True)):
        points = [count if name == "points" else "" for name in FIGURES]
        yield [table, number + 1, edges[number], edges[number + 1], share, *points]

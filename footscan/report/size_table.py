"""Sizes and widths of shoes as a table."""

from footscan.report.markup import table, text
from schemas.sizes import Sizes


def size_table(sizes: Sizes) -> str:
    """A row for each system: the size or width, and unrounded, since two feet of one size differ."""
    rows = [
        [
            text(size.label),
            text(", ".join(size.people)),
            f"<b>{text(size.size or '–')}</b>",
            "–" if size.unrounded is None else f"{size.unrounded:.2f}",
            text(size.note or ""),
        ]
        for size in sizes.sizes
    ]
    rows += [
        [
            text(width.label),
            text(", ".join(width.people)),
            f"<b>{text(width.width or '–')}</b>",
            "–" if width.steps is None else f"{text(width.middle)} {width.steps:+.2f}",
            text(width.note or ""),
        ]
        for width in sizes.widths
    ]
    caution = f'<p class="note">{text(sizes.caution[:1].upper() + sizes.caution[1:])}.</p>'
    return table(["System", "For", "Size", "Unrounded", ""], rows, numeric=[3]) + caution

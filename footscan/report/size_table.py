"""Sizes and widths of shoes as a table."""

from footscan.report.markup import table, text
from schemas.sizes import Sizes


def size_table(sizes: Sizes) -> str:
    """A row for each system: the size or width, and unrounded, since two feet of one size differ."""
    found = [
        (one.label, one.people, one.size, None if one.unrounded is None else f"{one.unrounded:.2f}", one.note)
        for one in sizes.sizes
    ]
    found += [
        (one.label, one.people, one.width, None if one.steps is None else f"{one.middle} {one.steps:+.2f}", one.note)
        for one in sizes.widths
    ]
    rows = [
        [text(label), text(", ".join(people)), f"<b>{text(size or '–')}</b>", text(unrounded or "–"), text(note or "")]
        for label, people, size, unrounded, note in found
    ]
    caution = f'<p class="note">{text(sizes.caution[:1].upper() + sizes.caution[1:])}.</p>'
    return table(["System", "For", "Size", "Unrounded", ""], rows, numeric=[3]) + caution

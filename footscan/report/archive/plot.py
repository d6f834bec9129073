"""The page that plots any measure of an archive against another, a point a scan with a link to its report."""

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from footscan.report.archive.plot_script import SCRIPT
from footscan.report.markup import number, section, text
from footscan.report.page import page


class PlotColumn(NamedTuple):
    """A column of numbers that may be an axis."""

    name: str
    unit: str
    values: Sequence[float | None]
    """Of each scan."""
    trusted: Sequence[bool]
    """False where the value is not `ok`."""


def plot_page(
    scans: Sequence[str],
    reports: Sequence[str | None],
    columns: Sequence[PlotColumn],
    groups: Mapping[str, Sequence[str]],
) -> str:
    """A self-contained page.

    Parameters
    ----------
    scans : name of each scan; any text
    reports : address of each scan's report relative to the page, if it has one
    columns : the first two are the axes at the start
    groups : texts of each scan by which points may be coloured, such as the side
    """
    names = list(dict.fromkeys(column.name for column in columns))
    data = {
        "scans": list(scans),
        "reports": list(reports),
        "columns": {column.name: [None if v is None else round(v, 4) for v in column.values] for column in columns},
        "units": {column.name: column.unit for column in columns},
        # Few values are not `ok`: their places, not a list of all.
        "untrusted": {c.name: [k for k, is_ok in enumerate(c.trusted) if not is_ok] for c in columns},
        "groups": {name: list(values) for name, values in groups.items()},
    }
    options = "".join(f'<option value="{text(name)}">{text(name)}</option>' for name in names)
    colours = "".join(f'<option value="{text(name)}">{text(name)}</option>' for name in ["", *groups])
    controls = (
        f'<div class="controls"><label>Across <select id="across">{options}</select></label>'
        f'<label>Up <select id="up">{options}</select></label>'
        f'<label>Colour <select id="colour">{colours}</select></label>'
        '<label><input id="uncertain" type="checkbox" checked> with values that are not ok (hollow)</label></div>'
    )
    plot = (
        '<canvas id="plot" role="img" aria-label="A point for each scan"></canvas>'
        '<p id="under" class="note" aria-live="polite"></p><p id="key" class="note"></p>'
    )
    packed = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return page(
        title="Measures of an archive",
        kicker="Archive",
        heading=f"{number(len(scans))} scan{'s' * (len(scans) != 1)}",
        parts=[
            section("Measures", controls, plot),
            f'<div id="data" hidden data-plot="{text(packed)}"></div>',
        ],
        scripts=[SCRIPT],
        style=_STYLE,
    )


_STYLE = """
.controls { display: flex; flex-wrap: wrap; gap: 8px 20px; margin-bottom: 12px; }
#plot { display: block; width: 100%; height: min(70vh, 620px); cursor: crosshair; }
#key span { margin-right: 16px; }
#key i { display: inline-block; width: 10px; height: 10px; margin-right: 5px; border-radius: 50%; }
"""

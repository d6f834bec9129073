"""The page of an archive: a table of its scans with filters and sorting; both feet of a patient stand side by side."""

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from footscan.report.archive.script import SCRIPT
from footscan.report.markup import number, text
from footscan.report.page import page
from footscan.report.quality_lights import LEVELS, TrafficLight, worst
from footscan.report.thumbnail import HEIGHT_PX, WIDTH_PX

SIDES = ("left", "right", "unknown")
"""Order of the feet of one day."""
STATUS = {"done": "ok", "finding": "uncertain"}
"""CSS class of a status; any other status is a failure."""


class ScanRow(NamedTuple):
    """One scan on the page of an archive; any text is safe."""

    patient: str
    scan: str
    status: str
    """`done`, `refused`, `finding`, `fault` or `damaged`."""
    problem: str | None = None
    side: str = "unknown"
    date: str = ""
    """YYYY-MM-DD; empty if unknown."""
    length_mm: float | None = None
    size: str | None = None
    """EU size."""
    lights: Sequence[TrafficLight] = ()
    report: str | None = None
    """Relative address of its report."""
    picture: str | None = None
    """Relative address of its thumbnail."""


def archive_page(rows: Sequence[ScanRow], mark: str) -> str:
    """A page with relative links to the reports of the scans; thumbnails are loaded when they come into view.

    `mark` : one line of letters and digits, kept in the page, that tells whether the page is up to date
    """
    patients: dict[str, list[ScanRow]] = defaultdict(list)
    for row in sorted(rows, key=_order):
        patients[row.patient].append(row)
    failed = sum(row.status not in STATUS for row in rows)
    with_finding = sum(row.status == "finding" for row in rows)
    bodies = "\n".join(f"<tbody>{''.join(map(_row, scans))}</tbody>" for scans in patients.values())
    heads = "".join(
        f'<th scope="col"{" class=n" if name in _NUMERIC else ""}>'
        + (f'<button type="button" data-sort="{key}">{name}</button>' if key else name)
        + "</th>"
        for name, key in _HEADINGS.items()
    )
    tiles = {"Scans": len(rows), "Patients": len(patients), "With a finding": with_finding, "Failed": failed}
    boxes = "".join(f"<div><span>{name}</span><b>{number(count)}</b></div>" for name, count in tiles.items())
    return page(
        title="Archive of scans",
        kicker="Archive",
        heading=f"{number(len(rows))} scan{'s' * (len(rows) != 1)}",
        parts=[
            f'<!-- {mark} --><div class="tiles">{boxes}</div>',
            f'<section>{_FILTERS}<table id="scans"><thead><tr>{heads}</tr></thead>\n{bodies}</table></section>',
        ],
        scripts=[SCRIPT],
        style=_STYLE,
        pictures="'self' file:",  # for a page opened from a folder, some browsers do not accept `self`
    )


def _order(row: ScanRow) -> tuple[str, str, int, str]:
    return row.patient, row.date, SIDES.index(row.side) if row.side in SIDES else len(SIDES), row.scan


def _row(row: ScanRow) -> str:
    name = text(row.scan)
    named = f'<a href="{text(row.report)}">{name}</a>' if row.report else name
    picture = (
        f'<img src="{text(row.picture)}" loading="lazy" decoding="async" width="{WIDTH_PX // 2}" '
        f'height="{HEIGHT_PX // 2}" alt="">'
        if row.picture
        else ""
    )
    status = f'<span class="status {STATUS.get(row.status, "incomplete")}">{text(row.status)}</span>'
    problem = f'<p class="problem">{text(row.problem)}</p>' if row.problem else ""
    length = "" if row.length_mm is None else f"{number(row.length_mm, 1)} mm"
    keys = {
        "patient": row.patient,
        "scan": row.scan,
        "side": row.side,
        "date": row.date,
        "length": "" if row.length_mm is None else f"{row.length_mm:g}",
        "quality": LEVELS.index(worst(list(row.lights))) if row.lights else len(LEVELS),
        "status": row.status,
    }
    data = " ".join(f'data-{key}="{text(value)}"' for key, value in keys.items())
    size = "" if row.size is None else f"EU {text(row.size)}"
    return (
        f'<tr {data}><td class="picture-of">{picture}</td><td class="patient">{text(row.patient)}</td>'
        f'<th scope="row">{named}</th><td>{text(row.side)}</td><td class="date">{text(row.date)}</td>'
        f'<td class="n">{length}</td><td class="n">{size}</td>'
        f'<td class="lights">{"".join(map(_light, row.lights))}</td><td class="end">{status}{problem}</td></tr>\n'
    )


def _light(light: TrafficLight) -> str:
    title = text(f"{light.name}: {light.level}, {light.why}")
    return f'<span class="light {light.level}" title="{title}">{text(light.name)}</span>'


_HEADINGS = {
    "": "",
    "Patient": "patient",
    "Scan": "scan",
    "Side": "side",
    "Date": "date",
    "Length": "length",
    "Size": "",
    "Quality": "quality",
    "Result": "status",
}
_NUMERIC = {"Length", "Size"}
_FILTERS = """\
<form class="filters" hidden><input type="search" id="search" placeholder="Search" aria-label="Search">
<select id="side" aria-label="Side"><option value="">Both sides</option><option>left</option><option>right</option>
<option>unknown</option></select>
<select id="status" aria-label="Result"><option value="">All results</option><option value="done">done</option>
<option value="finding">with a finding</option><option value="failed">failed</option></select>
<label><input type="checkbox" id="pairs"> Feet side by side</label><output id="count"></output></form>
"""
_STYLE = """
body header, body main { max-width: 1320px; }
.filters { display: flex; flex-wrap: wrap; gap: 8px 12px; align-items: center; margin-bottom: 12px; }
.filters[hidden] { display: none; }
.filters input[type=search], .filters select { padding: 6px 8px; border: 1px solid var(--rule); border-radius: 6px;
  background: #fff; color: var(--ink); font: inherit; }
.filters input[type=search] { flex: 1 1 160px; min-width: 0; max-width: 320px; }
#count { margin-left: auto; color: var(--soft); font-size: 13px; }
[data-sort] { padding: 0; border: 0; background: none; color: inherit; font: inherit; cursor: pointer; }
[data-sort]:hover { color: var(--accent); }
[aria-sort=ascending] [data-sort]::after { content: " ↑"; }
[aria-sort=descending] [data-sort]::after { content: " ↓"; }
#scans th, #scans td { vertical-align: middle; overflow-wrap: normal; }
#scans .patient { min-width: 5em; max-width: 14em; overflow-wrap: break-word; }
#scans tbody th, .problem { overflow-wrap: anywhere; }
#scans tr[hidden] { display: none; }
#scans a { color: var(--accent); }
.picture-of { width: 108px; }
.picture-of img { display: block; }
.date, #scans td.n { white-space: nowrap; overflow-wrap: normal; }
.light { display: inline-block; margin: 1px 4px 1px 0; padding: 1px 7px; border-radius: 9px; font-size: 12px; }
.good { background: #dff2e4; color: #17632f; }
.fair { background: #fdf0cf; color: #7a5200; }
.poor { background: #fbdfdc; color: #92231a; }
.poor::before { content: "✕ "; }
.fair::before { content: "! "; }
.light.unknown { background: #eef1f3; color: #5b6672; }
.lights { min-width: 150px; }
.problem { margin: 2px 0 0; color: #92231a; font-size: 13px; max-width: 420px; }
#scans.pairs { display: block; }
#scans.pairs thead { display: none; }
#scans.pairs tbody { display: grid; grid-template-columns: 1fr 1fr; gap: 0 20px; grid-auto-flow: dense;
  border-top: 1px solid var(--rule); padding: 8px 0; }
#scans.pairs tr[data-side=left] { grid-column: 1; }
#scans.pairs tr[data-side=right] { grid-column: 2; }
#scans.pairs tr[data-side=unknown] { grid-column: 1 / -1; }
#scans.pairs tr { display: flex; flex-wrap: wrap; gap: 2px 10px; align-items: center; padding: 4px 0; }
#scans.pairs tr[hidden] { display: none; }
#scans.pairs th, #scans.pairs td { padding: 0; border: 0; }
#scans.pairs td:empty { display: none; }
@media (max-width: 900px) {
  #scans, #scans tbody { display: block; }
  #scans thead { display: none; }
  #scans tr { display: flex; flex-wrap: wrap; gap: 2px 10px; align-items: center; padding: 8px 0;
    border-top: 1px solid var(--rule); }
  #scans.pairs tr { border-top: 0; align-content: start; }
  #scans th, #scans td { padding: 0; border: 0; }
  #scans td:empty { display: none; }
  #scans .lights, #scans .end { flex: 1 1 100%; }
  #scans.pairs tbody { gap: 0 10px; }
}
"""

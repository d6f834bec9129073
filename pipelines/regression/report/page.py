"""The page of a night: its figures beside the accepted baseline."""

from collections.abc import Iterable, Sequence

from footscan.report.markup import breakable, data_uri, number, section, table, text
from footscan.report.page import page
from pipelines.regression.report.lines import history_line
from pipelines.regression.report.result import (
    VERDICTS,
    Change,
    FirstStep,
    JudgedFigure,
    JudgedSet,
    NightResult,
    Verdict,
)
from schemas.regression import WORLDS

NOTICE = "<!-- notice -->"
"""Marks the line on which `with_notice` puts its notice."""
_CLASS = {"better": "ok", "same": "quiet", "worse": "incomplete", "missing": "incomplete", "new": "uncertain"}
_ARROWS = {"less": "less is better", "more": "more is better", "nearer": "nearer to what is known", "same": ""}


def regress_page(night: NightResult) -> str:
    """Return the self-contained HTML page of a night."""
    parts = [
        f"<style>{_STYLE}</style>\n{NOTICE}",
        _tiles(night),
        *([_notes(night.notes)] if night.notes else []),
        *(_set(judged_set) for judged_set in sorted(night.sets, key=_urgency)),
        _accepted(night),
    ]
    good = not night.count("worse", "missing") and not any(judged_set.problem for judged_set in night.sets)
    verdict = "all is the same or better" if good else "something is worse"
    return page(
        title=f"{night.suite}: {verdict}",
        kicker=f"Regression, {night.time:%Y-%m-%d %H:%M} UTC",
        heading=f"{text(night.suite)} <span>{verdict}</span>",
        parts=parts,
    )


def with_notice(markup: str, notice: str) -> str:
    """Put a notice on top of a page of `regress_page`, in place of an earlier one; any text is safe."""
    lines = markup.splitlines(keepends=True)
    banner = f'{NOTICE}<p class="notice">{text(notice)}</p>\n'
    return "".join(banner if line.startswith(NOTICE) else line for line in lines)


def _tiles(night: NightResult) -> str:
    counts = [(verdict, night.count(verdict)) for verdict in VERDICTS]
    tiles = "".join(
        f'<div class="{verdict if count else ""}"><span>{verdict}</span><b>{count}</b></div>'
        for verdict, count in counts
    )
    return f'<div class="tiles">{tiles}</div>'


def _notes(notes: Iterable[str]) -> str:
    return section("Notes", "".join(f"<p>{text(note)}</p>" for note in notes))


def _urgency(judged_set: JudgedSet) -> bool:
    return not (judged_set.problem or judged_set.count("worse", "missing"))


def _set(judged_set: JudgedSet) -> str:
    noted = [figure for figure in judged_set.figures if figure.verdict != "same"]
    noted.sort(key=lambda figure: VERDICTS.index(figure.verdict))
    parts = [f'<p class="problem">{text(judged_set.problem)}</p>'] if judged_set.problem else []
    if judged_set.name == WORLDS:
        parts.append('<p><a href="worlds.html">All worlds, what drives their errors, and the worst ones</a></p>')
    if judged_set.first or judged_set.changed_steps:
        parts.append(_first(judged_set))
    if noted:
        parts.append(_figures(noted))
    if judged_set.pictures:
        parts.append(_pictures(judged_set))
    elif judged_set.note:
        parts.append(f'<p class="note">{text(judged_set.note)}</p>')
    same = [figure for figure in judged_set.figures if figure.verdict == "same"]
    if same:
        what = f"{len(same)} figures that are the same" if noted else f"All {len(same)} figures are the same"
        parts.append(f"<details><summary>{what}</summary>{_figures(same)}</details>")
    return section(judged_set.name, *parts)


def _first(judged_set: JudgedSet) -> str:
    steps = "".join(_first_step(first) for first in judged_set.first)
    counted = ""
    if judged_set.changed_steps:
        counted = f'<p class="note">Steps whose result differs from the accepted one: {judged_set.changed_steps}.</p>'
    return f"<h3>Where it begins</h3>{counted}<ul>{steps}</ul>" if steps else counted


def _first_step(first: FirstStep) -> str:
    changes = "".join(_change(change) for change in first.changes)
    names = ", ".join(first.steps)
    return f"<li><b>{text(names)}</b>: {text(first.why)}{f'<ul>{changes}</ul>' if changes else ''}</li>"


def _change(change: Change) -> str:
    if not change.lines:
        return f"<li>{text(change.text)}</li>"
    rows = [[f"<code>{text(old)}</code>", f"<code>{text(new)}</code>"] for old, new in change.lines]
    return f"<li>{text(change.text)}{table(['before', 'last night'], rows, kind='code')}</li>"


def _figures(figures: Sequence[JudgedFigure]) -> str:
    rows = [
        [
            breakable(figure.name),
            _value(figure.value),
            _value(figure.accepted),
            _difference(figure),
            _chip(figure.verdict),
            history_line(figure),
        ]
        for figure in figures
    ]
    headings = ["Figure", "last night", "accepted", "difference", "", "history"]
    return table(headings, rows, numeric=(1, 2, 3), kind="figures")


def _value(value: float | None) -> str:
    if value is None:
        return "–"
    decimals = 0 if value == int(value) else 1 if abs(value) >= 1000 else 4 if abs(value) < 10 else 2
    return number(value, decimals)


def _difference(figure: JudgedFigure) -> str:
    """Difference from the accepted figure, and its tolerance."""
    if figure.value is None or figure.accepted is None:
        return ""
    by = figure.value - figure.accepted
    sign = "+" if by > 0 else ""
    title = f"may be {figure.allowed:g}; {_ARROWS[figure.better]}".removesuffix("; ")
    if figure.truth is not None:
        title += f", {figure.truth:.6g}"
    return f'<span title="{text(title)}">{sign}{_value(by)}<small>±{_value(figure.allowed)}</small></span>'


def _chip(verdict: Verdict) -> str:
    return f'<span class="status {_CLASS[verdict]}">{verdict}</span>'


def _pictures(judged_set: JudgedSet) -> str:
    figures = "".join(
        f'<figure><img src="{data_uri("image/png", png)}" alt="{text(caption)}">'
        f"<figcaption>{text(caption)}</figcaption></figure>"
        for caption, png in judged_set.pictures.items()
    )
    return f'<h3>Compared with the earlier shape</h3><div class="beside">{figures}</div>'


def _accepted(night: NightResult) -> str:
    if not night.accepted:
        hint = "Nothing has been accepted yet: every figure is new. Accept with"
        return section("Accepted", f"<p>{hint} <code>footscan regress --accept REASON</code>.</p>")
    rows = [
        [f"{entry.date:%Y-%m-%d %H:%M}", text(entry.by), text(entry.software), text(entry.reason)]
        for entry in night.accepted
    ]
    first, last = night.nights[0], night.nights[-1]
    shown = f"{len(night.nights)} nights are shown, from {first:%Y-%m-%d} to {last:%Y-%m-%d}."
    software = f"Last night: {text(night.software)} on {text(night.host)}. {shown}"
    return section("Accepted", table(["When", "by", "software", "reason"], rows), f'<p class="note">{software}</p>')


_STYLE = """
h3 { margin: 14px 0 6px; font-size: 15px; }
.tiles .worse, .tiles .missing { background: #fbdfdc; }
.tiles .better { background: #dff2e4; }
.tiles .new { background: #fdf0cf; }
.quiet { background: #eef1f3; color: #5b6672; }
.notice { margin: 0 0 16px; padding: 12px 16px; background: #92231a; color: #fff; border-radius: 8px; }
.problem { padding: 8px 12px; background: #fbdfdc; color: #92231a; border-radius: 6px; overflow-wrap: anywhere; }
svg.history { width: 180px; height: 36px; }
.band { fill: #e3ecf0; }
.figures td, .figures th { vertical-align: middle; }
.figures small { margin-left: 6px; color: #5b6672; }
.code tbody th { font-weight: 400; }
.code th, .code td { width: 50%; padding-top: 1px; padding-bottom: 1px; }
.beside { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(420px, 100%), 1fr)); gap: 16px; }
.beside img { display: block; width: 100%; border: 1px solid #dde2e7; border-radius: 4px; }
.code code { white-space: pre-wrap; overflow-wrap: anywhere; font-size: 12px; }
section ul { margin: 4px 0 10px; padding-left: 20px; overflow-wrap: anywhere; }
@media (max-width: 700px) {
  .figures, .figures tbody { display: block; }
  .figures thead { display: none; }
  .figures tr { display: grid; grid-template-columns: 1fr max-content; gap: 2px 10px; padding: 8px 0;
    border-top: 1px solid #dde2e7; }
  .figures th, .figures td { padding: 0; border: 0; }
  .figures tbody th { overflow-wrap: anywhere; }
  .figures td:nth-child(2) { font-weight: 600; }
  .figures td:nth-child(3)::before { content: "accepted "; color: #5b6672; }
  .figures td.n:nth-child(3) { text-align: left; }
  .figures td:nth-child(6) { grid-column: 1 / -1; justify-self: end; }
}
"""

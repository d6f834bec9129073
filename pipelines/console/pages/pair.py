"""The page of both feet of a person: their differences, and the sizes for both."""

from pathlib import Path

from footscan.report.markup import UNITS, number_or_dash, section, table, text, words
from footscan.report.size_table import size_table
from footscan.sizing.pairs import compare_pair
from footscan.sizing.table import read_table
from pipelines.console.pages.results import read_measures
from pipelines.console.pages.shell import shell
from schemas.feet import Foot
from schemas.pairs import Pair, PairRow


def pair_page(results: Path, patient: str, left: str, right: str) -> str:
    """Return the page of two scans of a patient.

    Raises
    ------
    RefusedInput
        A scan has no results, or is of the other side.
    """
    pair = compare_pair(_foot(results, patient, left), _foot(results, patient, right), read_table())
    links = "".join(
        f'<a class="button" href="/foot/{text(patient)}/{text(scan)}">{side} foot</a>'
        for side, scan in (("Left", left), ("Right", right))
    )
    headings = ["Measure", "Left", "Right", "Right minus left", "Unit", "Larger"]
    parts = [
        f'<h1 tabindex="-1" id="result">Both feet <span>{text(patient)}</span></h1>',
        section("Sizes for both", *_sizes(pair)),
        section("Measures", table(headings, map(_row, pair.rows), numeric=[1, 2, 3]), *map(_note, pair.notes)),
        f'<div class="row next">{links}<button id="new-person" type="button">Next person</button>'
        '<a class="button" href="/">Back</a></div><p id="next-told" class="note" aria-live="polite"></p>',
    ]
    return shell(title=f"Both feet {patient}", parts=parts, scripts=["foot.js"])


def _foot(results: Path, patient: str, scan: str) -> Foot:
    document = read_measures(results, patient, scan).model_dump(mode="json")
    return Foot.model_validate(document | {"patient": patient, "scan": scan, "source": f"{patient}/{scan}"})


def _sizes(pair: Pair) -> list[str]:
    sides = ", ".join(f"{words(name).lower()}: {side}" for name, side in pair.decided_by.items() if side)
    decided = [_note(f"The larger foot decides ({sides}).")] if sides else []
    return [*decided, size_table(pair.sizes)]


def _row(row: PairRow) -> list[str]:
    unit, decimals = UNITS.get(row.unit, (row.unit, 3))
    left, right, difference = (number_or_dash(value, decimals) for value in (row.left, row.right, row.difference))
    note = f'<p class="note">{text(row.note)}</p>' if row.note else ""
    return [text(words(row.measure)) + note, left, right, difference, text(unit), text(row.larger or "–")]


def _note(sentence: str) -> str:
    return f'<p class="note">{text(sentence)}</p>'

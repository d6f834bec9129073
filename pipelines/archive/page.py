"""The page of an archive and its thumbnails, from the results in its folder."""

import contextlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from pipelines.archive.running import ScanEnd
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE
from schemas.base.errors import FootscanError
from schemas.base.model import canonical_json
from schemas.measures import Measures
from schemas.quality import Quality

if TYPE_CHECKING:
    from footscan.report.archive.page import ScanRow
    from schemas.sizes import SizeTable

PAGE, FILES = "index.html", "index.files"
"""The page, and the folder of its pictures beside it. The dot excludes a patient of that name."""
SIZES = "eu"
"""Scale of the sizes on the page."""
_MARK_CHARACTERS = 2**17
"""Number of characters at the start of a page in which its mark is searched; chosen by hand: styles come first."""


def write_archive_page(ends: Sequence[ScanEnd], folder: Path) -> None:
    """Write `index.html` into the folder of the results, unless it shows these ends already.

    A row whose result files were moved or damaged meanwhile has fewer entries.

    Raises
    ------
    Fault
        The folder cannot be written.
    """
    mark = _mark(ends)
    if _mark_of(folder / PAGE) == mark:
        return
    from footscan.report.archive.page import archive_page
    from footscan.sizing.table import read_table

    table = read_table()
    table = table.model_copy(update={"sizes": {SIZES: table.sizes[SIZES]}, "widths": {}})
    rows = [_row(end, folder, table) for end in ends]
    write_atomically(folder / PAGE, archive_page(rows, mark).encode())
    for unused in set(_pictures(folder)) - {row.picture for row in rows}:
        with contextlib.suppress(OSError):
            (folder / unused).unlink()


def _mark(ends: Sequence[ScanEnd]) -> str:
    """Digest of all data that the page shows; it does not depend on `ScanEnd.was_cached`."""
    shown = [
        [end.scan, end.kind, end.problem, dict(end.digests), _date(end), end.document and end.document.side]
        for end in ends
    ]
    return sha256(canonical_json([SOFTWARE, shown]).encode())


def _mark_of(page: Path) -> str | None:
    try:
        with page.open(encoding="utf-8") as file:
            match = re.search("<!-- ([0-9a-f]{64}) -->", file.read(_MARK_CHARACTERS))
    except (OSError, ValueError):
        return None
    return None if match is None else match[1]


def _row(end: ScanEnd, folder: Path, table: "SizeTable") -> "ScanRow":
    from footscan.report.archive.page import ScanRow
    from footscan.report.quality_lights import quality_lights

    patient, _, scan = end.scan.partition("/") if end.document is not None else ("", "", end.scan)
    side = "unknown" if end.document is None else end.document.side
    row = ScanRow(patient, scan, end.kind or "done", end.problem, side, _date(end))
    if end.folder is None:
        return row
    try:
        measures = Measures.model_validate_json((end.folder / "measures.json").read_bytes())
        quality = Quality.model_validate_json((end.folder / "quality.json").read_bytes())
    except (OSError, ValueError):
        return row
    length = measures.measures.get("foot_length")
    return row._replace(
        length_mm=None if length is None else length.value,
        size=_size(measures, table),
        lights=quality_lights(measures, quality),
        report=_address(folder, end.folder / "report.html"),
        picture=_picture(end, measures, folder),
    )


def _date(end: ScanEnd) -> str:
    return "" if end.document is None or end.document.day is None else end.document.day.isoformat()


def _size(measures: Measures, table: "SizeTable") -> str | None:
    """European size of the foot; None if the scale has none for it."""
    from footscan.sizing.sizes import foot_sizes
    from schemas.feet import Foot

    try:
        return foot_sizes(Foot.model_validate(measures.model_dump(mode="json")), table).sizes[0].size
    except ValueError:
        return None


def _picture(end: ScanEnd, measures: Measures, folder: Path) -> str | None:
    """Address of a scan's thumbnail, drawn if it is missing; None if it cannot be drawn."""
    from footscan.mesh.formats.files import read_mesh
    from footscan.report.thumbnail import thumbnail

    if end.folder is None or "foot.ply" not in end.digests:
        return None
    content = canonical_json([end.digests["foot.ply"], measures.transform])
    name = f"{FILES}/{sha256(content.encode())[:24]}.png"
    if not (folder / name).exists():
        try:
            vertices, faces = read_mesh(end.folder / "foot.ply")
        except (FootscanError, OSError):  # moved or damaged by a person: the page does without it
            return None
        write_atomically(folder / name, thumbnail(vertices, faces, measures.transform))
    return name


def _pictures(folder: Path) -> Iterator[str]:
    """Addresses of the existing thumbnails."""
    return (f"{FILES}/{file.name}" for file in (folder / FILES).glob("*.png"))


def _address(folder: Path, file: Path) -> str:
    return quote(Path(os.path.relpath(file, folder)).as_posix())

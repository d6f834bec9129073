"""Picture of a refused capture, which shows the reason."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.recordings.captures import RecordedCapture

Picture = Annotated[
    Path | None,
    typer.Option(help="Picture of a refused capture to write (PNG).", show_default="NAME-OF-FOLDER-refused.png"),
]


@contextmanager
def drawn(capture: "RecordedCapture", picture: Path | None) -> Iterator[None]:
    """Around work on a capture: where it is refused for what it shows, that is drawn and the file named.

    Raises
    ------
    RefusedInput
        What was raised within.
    """
    from footscan.calibration.capture.refused_capture import RefusedCapture
    from pipelines.capture_job import picture_of
    from pipelines.engine.files.atomic import write_atomically

    try:
        yield
    except RefusedCapture as refused:
        picture = picture or Path(f"{capture.folder.name}-refused.png")
        try:
            write_atomically(picture, picture_of(capture, refused))
        except OSError as error:
            seen = f"(not drawn: {error})"
        else:
            seen = f"(see {picture})"
        raise RefusedInput(refused.source, f"{refused.problem} {seen}", field=refused.field) from refused

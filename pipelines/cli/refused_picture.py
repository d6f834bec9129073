"""A refused capture is drawn, so that a person sees why."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from schemas.errors import RefusedInput

Picture = Annotated[
    Path | None,
    typer.Option(help="Draw a refused capture here (PNG).", show_default="NAME-OF-FOLDER-refused.png"),
]


@contextmanager
def drawn(folder: Path, picture: Path | None) -> Iterator[None]:
    """Around work on the capture in `folder`: where it is refused for what it shows, that is drawn and the file named.

    Raises
    ------
    RefusedInput
        What was raised within.
    """
    from footscan.calibration.refused_capture import RefusedCapture
    from pipelines.calibrate import picture_of
    from pipelines.engine.atomic import write_atomically

    try:
        yield
    except RefusedCapture as refused:
        picture = picture or Path(f"{folder.resolve().name}-refused.png")
        try:
            write_atomically(picture, picture_of(folder, refused))
        except OSError as error:
            seen = f"(not drawn: {error})"
        else:
            seen = f"(see {picture})"
        raise RefusedInput(refused.source, f"{refused.problem} {seen}", field=refused.field) from refused

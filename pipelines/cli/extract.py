"""`footscan extract`."""

import sys
from collections.abc import Iterable, Sequence
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.output import AsJson, keep_inputs, message, print_json
from schemas.errors import RefusedInput

if TYPE_CHECKING:
    from footscan.frames.film import Film
    from footscan.frames.image import Rgb
    from footscan.stripe.points import StripePoints
    from schemas.parameters.extraction import ExtractionParameters


def extract(
    file: Annotated[Path, typer.Argument(help="An image, a film (AVI) or a folder of frames.")],
    out: Annotated[Path | None, typer.Option(help="CSV to write; standard output where absent.")] = None,
    overlay: Annotated[Path | None, typer.Option(help="Draw the points over the frames here (PNG).")] = None,
    background: Annotated[
        Path | None,
        typer.Option(help="The same with the laser off: an image for all frames, or as many frames as FILE has."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the extraction; may stand several times."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the laser stripe: one sub-pixel point a row of frame,i,j,width,peak,score."""
    from footscan.frames.film import film_files, open_film, pixel_frames
    from footscan.stripe.film import extract_film, points_csv
    from pipelines.engine.atomic import write_atomically

    parameters = _parameters(settings or [])
    film = open_film(file)
    backgrounds = None if background is None else _backgrounds(background, film)
    inputs = [path for source in (file, background) if source is not None for path in film_files(source)]
    keep_inputs([out, overlay], *inputs)
    if overlay is not None:
        _check_overlay(overlay, out, [path for path in (file, background) if path is not None])

    points = extract_film(pixel_frames(film), parameters, backgrounds)
    if out is not None:
        write_atomically(out, points_csv(points).encode())
    elif not as_json:
        sys.stdout.write(points_csv(points))
    if overlay is not None:
        write_atomically(overlay, _drawn(film, points))
    if as_json:
        print_json(
            {
                "file": str(file),
                "frames": film.frames,
                "points": len(points),
                "out": None if out is None else str(out),
                "overlay": None if overlay is None else str(overlay),
            }
        )
    message(f"{file}: {len(points)} stripe points in {film.frames} frame{'s' * (film.frames != 1)}")


def _parameters(settings: Sequence[str]) -> "ExtractionParameters":
    """The parameters that `--set NAME=VALUE ...` gives, and the defaults of all others."""
    from schemas.documents import validate
    from schemas.parameters.extraction import ExtractionParameters

    values: dict[str, str] = {}
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (name and equals):
            raise RefusedInput("--set", f"expected NAME=VALUE, found {setting[:80]!r}")
        if name in values:
            raise RefusedInput("--set", "stands twice, expected each parameter once", field=name)
        values[name] = value
    return validate("--set", ExtractionParameters, values)


def _backgrounds(path: Path, film: "Film") -> "Iterable[Rgb | None]":
    """A laser-off frame for each frame of the film: of its own, or one and the same."""
    from footscan.frames.film import open_background, pixel_frames

    background = open_background(path, (film.height, film.width), film.frames, str(film.path))
    frames = pixel_frames(background)
    return frames if background.frames > 1 else repeat(next(frames), film.frames)


def _check_overlay(overlay: Path, out: Path | None, sources: Sequence[Path]) -> None:
    """Refuses a picture that would replace the CSV, or that the next run would take for a frame."""
    if out is not None and overlay.resolve() == out.resolve():
        raise RefusedInput(overlay, "is the file of --out, expected another file to write")
    if overlay.resolve().parent in {source.resolve() for source in sources}:
        raise RefusedInput(overlay, "lies among the frames, expected a file in another folder")


def _drawn(film: "Film", points: "StripePoints") -> bytes:
    from footscan.frames.film import pixel_frames
    from footscan.report.stripe_figure import film_figure, frame_figure

    frames = pixel_frames(film)
    if film.frames == 1 and (frame := next(frames)) is not None:
        return frame_figure(frame, points)
    return film_figure(pixel_frames(film), film.frames, points)

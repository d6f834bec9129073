"""`footscan extract`."""

import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.terminal.output import AsJson, keep_inputs, note, print_json
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from footscan.frames.image import Rgb
    from footscan.frames.reader import FrameReader
    from footscan.stripe.points import StripePoints
    from schemas.parameters.extraction import ExtractionParameters


def _path(name: str) -> Callable[[str], Path]:
    """How an argument of such a name becomes a path: '', of a shell variable that is not set, would be this folder."""

    def path(text: str) -> Path:
        if not text:
            raise RefusedInput(name, "expected a path, found ''")
        return Path(text)

    return path


def extract(
    file: Annotated[
        Path, typer.Argument(parser=_path("FILE"), help="An image, a film (AVI) or a folder of frames, of any size.")
    ],
    out: Annotated[
        Path | None, typer.Option(parser=_path("--out"), help="CSV to write; default: standard output.")
    ] = None,
    overlay: Annotated[
        Path | None,
        typer.Option(
            parser=_path("--overlay"), help="Picture to write: the frames with the stripe points drawn over them (PNG)."
        ),
    ] = None,
    background: Annotated[
        Path | None,
        typer.Option(
            parser=_path("--background"),
            help="Background, filmed with the laser off: one image, or as many frames as FILE has.",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Parameter of the extraction; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the laser stripe: CSV with one sub-pixel point per row (frame,i,j,width,peak,score)."""
    from footscan.frames.film import film_files, open_background, open_film
    from footscan.frames.image import SUFFIXES
    from footscan.frames.reader import backgrounds_of, pixel_frames
    from footscan.stripe.film import extract_film, points_csv
    from footscan.stripe.laser import adapted
    from pipelines.engine.files.atomic import write_atomically
    from schemas.base.overrides import overridden
    from schemas.parameters.extraction import ExtractionParameters

    parameters = overridden(ExtractionParameters, {}, settings or [])
    film = open_film(file)
    if file.is_file() and file.suffix.lower() in SUFFIXES and next(pixel_frames(film)) is None:
        raise RefusedInput(file, "expected a whole image, found one that is torn")
    laser_off = None if background is None else open_background(background, film.size, film.count, str(file))
    backgrounds = None if laser_off is None else backgrounds_of(laser_off, film.count)
    inputs = [path for source in (file, background) if source is not None for path in film_files(source)]
    keep_inputs([out, overlay], *inputs)
    _check_outputs(out, overlay, [path for path in (file, background) if path is not None])

    seen, about = _Seen(), _about(film, background, parameters)
    used = adapted(film, parameters, laser_off)
    points = extract_film(seen.watch(pixel_frames(film)), used, backgrounds)
    picture = None if overlay is None else _drawn(film, points, seen.lost, about)
    if out is not None:
        write_atomically(out, points_csv(points).encode())
    elif not as_json:
        sys.stdout.write(points_csv(points))
    if overlay is not None and picture is not None:
        write_atomically(overlay, picture)
    if as_json:
        print_json(
            {
                "file": str(file),
                "background": None if background is None else str(background),
                "parameters": parameters.model_dump(mode="json"),
                "laser": None if used.laser == "auto" else used.laser,
                "frames": film.count,
                "lost": seen.lost,
                **_figures(film, points),
                "out": None if out is None else str(out),
                "overlay": None if overlay is None else str(overlay),
            }
        )
    note(_summary(film, points, seen, used.laser))


def _check_outputs(out: Path | None, overlay: Path | None, sources: Sequence[Path]) -> None:
    """Refuse an output that cannot be written, replaces the other one, or would be a frame of the next run."""
    from pipelines.engine.files.atomic import is_stream

    if out is not None and not is_stream(out):
        if out.suffix.lower() not in {".csv", ""}:
            raise RefusedInput(out, f"expected a file that ends in .csv, found {out.suffix!r}")
        _check_folder(out)
    if overlay is None:
        return
    if overlay.suffix.lower() != ".png":
        raise RefusedInput(overlay, f"expected a file that ends in .png, found {overlay.suffix!r}")
    _check_folder(overlay)
    if overlay.resolve().parent in {source.resolve() for source in sources}:
        raise RefusedInput(overlay, "lies among the frames, expected a file in another folder")


def _check_folder(output: Path) -> None:
    """Refuse a file whose folder cannot be written or made. Permissions are not conclusive, so this tries it."""
    folder = output.parent
    try:
        folder = output.resolve().parent
        while not folder.exists():
            folder = folder.parent
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError) as error:  # before Python 3.13 a circle of links is a RuntimeError
        problem = getattr(error, "strerror", None) or "leads nowhere"
        raise RefusedInput(output, f"cannot be written ({folder}: {problem})") from None


@dataclass
class _Seen:
    """Observations about the frames while they are read."""

    lost: list[int] = field(default_factory=list)
    """Numbers of the frames that are missing or torn."""
    colour: bool = False
    """True if R, G and B differ anywhere."""

    def watch(self, frames: "Iterable[Rgb | None]") -> "Iterator[Rgb | None]":
        for number, frame in enumerate(frames):
            if frame is None:
                self.lost.append(number)
            else:
                self.colour = self.colour or bool((frame != frame[..., :1]).any())
            yield frame


def _drawn(film: "FrameReader", points: "StripePoints", lost: list[int], about: str) -> bytes:
    from footscan.frames.reader import pixel_frames
    from footscan.report.scan.stripe_figure import film_figure, frame_figure

    frames = pixel_frames(film)
    if film.count == 1 and (frame := next(frames)) is not None:
        return frame_figure(frame, points, about)
    return film_figure(pixel_frames(film), film.count, points, lost, about)


def _about(film: "FrameReader", background: Path | None, parameters: "ExtractionParameters") -> str:
    """Title of an overlay: names, and the parameters that differ from the defaults."""
    names = [_name(film.path)] + ([] if background is None else [f"background {_name(background)}"])
    return ", ".join(
        names + [f"{name}={value}" for name, value in parameters.model_dump(exclude_defaults=True).items()]
    )


def _name(path: Path) -> str:
    return path.name or path.resolve().name


def _figures(film: "FrameReader", points: "StripePoints") -> dict[str, Any]:
    """The summary as a JSON document."""
    import numpy as np

    return {
        "points": len(points),
        "points_per_frame": np.bincount(points["frame"], minlength=film.count).tolist(),
        "median_width_px": round(float(np.median(points["width"])), 3) if len(points) else None,
        "median_sigma_px": round(float(np.median(points["sigma"])), 4) if len(points) else None,
    }


def _summary(film: "FrameReader", points: "StripePoints", seen: _Seen, laser: str) -> str:
    """The summary in one line."""
    with_points = len(set(points["frame"].tolist()))
    of = f"{with_points} of " if 0 < with_points < film.count else ""
    lost = f", {len(seen.lost)} lost" if seen.lost else ""
    found = f"{film.path}: {len(points)} stripe points in {of}{film.count} frame{'s' * (film.count != 1)}{lost}"
    if laser != "auto":
        found += f"; laser: {laser}"
    if seen.colour or laser in ("auto", "mono") or len(seen.lost) == film.count:
        return found
    so = f"what was found is bright, not {laser}" if len(points) else f"no {laser} stripe can be found in it"
    return f"{found}; it has no colour (R = G = B in every pixel), so that {so}"

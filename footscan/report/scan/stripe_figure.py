"""Figures of an extraction: stripe points over one frame or over frames of a film, and their measured values."""

from collections.abc import Iterable, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from footscan.frames.image import Rgb
from footscan.report.panels import png_of
from footscan.rows import distinct_rows
from footscan.stripe.points import StripePoints

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import SubFigure

MEASURED = {
    "width": "width, px",
    "peak": "peak, grey levels",
    "saturation": "saturation, share",
    "sigma": "expected sigma, px",
}
"""Columns of the stripe points that are drawn, with the labels of their axes."""
ENDS = {"peak": 260.0, "saturation": 1.03}
"""Ends of the axes whose range is known."""
DIMMED = 0.7
"""Brightness of a frame under its points; chosen by hand so that both stripe and points are visible."""
GROUND = "#262626"
"""Background of the panels: the colours of the points look as they do over a dark frame."""
LINE, BAND, COLUMNS, ROWS, LOST = "#1f4e79", "#b9d4e8", "#2a9d6f", "#d9822b", "#c9c9c9"

DPI = 150
PICTURE_INCHES = 8.5
"""Longer side of the picture of a single frame."""
LEAST_INCHES = 2.8
"""Least length of its shorter side: an image that is one pixel high is drawn stretched."""
PANEL_INCHES, APART_INCHES = 1.35, 0.25
"""Size of a panel across the stripe, and the gap between panels."""
LEFT, RIGHT, TOP, BOTTOM = 0.8, 1.0, 0.37, 0.6
"""Margins of the figure of a single frame, inches. Its parts are placed explicitly so that rows and columns align."""
TITLE_POINTS, LINE_INCHES, LETTER_INCHES = 11, 0.19, 0.095
"""Size of the title's letters in points, height of a line and width of a letter in inches."""
NOTE_INCHES = 0.6
"""Room for the words "no stripe" in place of the panels."""

SHOWN_FRAMES, SHOWN_COLUMNS = 8, 4
"""Most frames in the figure of a film, and frames in a row."""
SHOWN_BARE = 2
"""Most frames without points among the frames shown, if other frames hold points."""
FILM_INCHES = 13.0
"""Width of the figure of a film."""
SHOWN_PX = 700
"""Longest side of a drawn frame of a film; larger frames are scaled down."""


def frame_figure(image: Rgb, points: StripePoints, about: str = "") -> bytes:
    """Draw one frame with its stripe points and the values measured along the stripe, as PNG.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.
    points : (N,) of `STRIPE_DTYPE`, px, image frame.
    about : str
        First line of the title: source of the frame, and how the points were extracted.

    Notes
    -----
    Points are coloured by score. If the stripe runs down the image, the panels of the measured values stand beside
    the picture and share its rows; if it runs across, they stand below and share its columns. Without points, a note
    replaces the panels. The same input gives the same bytes.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    rows, columns = image.shape[:2]
    scale = PICTURE_INCHES / max(rows, columns)
    wide, high = max(columns * scale, LEAST_INCHES), max(rows * scale, LEAST_INCHES)
    down = _lines(points["j"]) > _lines(points["i"])
    beside = len(MEASURED) * (PANEL_INCHES + APART_INCHES) if len(points) else NOTE_INCHES
    width = LEFT + wide + beside * down + RIGHT
    title = _fitting([about, *_summary(points, (rows, columns))], width)
    top = TOP + LINE_INCHES * len(title)
    height = top + high + beside * (not down) + BOTTOM
    figure = Figure(figsize=(width, height), dpi=DPI)

    def place(left: float, below: float, wide: float, high: float) -> "Axes":
        """Add axes; `left` and `below` are inches from the upper left corner of the picture."""
        bottom = height - top - below - high
        return figure.add_axes(((LEFT + left) / width, bottom / height, wide / width, high / height))

    colours = _score_colours()
    picture = place(0, 0, wide, high)
    _draw_frame(picture, _scaled_down(image, round(DPI * PICTURE_INCHES)), (rows, columns), points, colours, 0.8)
    picture.set_ylabel("row j, px")
    panels = []
    for number, (name, label) in enumerate(MEASURED.items() if len(points) else ()):
        offset = number * (PANEL_INCHES + APART_INCHES) + APART_INCHES
        end = ENDS.get(name) or _end(points[name])
        if down:
            panel = place(wide + offset, 0, PANEL_INCHES, high)
            _draw_points(panel, points[name], points["j"], points["score"], colours, 2.5)
            panel.set(xlabel=label, xlim=(-0.03 * end, end), ylim=picture.get_ylim())
            panel.tick_params(axis="x", labelsize=8)
            panel.tick_params(axis="y", labelleft=False)
        else:
            panel = place(0, high + offset, wide, PANEL_INCHES)
            _draw_points(panel, points["i"], points[name], points["score"], colours, 2.5)
            panel.set(ylabel=label, ylim=(-0.03 * end, end), xlim=picture.get_xlim())
            panel.yaxis.label.set_fontsize(8)
        measured = panel.xaxis if down else panel.yaxis
        measured.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
        measured.set_major_formatter("{x:g}")
        panel.set_facecolor(GROUND)
        panel.grid(alpha=0.3, linewidth=0.5)
        panels.append(panel)
    if panels and not down:
        for panel in (picture, *panels[:-1]):
            panel.tick_params(labelbottom=False)
    (picture if down or not panels else panels[-1]).set_xlabel("column i, px")
    if panels:
        figure.colorbar(colours, cax=place(wide + beside * down + APART_INCHES, 0, 0.16, high)).set_label("score")
    else:
        figure.text((LEFT + wide / 2) / width, 0.5 * NOTE_INCHES / height, _counted(0), ha="center", va="center")
    figure.suptitle("\n".join(title), fontsize=TITLE_POINTS, y=1 - 0.15 / height, va="top", parse_math=False)
    return png_of(figure)


def film_figure(
    frames: Iterable[Rgb | None], count: int, points: StripePoints, lost: Sequence[int] = (), about: str = ""
) -> bytes:
    """Draw some frames of a film with their stripe points, and the values measured along the travel, as PNG.

    Parameters
    ----------
    frames : iterable of (rows, columns, 3) uint8, RGB
        Read once; None stands for a lost frame. A frame may become invalid when the next one is read.
    count : int
        Number of frames.
    points : (N,) of `STRIPE_DTYPE`, px, image frame, in the order of the frames.
    lost : sequence of int
        Numbers of the frames that are None.
    about : str
        First line of the title: name of the film, and how the points were extracted.

    Notes
    -----
    The frames shown are spread over those that hold points. Up to `SHOWN_BARE` frames without points are among them:
    between the others if there are any, or next to them. A stripe across the image fills its columns; a stripe that
    runs down fills its rows. Without points, a note replaces the panels. The same input gives the same bytes.
    """
    from matplotlib.figure import Figure

    shown, (rows, columns) = _sample(frames, _frames_to_show(points, count, lost))
    with_points = f"{len(np.unique(points['frame']))} of " if len(points) else ""
    lost_note = f"; {len(lost)} lost" if lost else ""
    summary = f"{_counted(len(points))} in {with_points}{count} frame{'s' * (count != 1)}{lost_note}"
    title = _fitting([about, summary], FILM_INCHES)
    strips = -(-max(len(shown), 1) // SHOWN_COLUMNS)
    aspect = float(np.clip(rows / columns, 0.4, 1.5))
    heights = strips * (3.0 * aspect + 0.3), 4.6 if len(points) else NOTE_INCHES
    size = FILM_INCHES, sum(heights) + 0.5 + LINE_INCHES * len(title)
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights).ravel().tolist()
    figure.suptitle("\n".join(title), fontsize=TITLE_POINTS, parse_math=False)

    colours = _score_colours()
    pictures = above.subplots(strips, SHOWN_COLUMNS, squeeze=False).ravel().tolist()
    for picture in pictures:
        picture.set_axis_off()
    for picture, (number, image) in zip(pictures, shown.items(), strict=False):
        there = points[points["frame"] == number]
        _draw_frame(picture, image, (rows, columns), there, colours, 0.5)
        picture.set_box_aspect(aspect)
        picture.set_title(f"frame {number}: {_counted(len(there))}", fontsize=9)
    if len(points):
        above.colorbar(colours, ax=pictures, shrink=0.9, pad=0.01).set_label("score")
        keys = _draw_travel(below, points, count, (rows, columns), list(lost), list(shown))
        figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), fontsize=8, frameon=False)
    else:
        below.text(0.5, 0.5, _counted(0), ha="center", va="center")
    return png_of(figure)


def _score_colours() -> "ScalarMappable":
    """Viridis without its dark end, which is invisible over a dark frame."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    return ScalarMappable(Normalize(0.0, 1.0), ListedColormap(colormaps["viridis"](np.linspace(0.25, 1.0, 256))))


def _draw_frame(
    panel: "Axes", image: Rgb, size: tuple[int, int], points: StripePoints, colours: "ScalarMappable", area: float
) -> None:
    """Draw a frame, dimmed, under its points; `size` is (rows, columns) of the frame before `image` was scaled down."""
    rows, columns = size
    panel.imshow(
        np.rint(image * DIMMED).astype(np.uint8), extent=(-0.5, columns - 0.5, rows - 0.5, -0.5), aspect="auto"
    )
    panel.autoscale(False)
    _draw_points(panel, points["i"], points["j"], points["score"], colours, area)


def _draw_points(
    panel: "Axes",
    across: NDArray[np.floating],
    along: NDArray[np.floating],
    score: NDArray[np.floating],
    colours: "ScalarMappable",
    area: float,
) -> None:
    panel.scatter(across, along, c=score, s=area, linewidths=0, cmap=colours.cmap, vmin=0.0, vmax=1.0)


def _fitting(lines: Iterable[str], inches: float) -> list[str]:
    """Wrap the lines of a title to the width of the figure; letters that its font lacks are replaced."""
    from matplotlib.font_manager import findfont, get_font

    charmap = get_font(findfont("DejaVu Sans")).get_charmap()
    drawable = ("".join(c if ord(c) in charmap else "\N{REPLACEMENT CHARACTER}" for c in line) for line in lines)
    return [part for line in drawable for part in wrap(line, int(inches / LETTER_INCHES))]


def _summary(points: StripePoints, size: tuple[int, int]) -> list[str]:
    rows, columns = size
    counted = f"{_counted(len(points))} in {columns} x {rows} px"
    if not len(points):
        return [counted]
    filled = (
        f"in {100 * _lines(points['i']) / columns:.0f} % of the columns"
        f" and {100 * _lines(points['j']) / rows:.0f} % of the rows"
    )
    middle = {name: float(np.median(points[name])) for name in MEASURED}
    return [
        f"{counted}, {filled}",
        f"medians: width {middle['width']:.1f} px, peak {middle['peak']:.0f}, expected sigma {middle['sigma']:.3f} px",
    ]


def _lines(coordinates: NDArray[np.floating]) -> int:
    """Number of distinct pixel columns, or rows, among `coordinates`."""
    return len(np.unique(np.rint(coordinates)))


def _counted(points: int) -> str:
    return f"{points:,} point{'s' * (points != 1)}" if points else "no stripe"


def _end(values: NDArray[np.floating]) -> float:
    """End of an axis from 0 that shows all values."""
    finite = values[np.isfinite(values)]
    return 1.05 * float(finite.max()) if finite.size and finite.max() > 0 else 1.0


def _scaled_down(image: Rgb, longest: int) -> Rgb:
    """The image; if a side is longer than `longest` px, its means over blocks."""
    rows, columns = image.shape[:2]
    if max(rows, columns) <= longest:
        return image
    scale = longest / max(rows, columns)
    size = max(round(columns * scale), 1), max(round(rows * scale), 1)
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))


def _frames_to_show(points: StripePoints, count: int, lost: Sequence[int]) -> list[int]:
    held = np.unique(points["frame"])
    bare = np.setdiff1d(np.arange(count), [*held, *lost])
    if not len(held):
        return _spread(bare, SHOWN_FRAMES)
    between = bare[(bare > held[0]) & (bare < held[-1])]
    beside = bare[(bare == held[0] - 1) | (bare == held[-1] + 1)]
    without = _spread(between if len(between) else beside, SHOWN_BARE)
    return sorted(_spread(held, SHOWN_FRAMES - len(without)) + without)


def _spread(numbers: NDArray[np.integer], most: int) -> list[int]:
    """At most `most` of the numbers, spread from the first to the last."""
    places = np.linspace(0, len(numbers) - 1, min(most, len(numbers)))
    return [int(number) for number in numbers[np.rint(places).astype(np.intp)]]


def _sample(frames: Iterable[Rgb | None], frame_numbers: list[int]) -> tuple[dict[int, Rgb], tuple[int, int]]:
    """The frames with the given numbers, scaled down, by number; rows and columns of a frame."""
    shown: dict[int, Rgb] = {}
    size = (3, 4)  # aspect if all frames are lost
    for number, frame in enumerate(frames):
        if frame is None:
            continue
        size = frame.shape[0], frame.shape[1]
        if number in frame_numbers:
            shown[number] = _scaled_down(frame, SHOWN_PX).copy()
    return shown, size


def _draw_travel(
    below: "SubFigure",
    points: StripePoints,
    count: int,
    size: tuple[int, int],
    lost: list[int],
    shown: list[int],
) -> "list[Artist]":
    """Draw six panels over the frames of a film; return the handles of their legend."""
    from matplotlib.ticker import MaxNLocator

    panels = below.subplots(2, 3, sharex=True).ravel().tolist()
    _draw_coverage(panels[0], points, count, size, lost)
    panels[0].plot(shown, [0] * len(shown), "^", color="black", ms=4, clip_on=False, label="frame shown above")
    _draw_line(panels[1], np.bincount(points["frame"], minlength=count), lost, LINE, "")
    panels[1].set(ylabel="points a frame", ylim=(0, None))
    for panel, name in zip(panels[2:], MEASURED, strict=True):
        _draw_quantiles(panel, name, points, count)
    for panel in panels:
        panel.grid(alpha=0.3, linewidth=0.5)
        panel.set_xlim(-0.5, count - 0.5)
        if lost:
            panel.vlines(lost, 0, 1, transform=panel.get_xaxis_transform(), color=LOST, zorder=0, label="lost frame")
    for panel in panels[3:]:
        panel.set_xlabel("frame")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    return list({key.get_label(): key for panel in panels[:3] for key in panel.get_legend_handles_labels()[0]}.values())


def _draw_coverage(panel: "Axes", points: StripePoints, count: int, size: tuple[int, int], lost: list[int]) -> None:
    """Draw the shares of the columns and of the rows of each frame that hold a point."""
    for name, lines, colour, label in (
        ("i", size[1], COLUMNS, "columns that hold a point"),
        ("j", size[0], ROWS, "rows that hold a point"),
    ):
        held = distinct_rows(np.column_stack([points["frame"], np.rint(points[name])])).rows
        share = np.bincount(held[:, 0].astype(np.intp), minlength=count) / lines
        _draw_line(panel, 100 * share, lost, colour, label)
    panel.set(ylabel="covered, % of the image", ylim=(0, None))


def _draw_quantiles(panel: "Axes", name: str, points: StripePoints, count: int) -> None:
    """Draw median and middle 80 % of a measured value, frame by frame, with gaps at frames without points."""
    quantiles = np.full((count, 3), np.nan)
    numbers, starts = np.unique(points["frame"], return_index=True)
    for number, values in zip(numbers, np.split(points[name], starts[1:]), strict=False):
        quantiles[number] = np.quantile(values, (0.1, 0.5, 0.9))
    low, middle, high = quantiles.T
    panel.fill_between(np.arange(count), low, high, color=BAND, linewidth=0, label="middle 80 %")
    _draw_line(panel, middle, [], LINE, "median")
    panel.set(ylabel=MEASURED[name], ylim=(0, ENDS.get(name)))


def _draw_line(
    panel: "Axes", values: NDArray[np.floating | np.integer], lost: list[int], colour: str, label: str
) -> None:
    """Draw one value per frame as a line with gaps at lost frames."""
    heights = np.array(values, np.float64)
    heights[lost] = np.nan
    panel.plot(heights, color=colour, linewidth=1, marker=".", markersize=2, label=label or None)

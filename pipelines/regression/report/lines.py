"""Plot the history of a figure: a line that ends in the last night, and a band around the accepted value."""

from collections.abc import Callable, Sequence

from footscan.report.markup import text
from pipelines.regression.report.result import JudgedFigure

WIDTH, HEIGHT, MARGIN = 180.0, 36.0, 4.0
"""Size and margin of the plot, in units of the drawing."""
FEWEST = 8
"""Nights that the plot has room for at least, so that the line of a young history stays short."""
COLOURS = {"better": "#17632f", "same": "#1f6f8b", "worse": "#b3261e", "missing": "#b3261e", "new": "#7a5200"}


def history_line(figure: JudgedFigure) -> str:
    """Draw a small plot as SVG: the band of the tolerance, a line from night to night, a dot for the last night."""
    values = [value for value in figure.history if value is not None]
    band = [] if figure.accepted is None else [figure.accepted - figure.allowed, figure.accepted + figure.allowed]
    if not values:
        return ""
    least, most = _range(values, band)

    def x(night: int) -> float:
        spacing = (WIDTH - 2 * MARGIN) / max(len(figure.history) - 1, FEWEST - 1)
        return WIDTH - MARGIN - spacing * (len(figure.history) - 1 - night)

    def y(value: float) -> float:
        return MARGIN + (HEIGHT - 2 * MARGIN) * (most - value) / (most - least)

    parts = []
    if band:
        low, high = (min(max(y(at), 0.0), HEIGHT) for at in band)
        parts.append(f'<rect class="band" x="0" y="{high:.1f}" width="{WIDTH:g}" height="{max(low - high, 0.8):.1f}"/>')
    points = [(x(night), y(value)) for night, value in enumerate(figure.history) if value is not None]
    parts.append(f'<path class="line" d="{_path(figure.history, x, y)}"/>')
    colour = COLOURS[figure.verdict]
    if figure.history[-1] is not None:
        parts.append(f'<circle cx="{points[-1][0]:.1f}" cy="{points[-1][1]:.1f}" r="2.6" fill="{colour}"/>')
    label = f"{figure.name} in {len(values)} nights, from {min(values):g} to {max(values):g}"
    return (
        f'<svg class="history" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{text(label)}">'
        f"<title>{text(label)}</title>{''.join(parts)}</svg>"
    )


def _range(values: Sequence[float], band: Sequence[float]) -> tuple[float, float]:
    """Range of the plot: all nights and the band, widened if they are all equal."""
    least, most = min([*values, *band]), max([*values, *band])
    return (least, most) if most > least else (least - 1.0, most + 1.0)


def _path(history: Sequence[float | None], x: Callable[[int], float], y: Callable[[float], float]) -> str:
    """SVG path from night to night, broken at nights without the figure; a lone night is a dot."""
    path, is_open = [], False
    for night, value in enumerate(history):
        if value is not None:
            path.append(f"{'L' if is_open else 'M'}{x(night):.1f} {y(value):.1f}" + ("" if is_open else "h0"))
        is_open = value is not None
    return "".join(path)

"""The history of a figure as a line: last night at the right, around it what was accepted."""

from collections.abc import Callable, Sequence

from footscan.report.markup import text
from pipelines.regression.report.result import JudgedFigure

WIDTH, HEIGHT, MARGIN = 180.0, 36.0, 4.0
FEWEST = 8
"""The line of a young history is short: nights stand at least as close as so many would."""
COLOURS = {"better": "#17632f", "same": "#1f6f8b", "worse": "#b3261e", "missing": "#b3261e", "new": "#7a5200"}


def history_line(figure: JudgedFigure) -> str:
    """A small plot as SVG: a band of what is the same as accepted, a line from night to night, a dot for the last."""
    known = [value for value in figure.history if value is not None]
    band = [] if figure.accepted is None else [figure.accepted - figure.allowed, figure.accepted + figure.allowed]
    if not known:
        return ""
    least, most = _range(known, band)

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
    label = f"{figure.name} in {len(known)} nights, from {min(known):g} to {max(known):g}"
    drawn = "".join(parts)
    return (
        f'<svg class="history" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{text(label)}">'
        f"<title>{text(label)}</title>{drawn}</svg>"
    )


def _range(known: Sequence[float], band: Sequence[float]) -> tuple[float, float]:
    """What the plot reaches over: all nights and the band; something around them where they are all one."""
    least, most = min([*known, *band]), max([*known, *band])
    return (least, most) if most > least else (least - 1.0, most + 1.0)


def _path(history: Sequence[float | None], x: Callable[[int], float], y: Callable[[float], float]) -> str:
    """A line from night to night, broken where there is no figure; a lone night is a dot."""
    path, is_open = [], False
    for night, value in enumerate(history):
        if value is not None:
            path.append(f"{'L' if is_open else 'M'}{x(night):.1f} {y(value):.1f}" + ("" if is_open else "h0"))
        is_open = value is not None
    return "".join(path)

"""Figures with panels side by side, as PNG; the same content gives the same bytes."""

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 4
"""Panels in a row."""
INK = "#222222"


def panels(count: int, frame_inches: float) -> "tuple[Figure, list[Axes]]":
    """A figure with `count` panels and `frame_inches` of additional height; surplus panels of a row are hidden."""
    from matplotlib.figure import Figure

    rows = -(-count // COLUMNS)
    figure = Figure(figsize=(13, frame_inches + 2.65 * rows), dpi=110, layout="constrained")
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel().tolist()
    for panel in axes[count:]:
        panel.set_axis_off()
    return figure, axes


def png_of(figure: "Figure") -> bytes:
    """Encode the figure as PNG."""
    png = io.BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()

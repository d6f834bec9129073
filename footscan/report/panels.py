"""A picture of panels side by side, as PNG; the same content gives the same bytes."""

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 4
INK = "#222222"


def panels(count: int, frame_inches: float) -> "tuple[Figure, list[Axes]]":
    """A figure with `count` panels and `frame_inches` of height besides; what the last row has too much is hidden."""
    from matplotlib.figure import Figure

    rows = -(-count // COLUMNS)
    figure = Figure(figsize=(13, frame_inches + 2.65 * rows), dpi=110, layout="constrained")
    every = figure.subplots(rows, COLUMNS, squeeze=False).ravel().tolist()
    for panel in every[count:]:
        panel.set_axis_off()
    return figure, every


def png_of(figure: "Figure") -> bytes:
    """The figure as PNG."""
    png = io.BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()

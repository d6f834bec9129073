"""A figure of a refused capture of the reference object."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.refused_capture import Evidence
from footscan.report.panels import panels, png_of

STRIPE, EXPECTED, FOUND = "#00d0ff", "#ffd000", "#ff3bd4"


def capture_figure(reason: str, shown: Sequence[tuple[Evidence, NDArray[np.uint8] | None]]) -> bytes:
    """Draw a panel for each piece of evidence, as PNG.

    A panel shows the frame (rows, columns, 3), its stripe, and the outline of the object where it was expected and
    where it stood. The frame is None if it cannot be decoded.
    """
    from matplotlib.lines import Line2D

    figure, places = panels(len(shown), 0.9)
    for panel, (evidence, image) in zip(places, shown, strict=False):
        panel.set_axis_off()
        caption = "cannot be decoded" if image is None else _count(evidence)
        panel.set_title(f"Camera {evidence.camera}, frame {evidence.frame}: {caption}", fontsize=8)
        if image is None:
            continue
        panel.imshow(image)
        panel.autoscale(False)
        for points, colour, size in (
            (evidence.stripe, STRIPE, 1.2),
            (evidence.expected, EXPECTED, 1.1),
            (evidence.found, FOUND, 1.1),
        ):
            panel.plot(points[:, 0], points[:, 1], ".", color=colour, markersize=size, markeredgewidth=0)
    names = [("the stripe", STRIPE)]
    if any(len(evidence.expected) for evidence, _ in shown):
        names.append(("the object where it should stand", EXPECTED))
    if any(len(evidence.found) for evidence, _ in shown):
        names.append(("where it stood", FOUND))
    keys = [Line2D([], [], color=colour, linewidth=2, label=name) for name, colour in names]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.suptitle(reason.replace("$", r"\$"), fontsize=10, wrap=True)
    return png_of(figure)


def _count(evidence: Evidence) -> str:
    return f"{len(evidence.stripe)} points" if len(evidence.stripe) else "no stripe"

"""What a refused capture of the reference object shows."""

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.refused_capture import Evidence

COLUMNS = 4
STRIPE, EXPECTED, FOUND = "#00d0ff", "#ffd000", "#ff3bd4"


def capture_figure(reason: str, shown: Sequence[tuple[Evidence, NDArray[np.uint8] | None]]) -> bytes:
    """A PNG with one panel for each piece of evidence: the frame (rows, columns, 3), where it can be decoded, the
    stripe that was found in it, and the outline of the object where it should stand and where it stood."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    rows = -(-len(shown) // COLUMNS)
    figure = Figure(figsize=(13, 0.9 + 2.65 * rows), dpi=110, layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel in panels:
        panel.set_axis_off()
    for panel, (evidence, image) in zip(panels, shown, strict=False):
        panel.set_title(f"Camera {evidence.camera}, frame {evidence.frame}: {_count(evidence)}", fontsize=8)
        if image is None:
            panel.set_title(f"Camera {evidence.camera}, frame {evidence.frame}: cannot be decoded", fontsize=8)
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
    png = io.BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()


def _count(evidence: Evidence) -> str:
    return f"{len(evidence.stripe)} points" if len(evidence.stripe) else "no stripe"

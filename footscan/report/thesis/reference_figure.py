"""The reference object as a cloud of eight cameras (Figures 4-7 and 4-8), by several calibrations side by side."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.report.panels import png_of

SHOWN_MM = 80.0
"""Half the breadth of a panel: the object is 100 mm broad and high."""
Floats = NDArray[np.float64]


def reference_figure(profile: Floats, clouds: Mapping[str, Sequence[Floats]]) -> bytes:
    """Draw the stripes of the cameras in the laser plane, one panel a calibration, as PNG.

    Parameters
    ----------
    profile : (C, 2) corners (Y, Z) of the object, mm
    clouds : calibration -> (N, 2) Y and Z, mm, of each camera's points
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.4), dpi=110, layout="constrained")
    outline = np.vstack([profile, profile[:1]])
    for panel, (name, cameras) in zip(figure.subplots(1, len(clouds), squeeze=False)[0], clouds.items(), strict=True):
        panel.plot(outline[:, 0], outline[:, 1], color="black", linewidth=0.8)
        for number, points in enumerate(cameras, start=1):
            panel.plot(points[:, 0], points[:, 1], ".", markersize=1.5, label=str(number))
        middle = profile.mean(axis=0)
        panel.set_xlim(middle[0] - SHOWN_MM, middle[0] + SHOWN_MM)
        panel.set_ylim(middle[1] - SHOWN_MM, middle[1] + SHOWN_MM)
        panel.set_aspect("equal")
        panel.set_title(name, fontsize=10)
        panel.set_xlabel("Y, mm", fontsize=8)
        panel.set_ylabel("Z, mm", fontsize=8)
        panel.legend(title="camera", fontsize=7, title_fontsize=7, markerscale=5, loc="upper right")
    return png_of(figure)

"""Colours of the surface's vertices, from the cameras that have laser-off frames."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.heads.planes import corrected
from footscan.cloud.points import joined
from footscan.cloud.views import views_of
from footscan.surface.texture import vertex_colours
from pipelines.arrays import pack, unpack
from schemas.calibration import Calibration
from schemas.heads import HeadsReport


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Colour the vertices of the surface.

    `inputs`: `surface`, the `calibration` of all cameras, `heads`, where they were, `points-N` and `colours-N` of each
    that has colours. The result has no `colours` if no point has a colour.
    """
    del parameters, places
    surface = unpack(inputs["surface"])
    views = views_of(Calibration.model_validate_json(inputs["calibration"]).cameras)
    points, colours = [], []
    for name in sorted((name for name in inputs if name.startswith("colours-")), key=lambda name: int(name[8:])):
        of_camera = unpack(inputs[name])
        mapped = unpack(inputs[f"points-{name[8:]}"])["points"]
        seen = of_camera["seen"][mapped["source"]]
        points.append(mapped.compress(seen))
        colours.append(of_camera["colours"][mapped["source"][seen]])
    if not any(map(len, points)):
        return pack()
    seen, _ = corrected(joined(points), views, HeadsReport.model_validate_json(inputs["heads"]))
    colours_of_vertices = vertex_colours(
        surface["vertices"],
        surface["normals"],
        surface["faces"],
        surface.get("filled", np.zeros(len(surface["vertices"]), np.bool_)),
        seen,
        np.concatenate(colours),
        {camera: view.centre for camera, view in views.items()},
        surface["cut_mm"].item() if "cut_mm" in surface else None,
    )
    return pack(colours=colours_of_vertices)

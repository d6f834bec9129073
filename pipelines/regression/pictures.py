"""How far last night's shape lies from the accepted one, or from that of the last good night, as far as the store still
has both."""

from collections.abc import Mapping

import numpy as np

from footscan.mesh.formats.files import Shape
from footscan.report.deviation import deviation_of, deviation_pictures
from footscan.verify.compare import vertex_distances
from footscan.verify.regions import foot_regions
from pipelines.engine.store.store import Store
from pipelines.regression.figures.delivered import shape_of
from pipelines.regression.first_step import KnownSteps
from schemas.base.errors import FootscanError

LAST_GOOD = "that of the last good night"
SHAPES = ("surface", "orient")
"""The steps whose results are shapes: a mesh, and the cloud that it is made of, which stands in for it."""


def difference_pictures(
    known: KnownSteps, present: Mapping[str, str], store: Store
) -> tuple[dict[str, bytes], str | None]:
    """PNG pictures by caption of the first shape that differs, and a note where there should be some and are none.

    Parameters
    ----------
    present : results of the steps by name, as in `AcceptedStep`
    """
    was = {step.step: step.result for step in known.accepted}
    lately = {step.step: step.result for step in known.good}
    differing = [name for name in SHAPES if name in was and name in present and was[name] != present[name]]
    for name in differing:
        now = _shape(store, present[name])
        for whose, result in (("the accepted one", was[name]), (LAST_GOOD, lately.get(name, ""))):
            before = _shape(store, result)
            if before is None or now is None or result == present[name]:
                continue
            try:
                return _pictures(before, now, whose), None
            except FootscanError as error:
                return {}, f"{name}: no pictures, {error}"
    note = "No pictures: the store does not have the accepted shape any more." if differing else None
    return {}, note


def _pictures(before: Shape, now: Shape, whose: str) -> dict[str, bytes]:
    distances = vertex_distances(now, before)
    deviation = deviation_of(now, distances, foot_regions(before) or foot_regions(now))
    what = "surface" if len(now[1]) else "cloud"
    largest = float(np.max(np.abs(deviation.distance), initial=0.0))
    said = f"{what}: distance to {whose}, at most {largest:.3f} mm"
    return {f"{said}; from {file.removesuffix('.png')}": png for file, png in deviation_pictures(deviation).items()}


def _shape(store: Store, digest: str) -> Shape | None:
    """The mesh or cloud that a result is; None where it is not there."""
    if len(digest) != 64 or (data := store.get(digest)) is None:
        return None
    return shape_of(data)

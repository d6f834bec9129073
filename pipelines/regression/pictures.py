"""Pictures of the distances from the last night's shape to the accepted one, or to that of the last good night."""

from collections.abc import Mapping

import numpy as np

from footscan.mesh.formats.files import Shape
from footscan.report.deviation import deviation_of, deviation_pictures
from footscan.verify.compare import vertex_distances
from footscan.verify.regions import foot_regions
from pipelines.engine.store.store import Store
from pipelines.regression.figures.delivered import shape_of
from pipelines.regression.first_step import EarlierSteps
from schemas.base.errors import FootscanError

LAST_GOOD = "that of the last good night"
SHAPES = ("surface", "orient")
"""Steps whose results are shapes: a mesh, and as a substitute the cloud that it is made of."""


def difference_pictures(
    earlier: EarlierSteps, present: Mapping[str, str], store: Store
) -> tuple[dict[str, bytes], str | None]:
    """Draw the first shape that differs: PNG by caption, and a note on why pictures are missing, if they are.

    Parameters
    ----------
    present : results of the steps by name, as in `AcceptedStep`
    """
    accepted = {step.step: step.result for step in earlier.accepted}
    good = {step.step: step.result for step in earlier.good}
    differing = [name for name in SHAPES if name in accepted and name in present and accepted[name] != present[name]]
    for name in differing:
        now = _shape(store, present[name])
        for whose, result in (("the accepted one", accepted[name]), (LAST_GOOD, good.get(name, ""))):
            before = _shape(store, result)
            if before is None or now is None or result == present[name]:
                continue
            try:
                return _pictures(before, now, whose), None
            except FootscanError as error:
                return {}, f"{name}: no pictures, {error}"
    note = "No pictures: the store no longer has the accepted shape." if differing else None
    return {}, note


def _pictures(before: Shape, now: Shape, whose: str) -> dict[str, bytes]:
    distances = vertex_distances(now, before)
    deviation = deviation_of(now, distances, foot_regions(before) or foot_regions(now))
    kind = "surface" if len(now[1]) else "cloud"
    largest = float(np.max(np.abs(deviation.distance), initial=0.0))
    caption = f"{kind}: distance to {whose}, at most {largest:.3f} mm"
    return {f"{caption}; from {file.removesuffix('.png')}": png for file, png in deviation_pictures(deviation).items()}


def _shape(store: Store, digest: str) -> Shape | None:
    """The mesh or cloud of a result; None if the store does not have it."""
    if len(digest) != 64 or (data := store.get(digest)) is None:
        return None
    return shape_of(data)

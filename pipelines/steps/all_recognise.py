"""The poses of the reference object, refused unless every camera recognises it."""

from collections.abc import Mapping
from pathlib import Path

from footscan.calibration.capture.as_arrays import camera_views_of
from footscan.calibration.capture.refused_capture import refuse_unrecognised
from pipelines.arrays import unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return the `poses` unchanged, or refuse the capture if a camera does not recognise the object.

    `inputs`: the `poses`, each camera's `stripe-N` and `recognised-N`; `places`: the `capture` document.

    Raises
    ------
    RefusedCapture
        A camera does not recognise the object.
    """
    del parameters
    camera_views = camera_views_of({name: unpack(data) for name, data in inputs.items() if name != "poses"})
    refuse_unrecognised(camera_views.views, camera_views.unrecognised, str(places["capture"]))
    return inputs["poses"]

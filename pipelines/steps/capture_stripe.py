"""The film of the reference object to the stripe of one camera, frame by frame."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.stripe_arrays import stripe_arrays
from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.stripe.extract import extract_stripe
from footscan.stripe.laser import adapted
from pipelines.arrays import pack
from schemas.base.errors import DamagedError
from schemas.parameters.extraction import ExtractionParameters


def run(inputs: Mapping[str, bytes], parameters: ExtractionParameters, places: Mapping[str, Path]) -> bytes:
    """Find the stripe in each frame of one camera.

    Parameters
    ----------
    inputs : mapping
        The `film`: empty, or the digests of all files by name if another step filmed them. Then `file`, the name of
        the film, makes the keys of the cameras differ.
    parameters : ExtractionParameters
    places : mapping
        The `film`, and the `capture` document.

    Raises
    ------
    DamagedError
        The film or the document is not the one that was filmed.
    """
    if inputs["film"]:
        _check_filmed(places["film"], json.loads(inputs["film"]), places["capture"])
    film = open_film(places["film"])
    parameters = adapted(film, parameters)
    stripes: list[NDArray[np.float64]] = []
    lost: list[int] = []
    for number, frame in enumerate(pixel_frames(film)):
        if frame is None:
            lost.append(number)
            stripes.append(np.empty((0, 2)))
            continue
        points = extract_stripe(frame, parameters)
        stripes.append(np.column_stack([points["i"], points["j"]]))
    return pack(**stripe_arrays(stripes, film.size.px, lost))


def _check_filmed(film: Path, digests: Mapping[str, str], capture: Path) -> None:
    for file in (film, capture):
        if not file.is_file() or hashlib.sha256(file.read_bytes()).hexdigest() != digests[file.name]:
            capture.unlink(missing_ok=True)  # the next run then films the capture again
            raise DamagedError(f"{file}: is not what was filmed; run again to film it anew")

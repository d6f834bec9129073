"""The film of a body to a calibration with the laser planes."""

import json
from collections.abc import Mapping
from pathlib import Path

from footscan.calibration.travel.body import Body
from footscan.calibration.travel.from_film import CameraTravel, with_laser_planes
from footscan.cloud.lasers.choose import choose_lasers
from footscan.cloud.mapping import map_stripe
from footscan.cloud.points import joined
from footscan.frames.travel import x_of_frames
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.frames import FrameManifest
from schemas.parameters.mapping import MappingParameters


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Find the laser planes of all cameras, as calibration.json.

    `inputs`: the `calibration`, the `body` (vertices and faces), the `heads` of the cameras, and `stripe-N`,
    `manifest-N`, and `travel-N` or `positions-N` of each camera.

    Raises
    ------
    Finding
        The film does not show the body.
    RefusedInput
        A frame has no position.
    """
    del parameters, places
    shape = unpack(inputs["body"])
    heads = {int(camera): int(head) for camera, head in json.loads(inputs["heads"]).items()}
    films = {}
    for name in inputs:
        if name.startswith("stripe-"):
            camera = int(name.partition("-")[2])
            frames = len(FrameManifest.model_validate_json(inputs[f"manifest-{camera}"]).frames)
            x = x_of_frames(inputs.get(f"travel-{camera}"), inputs.get(f"positions-{camera}"), frames)
            films[camera] = CameraTravel(unpack(inputs[name])["stripe"], x)
    calibration = Calibration.model_validate_json(inputs["calibration"])
    films = _by_laser(calibration, films)
    made, _ = with_laser_planes(calibration, films, heads, Body(shape["vertices"], shape["faces"]))
    return (made.model_dump_json(indent=2) + "\n").encode()


def _by_laser(calibration: Calibration, films: Mapping[int, CameraTravel]) -> dict[int, CameraTravel]:
    """The films of all views: of a camera that sees two lasers, the points of each."""
    maps = [one.model_copy(update={"plane": None}) for camera in sorted(films) for one in calibration.maps(camera)]
    if all(one.laser == 1 for one in maps):
        return dict(films)
    mapped = [(films[one.camera], one) for one in maps]
    points = joined(map_stripe(film.stripe, one, film.x_of_frame, MappingParameters()) for film, one in mapped)
    choice = choose_lasers(points)
    real = points.compress(~choice.other & ~choice.unassigned)
    return {
        one.view: film._replace(stripe=film.stripe[real["source"][real["camera"] == one.view]]) for film, one in mapped
    }

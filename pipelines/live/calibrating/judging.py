"""The stripe in the frames of a session, and what is wrong with the placement that was filmed last."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.from_capture import CameraView
from footscan.calibration.capture.judged_placement import in_words
from footscan.calibration.capture.reference import edges_of
from footscan.calibration.capture.standing import STILL_PX, Complaint, judge_standing, moved_px, points_on_object
from footscan.capture.light_choice import stripe_seen
from footscan.frames.image import decode_image
from footscan.report.calibration.coverage import coverage_picture, covered_share
from footscan.stripe.extract import extract_stripe
from footscan.stripe.laser import adapted_to
from pipelines.live.calibrating.stills import Stills
from schemas.calibration import Calibration
from schemas.mounting import CaptureCamera, mounting_of
from schemas.parameters.extraction import ExtractionParameters
from schemas.reference import ReferenceObject

Floats = NDArray[np.float64]

SATURATED = 0.8
"""Share of the stripe's width that is white from which its middle is unsure. Chosen by hand: at 0.6, as in the films of
the virtual scanner, maps are known to 0.01 mm."""
FAINT = 60.0
"""Grey level of red in the stripe's middle below which much of it is lost in noise. Chosen by hand."""


@dataclass
class SeenPlacements:
    """The stripes of all placements of a session, by number of the placement and of the camera."""

    stripes: dict[int, dict[int, Floats]] = field(default_factory=dict)
    """(N, 2) points, px."""
    image_px: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Columns and rows of each camera."""
    _on_object: dict[int, dict[int, NDArray[np.bool_]]] = field(default_factory=dict)
    """(N,) which points lie on the object, where it is recognised."""

    def add(self, number: int, frames: Mapping[int, bytes]) -> None:
        """Find the stripe in the JPEG of each camera; ValueError if one is damaged."""
        stripes = {}
        for camera, jpeg in frames.items():
            stripes[camera], *size = _stripe(jpeg)
            self.image_px[camera] = (size[0], size[1])
        self._on_object.pop(number, None)
        self.stripes[number] = stripes

    def coverage(self) -> dict[int, float]:
        """The share of each camera's image between its stripes."""
        return {camera: covered_share(self._of(camera), size) for camera, size in sorted(self.image_px.items())}

    def picture(self, latest: int | None) -> str:
        """Draw the stripes in each camera's image, as SVG; those of the placement `latest` stand out."""
        covered = {camera: self._of(camera) for camera in self.image_px}
        return coverage_picture(self.image_px, covered, {} if latest is None else self.stripes.get(latest, {}))

    def judge(
        self,
        number: int,
        stills: Stills,
        reference: ReferenceObject,
        order: Sequence[int],
        tolerance_mm: float,
        calibration: Calibration | None,
    ) -> list[Complaint]:
        """Judge placement `number`, whose stripes were added, by those in `order` before it."""
        if stills.problems:
            why = "; ".join(stills.problems.values())
            return [Complaint("no picture", f"{why}: check cables and hubs", tuple(stills.problems))]
        numbers = [*(other for other in order if other != number and other in self.stripes), number]
        views = {camera: self._view(camera, numbers) for camera in self.image_px}
        placements = np.array([reference.placements_mm[n] for n in numbers], np.float64)
        edges = edges_of(reference.profile_mm)
        complaints, self._on_object[number] = judge_standing(views, edges, placements, tolerance_mm, calibration)
        return [*complaints, *self._moved(number, stills), *_badly_lit(stills)]

    def recall(self, frames: Mapping[int, Mapping[int, bytes]], reference: ReferenceObject) -> list[int]:
        """Find the stripe in the placements of an interrupted session: the JPEGs by placement and camera.

        Returns
        -------
        Placements of which a frame is damaged, and which are left out.
        """
        damaged = []
        for number, of_placement in frames.items():
            try:
                self.add(number, of_placement)
            except ValueError:
                damaged.append(number)
        numbers, edges = list(self.stripes), edges_of(reference.profile_mm)
        placements = np.array([reference.placements_mm[n] for n in numbers], np.float64)
        self._on_object = {number: {} for number in numbers}
        for camera in self.image_px if numbers else ():
            all_lie = points_on_object(self._view(camera, numbers), edges, placements)
            for number, lie in zip(numbers, all_lie, strict=True):
                self._on_object[number][camera] = lie
        return damaged

    def _moved(self, number: int, stills: Stills) -> list[Complaint]:
        ways = {
            camera: moved_px(_stripe(earlier)[0], self.stripes[number][camera])
            for camera, (earlier, _) in stills.frames.items()
        }
        moved = tuple(camera for camera, way in ways.items() if way > STILL_PX)
        if not moved:
            return []
        words = f"the stripe moved by {max(ways.values()):.1f} px within a second: keep object and heads still"
        return [Complaint("moved", words, moved)]

    def _view(self, camera: int, numbers: Sequence[int]) -> CameraView:
        mounting = mounting_of(CaptureCamera(id=camera, file="-"))
        return CameraView(camera, self.image_px[camera], [self.stripes[n][camera] for n in numbers], mounting)

    def _of(self, camera: int) -> Floats:
        """The points (N, 2) of a camera on the object in all placements."""
        stripes = [self.stripes[n][camera][lies[camera]] for n, lies in list(self._on_object.items()) if camera in lies]
        return np.concatenate([np.empty((0, 2)), *stripes])


def _stripe(jpeg: bytes) -> tuple[Floats, int, int]:
    """The stripe (N, 2), px, and the columns and rows of the image."""
    image = decode_image(jpeg)
    points: Any = extract_stripe(image, adapted_to([image], ExtractionParameters()))
    return np.column_stack([points["i"], points["j"]]), image.shape[1], image.shape[0]


def _badly_lit(stills: Stills) -> list[Complaint]:
    """Cameras that see the stripe much too bright, or too dark."""
    bright, dark = [], []
    for camera, (_, jpeg) in stills.frames.items():
        image = decode_image(jpeg)
        seen = stripe_seen([image], adapted_to([image], ExtractionParameters()))
        if seen.points and seen.saturation > SATURATED:
            bright.append(camera)
        if seen.points and seen.peak < FAINT:
            dark.append(camera)
    complaints = []
    if bright:
        words = f"the stripe is a white band in {in_words(bright)}: there is too much light"
        complaints.append(Complaint("saturated", words, tuple(bright)))
    if dark:
        words = f"the stripe is faint in {in_words(dark)}: there is too little light of the laser, or dirt"
        complaints.append(Complaint("faint", words, tuple(dark)))
    return complaints

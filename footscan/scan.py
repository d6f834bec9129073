"""A recorded scan as arrays: for notebooks and scripts, without the command, the store or Dask.

Every property is computed when it is first asked for, by the functions that the steps of a run call, and is kept.
"""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from footscan.clean import Cleaned, clean
from footscan.cloud.fusion.fuse import Fusion, fuse
from footscan.cloud.heads.find import find_heads
from footscan.cloud.heads.planes import corrected, heads_of
from footscan.cloud.mapping import map_stripe, refuse_other_size
from footscan.cloud.normals import estimate_normals
from footscan.cloud.points import joined, of_cameras
from footscan.cloud.views import View, views_of
from footscan.frames.film import open_background, open_film
from footscan.frames.image import Rgb
from footscan.frames.reader import FrameReader, backgrounds_of, noting_lost, pixel_frames
from footscan.frames.travel import read_positions, travelled
from footscan.measure.scanned_foot import measure_scanned_foot
from footscan.mesh.mesh import Mesh
from footscan.recordings.calibration_checks import check_of_scan, checks_of
from footscan.recordings.scans import RecordedScan, read_scan
from footscan.stripe.film import extract_film
from footscan.stripe.laser import adapted
from footscan.stripe.points import StripePoints
from footscan.surface.errors.evidence import Evidence
from footscan.surface.surface_of_cloud import surface_of_cloud, tip_doubts_mm
from schemas.base.errors import Finding, RefusedInput
from schemas.base.json_files import read_text
from schemas.calibration import Calibration, calibration_from_json
from schemas.calibration_check import ScanCheck
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.measures import Measures
from schemas.movement import MovementReport
from schemas.parameters.scan import ScanParameters
from schemas.scan import CameraFilm, Travel


class OpenScan:
    """A recorded scan; see `open_scan`."""

    def __init__(
        self,
        recorded: RecordedScan,
        calibration: Calibration,
        parameters: ScanParameters,
        calibration_check: ScanCheck | None = None,
    ) -> None:
        self.recorded = recorded
        """The folder and the content of scan.yaml."""
        self.calibration = calibration
        self.calibration_check = calibration_check
        """What the last check of the calibration before the scan says; None if it was not checked."""
        self.parameters = parameters
        self._films = {camera.id: camera for camera in recorded.document.cameras}
        self._lost: dict[int, list[int]] = {}

    @property
    def cameras(self) -> tuple[int, ...]:
        """Numbers of the cameras that filmed it."""
        return tuple(sorted(self._films))

    def frames(self, camera: int) -> Iterator[Rgb | None]:
        """The frames of a camera in order, each (rows, columns, 3) uint8, RGB; None for one that is lost or torn.

        Each array is valid until the next is asked for: copy what you keep. RefusedInput where the film is missing or
        of another kind.
        """
        return pixel_frames(open_film(self.recorded.film(self._film(camera))))

    @cached_property
    def stripes(self) -> Mapping[int, StripePoints]:
        """By camera, the (N,) stripe points of `footscan.stripe.points.STRIPE_DTYPE`: frame, i and j in px..."""
        return {camera: self._stripe(camera) for camera in self.cameras}

    @cached_property
    def points(self) -> Mapping[int, NDArray[np.void]]:
        """By camera, the (N,) world points of `footscan.cloud.points.POINT_DTYPE`: x, y, z in mm, scanner frame...

        A camera that sees two lasers has each point twice: by the map of either, until the cloud is cleaned.
        """
        return {camera: self._points(camera) for camera in self.cameras}

    @cached_property
    def _views(self) -> Mapping[int, View]:
        """Of the calibrated cameras, by number, with their heads as calibrated."""
        return views_of(self._used.cameras)

    @cached_property
    def heads(self) -> HeadsReport:
        """Where the heads were, beside where the calibration says."""
        points = joined(self.points.values())
        return find_heads(points, self._views, self.parameters.heads)

    @property
    def cloud(self) -> NDArray[np.void]:
        """(N,) points of all cameras, cleaned and fused, as `points`; Finding where none is left."""
        return of_cameras(self._fused.cloud)

    @cached_property
    def _fused(self) -> Fusion:
        """`cloud` with the numbers of views, and how the cameras agree."""
        return fuse(self._cleaned.points, self.parameters.fusion, heads_of(self._views))

    @property
    def movement(self) -> MovementReport:
        """How far the foot moved during the scan; the points of `cloud` are moved back."""
        return self._cleaned.movement

    @property
    def glass(self) -> GlassPlane:
        """The glass during the scan, from the skin on it; Finding where there are no points."""
        return self._cleaned.removed.glass

    @cached_property
    def _cleaned(self) -> Cleaned:
        together = joined(self.points.values())
        if not len(together):
            raise Finding("no stripe in any camera, expected a foot in the films")
        placed = {camera: self._x_of_frame(camera) for camera in self.cameras}
        for camera, lost in self._lost.items():
            placed[camera][lost] = np.nan
        filmed = {one.view: placed[one.camera] + one.ahead_mm for one in self._used.cameras}
        together, views = corrected(together, self._views, self.heads)
        return clean(together, views, self.parameters.outliers, filmed, self.recorded.document.later_passes)

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(N, 3) outward unit normals of the points of `cloud`."""
        return np.asarray(estimate_normals(self._fused.cloud, self._views, self.parameters.normals), np.float64)

    @cached_property
    def mesh(self) -> Mesh:
        """The surface: vertices (V, 3) mm, faces (F, 3), normals (V, 3), camera (V,), filled (V,)."""
        return surface_of_cloud(self.cloud, self.normals, self.parameters.surface)

    @cached_property
    def measures(self) -> Measures:
        """The measures of the foot; Finding where the surface is no foot."""
        checked = None if self.calibration_check is None else self.calibration_check.doubt
        doubts = [*filter(None, [checked, self.heads.doubt])]
        measures = measure_scanned_foot(
            self.mesh,
            self.recorded.document.side,
            self.glass,
            doubts,
            Evidence(
                cloud=self._fused.cloud,
                seen=self._cleaned.points,
                parted_mm=self._cleaned.removed.parted_mm,
                agreement=self._fused.report,
                movement=self.movement,
                lasers=self._cleaned.removed.lasers,
                contested_mm=self._cleaned.removed.contested_mm,
                tip_doubts_mm=tip_doubts_mm(self.mesh),
            ),
        )
        return measures.model_copy(update={"posture": self.recorded.document.posture})

    @cached_property
    def _used(self) -> Calibration:
        """The calibration of the cameras that filmed it."""
        cameras = [one for camera in self.cameras for one in self.calibration.maps(camera, self.recorded.file)]
        return self.calibration.model_copy(update={"cameras": cameras})

    def _film(self, camera: int) -> CameraFilm:
        if camera not in self._films:
            known = ", ".join(map(str, self.cameras))
            raise RefusedInput(self.recorded.file, f"has no camera {camera}, expected one of {known}", field="cameras")
        return self._films[camera]

    def _stripe(self, camera: int) -> StripePoints:
        film = open_film(self.recorded.film(self._film(camera)))
        background: FrameReader | None = None
        if (place := self.recorded.background(self._film(camera))) is not None:
            background = open_background(place, film.size, film.count)
        given = self.parameters.extraction.with_laser(self.recorded.document.laser)
        parameters = adapted(film, given, background)
        backgrounds = None if background is None else backgrounds_of(background, film.count)
        lost = self._lost[camera] = []
        return extract_film(noting_lost(pixel_frames(film), lost), parameters, backgrounds)

    def _points(self, camera: int) -> NDArray[np.void]:
        film, parts = open_film(self.recorded.film(self._film(camera))), []
        for model in self.calibration.maps(camera, self.recorded.file):
            refuse_other_size(model, film.size, film.path)
            parts.append(map_stripe(self.stripes[camera], model, self._x_of_frame(camera), self.parameters.mapping))
        return np.concatenate(parts)

    def _x_of_frame(self, camera: int) -> NDArray[np.float64]:
        film = self._film(camera)
        count = open_film(self.recorded.film(film)).count
        if (positions := self.recorded.positions(film)) is not None:
            return read_positions(positions)[:count]
        return travelled(cast(Travel, film.travel or self.recorded.document.travel), count)


def open_scan(
    folder: Path | str, calibration: Path | str | None = None, parameters: ScanParameters | None = None
) -> OpenScan:
    """Open a recorded scan.

    Parameters
    ----------
    folder : the folder with scan.yaml
    calibration : calibration file; default: the one that scan.yaml names
    parameters : of the steps; default: those of a workflow without `parameters`

    Raises
    ------
    RefusedInput
        There is no scan.yaml, it breaks its format, or there is no calibration.

    Examples
    --------
    docs/python.md has them, and its tests run them.
    """
    recorded = read_scan(Path(folder))
    path = Path(calibration) if calibration is not None else recorded.calibration
    if path is None:
        raise RefusedInput(
            recorded.file, "names no calibration, expected one here or as an argument", field="calibration"
        )
    text = read_text(path, "json_bytes")
    digest = hashlib.sha256(text.encode()).hexdigest()
    check = check_of_scan(recorded, digest, checks_of(path, digest))
    return OpenScan(recorded, calibration_from_json(text, path), parameters or ScanParameters(), check)

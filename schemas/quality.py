"""quality.json: the quality of a scan and its surface."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.calibration_check import ScanCheck
from schemas.fusion import FusionReport
from schemas.glass import GlassPlane
from schemas.heads import HeadsReport
from schemas.laser import Laser
from schemas.movement import MovementReport
from schemas.used_calibration import UsedCalibration

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class CameraQuality(Document):
    """The frames and points of one camera."""

    camera: Annotated[int, Field(ge=1)]
    frames: Count
    frames_lost: Count
    """Frames that the film has a place for, but no picture that can be decoded."""
    frames_with_stripe: Count
    points: Count
    """Stripe points, before fusion."""
    laser: Laser | None = None
    """Colour of the laser in its film, given or found; null if unknown."""
    removed: dict[str, Count]
    """Points that were dropped before fusion, by reason."""


class MeshQuality(Document):
    """The completeness and topology of a mesh."""

    vertices: Count
    triangles: Count
    open_edges: Count
    """Edges with a triangle on one side only."""
    non_manifold_edges: Count
    """Edges at which more than two triangles meet."""
    components: Count
    """Parts that are not joined by a vertex."""
    holes: Count
    """Closed loops of open edges."""
    largest_hole_mm: Annotated[float, Field(ge=0)] = 0.0
    """Length of the longest of them."""
    filled_share: Share | None = None
    """Share of the area that no camera saw, without the flat cut; null if unknown."""
    cut_share: Share | None = None
    """Share of the area in the flat cut above the ankle."""
    triangle_quality: Share | None = None
    """Mean over the triangles of 4 sqrt(3) area / (sum of the squared edges), which is 1 for an even one."""
    worst_triangles: Share | None = None
    """The same, of the worst hundredth."""


class Figures(Document):
    """Distances of points to a surface, in mm; those without the prefix `signed` are absolute."""

    points: Count | None = None
    """Number of distances."""
    mean: float
    std: float
    min: float
    max: float
    p50: float
    p90: float
    p95: float
    p99: float
    rms: float
    signed_mean: float | None
    """Positive where they lie outside the other surface; null between clouds without normals."""
    signed_std: float | None = None
    signed_min: float | None = None
    signed_max: float | None = None


class RegionFigures(Figures):
    """Distances of the points in one region of a foot."""

    region: str


class Completeness(Figures):
    """Distances of the second surface to the first, which show its missing parts."""

    within_mm: Annotated[float, Field(gt=0)]
    within_share: Share
    """Share of the second surface that lies at most `within_mm` from the first."""
    regions: list[RegionFigures] = Field(default_factory=list)


class Histogram(Document):
    """Counts of distances in classes of equal width, from the least to the greatest."""

    signed: bool
    """True if the distances are signed, false if they are absolute."""
    edges_mm: list[float]
    """Edges of the classes, one more than classes. A class includes its lower edge, the last one also its upper."""
    counts: list[Count]
    shares: list[Share]


class Comparison(Figures):
    """Distances of one surface to another, in mm, and the transform that was applied first."""

    unit: Literal["mm"] = "mm"
    transform: list[list[float]] | None = None
    """4 x 4 transform that moved the first surface before the distances were taken."""
    regions: list[RegionFigures] = Field(default_factory=list)
    """Distances by region of the foot, if the second surface is a foot; regions without points are left out."""
    histograms: list[Histogram] = Field(default_factory=list)
    completeness: Completeness | None = None


class Quality(Document):
    """The content of quality.json."""

    format: Literal["footscan.quality/1"] = "footscan.quality/1"
    calibration: UsedCalibration
    calibration_check: ScanCheck | None = None
    """Whether it still held when it was last checked before the scan; null if it was not checked."""
    cameras: list[CameraQuality]
    warnings: list[str] = Field(default_factory=list)
    """Sentences on points that were dropped, on a glass plate that was moved, and on movement of the foot."""
    heads: HeadsReport = Field(default_factory=HeadsReport)
    """Places of the heads along the travel, from the skin that cameras of two heads saw."""
    movement: MovementReport = Field(default_factory=MovementReport)
    """How far the foot moved during the scan."""
    glass: GlassPlane | None = None
    """The glass during the scan, from the skin on it; null in files of earlier versions."""
    fusion: FusionReport = Field(default_factory=FusionReport)
    """Disagreement of the cameras about the same skin, and their corrections."""
    cloud_points: Count
    """Number of points of the cloud from which the surface was made."""
    mesh: MeshQuality
    truth: Comparison | None = None
    """Distances of the surface to the reference model, if the scan names one."""
    scan_warnings: list[str] | None = None
    """All that speaks against the scan, the gravest first, each with what to do about it; null in files of earlier
    versions. `warnings` here and in `heads` and `fusion` are where some of them come from."""

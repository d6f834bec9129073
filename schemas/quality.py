"""quality.json: how good a scan and its surface are."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document
from schemas.calibration import Source
from schemas.fusion import FusionReport

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class CameraQuality(Document):
    """What one camera gave."""

    camera: Annotated[int, Field(ge=1)]
    frames: Count
    frames_lost: Count
    """Frames that the film has a place for, but no picture that can be decoded."""
    frames_with_stripe: Count
    points: Count
    """Stripe points, before fusion."""
    removed: dict[str, Count]
    """Points that were dropped before fusion, by reason."""


class MeshQuality(Document):
    """How whole a mesh is."""

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
    """Of the area, what no camera saw, the flat cut apart; null where it is not known."""
    cut_share: Share | None = None
    """Of the area, the flat cut above the ankle."""
    triangle_quality: Share | None = None
    """Mean over the triangles of 4 sqrt(3) area / (sum of the squared edges), which is 1 for an even one."""
    worst_triangles: Share | None = None
    """The same, of the worst hundredth."""


class Figures(Document):
    """Distances of points to a surface, in mm. Without a prefix: how far away it is, to any side."""

    points: Count | None = None
    """How many distances were taken."""
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
    """Distances of the second surface to the first: what of it is there."""

    within_mm: Annotated[float, Field(gt=0)]
    within_share: Share
    """Of the second surface, what lies no farther than `within_mm` from the first."""
    regions: list[RegionFigures] = Field(default_factory=list)


class Histogram(Document):
    """How distances are spread over classes of one width, from the least to the greatest."""

    signed: bool
    """Whether the distances are; otherwise they count to any side alike."""
    edges_mm: list[float]
    """One more than there are classes; a class holds its lower edge, the last one its upper edge, too."""
    counts: list[Count]
    shares: list[Share]


class Comparison(Figures):
    """Distances of one surface to another, in mm, and how it was moved beforehand."""

    unit: Literal["mm"] = "mm"
    transform: list[list[float]] | None = None
    """4 x 4, what the first was moved by before the distances were taken."""
    regions: list[RegionFigures] = Field(default_factory=list)
    """By region of the foot that the second is, where it is one; what has no point is left out."""
    histograms: list[Histogram] = Field(default_factory=list)
    completeness: Completeness | None = None


class Quality(Document):
    """The content of quality.json."""

    format: Literal["footscan.quality/1"] = "footscan.quality/1"
    calibration: Source
    """The file that pixels were mapped by."""
    cameras: list[CameraQuality]
    fusion: FusionReport = Field(default_factory=FusionReport)
    """How far apart the cameras place the same skin, and how they were moved."""
    cloud_points: Count
    """Points of the cloud that the surface was made of."""
    mesh: MeshQuality
    truth: Comparison | None = None
    """Distances of the surface to the reference model, where the scan names one."""

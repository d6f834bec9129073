"""quality.json: how good a scan and its surface are."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.calibration import Source
from schemas.documents import Document

Count = Annotated[int, Field(ge=0)]


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
    """Points of the fused cloud that were dropped, by reason."""


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


class Comparison(Document):
    """Distances of one surface to another, in mm, and how it was moved beforehand."""

    unit: Literal["mm"] = "mm"
    mean: float
    std: float
    min: float
    max: float
    p50: float
    p90: float
    p95: float
    p99: float
    rms: float
    signed_mean: float
    """Positive where it lies outside the other surface."""
    transform: list[list[float]] | None = None
    """4 x 4, what the first was moved by before the distances were taken."""


class Quality(Document):
    """The content of quality.json."""

    format: Literal["footscan.quality/1"] = "footscan.quality/1"
    calibration: Source
    """The file that pixels were mapped by."""
    cameras: list[CameraQuality]
    cloud_points: Count
    """Points of the cloud that the surface was made of."""
    mesh: MeshQuality
    truth: Comparison | None = None
    """Distances of the surface to the reference model, where the scan names one."""

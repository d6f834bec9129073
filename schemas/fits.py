"""How well bodies of known form come out: a cuboid's faces and the measures between them, spheres and their quality."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.model import Document

Count = Annotated[int, Field(ge=0)]
Length = Annotated[float, Field(ge=0)]
Sheet = Annotated[float, Field(ge=0, le=5)]
Vector = tuple[float, float, float]
FaceName = Literal["front", "back", "left", "right", "top", "bottom"]
"""Of a cuboid as it stands: front is towards +X, left towards +Y, top towards +Z, as near as its axes come to these."""
Basis = Literal["faces", "stripes", "floor"]


class CuboidParameters(Document):
    """The parameters of the fit of a cuboid."""

    edge_mm: Annotated[float, Field(ge=0, le=20)] = 3.0
    """Points nearer than this to an edge belong to no face: edges are rounded, and points there are of two faces."""
    floor_mm: Annotated[float, Field(ge=-1e4, le=1e4)] = 0.0
    """Z of the plane that the cuboid stands on; its height counts from there when nothing sees its bottom."""
    sheet_mm: tuple[Sheet, Sheet] = (0.2, 0.6)
    """Least and largest standard deviation of the laser's light across its sheet. Of use where an end is square to the
    travel: one within the sheet cuts the stripe, which is seen displaced. (0, 0) does not look for that."""


class FaceFit(Document):
    """One face that was seen."""

    name: FaceName
    normal: Vector
    """Outward unit vector of the plane fitted to this face alone; the cuboid's own where it is only one stripe wide."""
    points: Count
    """Points that the plane was fitted to."""
    edge_points: Count
    """Points of the face left out because they are near an edge."""
    outliers: Count
    """Points before or behind the face, too far from it for its own noise."""
    rms_mm: Length
    """Root mean square of the distances of its points to its own plane: the face's flatness, and noise."""
    max_mm: Length
    """Largest of these distances."""
    uncertainty_mm: Length
    """Standard uncertainty of its place along its normal, from the scatter of 10 mm cells of the face."""


class CuboidDimension(Document):
    """The distance of two opposite faces, right angles given."""

    axis: Vector
    value_mm: Length | None
    """None where an end was not seen and nothing else tells its place."""
    uncertainty_mm: Length | None
    """Standard uncertainty (k = 1). It knows of noise, form and stripes, not of the calibration's scale."""
    free_mm: float | None
    """The same without the right angles: the mean distance of either face's middle to the plane of the other."""
    ends: tuple[Basis | None, Basis | None]
    """What tells its lower and upper end: points on the face; the last stripe that hits the body, how far the end
    displaces it, and the first that does not; or the floor."""
    note: str | None = None


class FaceAngle(Document):
    """The angle of two faces' own planes: 90 degrees for neighbours and 0 for opposite ones, were all perfect."""

    faces: tuple[FaceName, FaceName]
    degrees: float


class CuboidFit(Document):
    """A cuboid fitted to points."""

    unit: Literal["mm"] = "mm"
    axes: tuple[Vector, Vector, Vector]
    """Unit vectors: those nearest to X, Y and Z, in this order; of the fit with right angles."""
    dimensions: tuple[CuboidDimension, CuboidDimension, CuboidDimension]
    """Along these axes."""
    faces: list[FaceFit]
    angles: list[FaceAngle]
    points: Count
    """Distinct points that were given."""
    off_points: Count
    """Of these, points on none of the faces nor near their edges."""
    edge_mm: Length
    floor_mm: float
    stripe_step_mm: Length | None
    """Distance of the stripe planes; None where the points lie in no such planes."""


class SphereFit(Document):
    """A sphere of known diameter in points, evaluated by least squares with the diameter free and with it given."""

    unit: Literal["mm"] = "mm"
    centre_mm: Vector
    """Of the sphere with free diameter."""
    nominal_mm: Length
    diameter_mm: Length
    diameter_error_mm: float
    """Fitted minus nominal diameter: the error of size."""
    diameter_uncertainty_mm: Length
    """Standard uncertainty of the fitted diameter, from the scatter of patches of about 10 degrees."""
    radial_sd_mm: Length
    """Standard deviation of the points' distances from the centre."""
    radial_range95_mm: Length
    """Thickness of the thinnest shell about the centre that holds 95 % of the points."""
    radial_range_mm: Length
    """Thickness of the shell that holds all of the points, outliers apart."""
    fixed_centre_mm: Vector
    """Of the sphere with the nominal diameter."""
    fixed_rms_mm: Length
    """Root mean square of the distances of the points to its surface."""
    fixed_mean_mm: float
    """Mean of them, positive outside."""
    fixed_range95_mm: Length
    """As `radial_range95_mm`, about its centre."""
    points: Count
    outliers: Count
    """Points near the sphere that are too far from it for its noise."""
    covered: Annotated[float, Field(ge=0, le=1)]
    """Share of the sphere's surface that has points."""

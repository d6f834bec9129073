"""Parameters of the extraction of the stripe."""

from typing import Literal, Self

from pydantic import Field, model_validator

from schemas.base.model import Document
from schemas.laser import Laser


class ExtractionParameters(Document):
    """Parameters that separate the laser stripe from the rest of a frame and locate its centre."""

    laser: Literal["auto", "red", "green", "blue", "mono"] = Field(
        default="auto",
        description="colour of the laser in the pictures, `mono` for a camera without colours; `auto` finds it in the "
        "film. Where others say red, the colour of the laser is meant",
    )
    stripe: Literal["auto", "clear", "faint", "skeleton"] = Field(
        default="auto",
        description="`faint` for a narrow line a few grey levels above a bright surface, whose single pixels do not "
        "stand out, `clear` for any other stripe; `auto` finds out in the film. `skeleton` is the method of the "
        "thesis, for comparison: the thinned largest part that is redder than `red_threshold`",
    )
    red_threshold: int = Field(
        default=18,
        ge=1,
        le=254,
        description="grey levels by which a pixel must be redder (R - max(G, B)) than its surroundings",
    )
    full_redness: float = Field(
        default=60.0,
        ge=0.0,
        le=255.0,
        description="grey levels of redness of a film's stripe below which `red_threshold`, `smallest_contrast` and "
        "`faintest_contrast` are lowered in proportion, but not into the noise; 0 lowers nothing",
    )
    saturation: int = Field(
        default=245,
        ge=1,
        le=255,
        description="grey level of red from which a white pixel between two red flanks is the core of the stripe",
    )
    ridge_px: float = Field(
        default=2.5,
        ge=0.5,
        le=4.0,
        description="standard deviation in px of the Gaussian filter that finds the ridge of the stripe",
    )
    smallest_contrast: float = Field(
        default=12.0,
        ge=1.0,
        le=255.0,
        description="grey levels by which the stripe must stand out from both its sides",
    )
    faintest_contrast: float = Field(
        default=6.0,
        ge=1.0,
        le=255.0,
        description="grey levels by which the weaker ends of a piece of the stripe must stand out; at most "
        "`smallest_contrast`",
    )
    largest_width_px: float = Field(
        default=40.0,
        ge=2.0,
        le=100.0,
        description="full width at half height in px beyond which a red object is not the stripe",
    )
    centre_method: Literal["threshold-median", "gravity", "gaussian", "ridge", "fir"] = Field(
        default="gravity",
        description="method that takes the centre from the profile across the stripe",
    )
    centre_level: float = Field(
        default=0.5,
        ge=0.05,
        le=0.9,
        description="part of the stripe's height above which its centre of gravity is taken",
    )
    smoothing_widths: float = Field(
        default=3.0,
        ge=0.0,
        le=20.0,
        description="widths of the stripe on either side over which a centre is smoothed along it, but not round "
        "corners; 0 smooths nothing",
    )
    gap_px: float = Field(
        default=5.0,
        ge=1.5,
        le=20.0,
        description="largest distance in px between neighbouring points of one piece of the stripe",
    )
    shortest_piece_px: int = Field(
        default=12,
        ge=1,
        le=1000,
        description="number of points below which a piece is a glint",
    )
    group_gap_px: float = Field(
        default=40.0,
        ge=1.5,
        le=1000.0,
        description="largest distance in px between neighbouring pieces of one stripe",
    )
    smallest_group: float = Field(
        default=0.15,
        ge=0.0,
        le=1.0,
        description="strength of a group of pieces, relative to the strongest one, below which it is dropped",
    )
    glint_share: float = Field(
        default=0.1,
        ge=0.01,
        le=1.0,
        description="share of a film's frames, at least eight, in which a short piece must stay in one place to be a "
        "glint: the foot moves, the hardware does not; has no effect in films of fewer than eight frames",
    )
    glint_length_px: float = Field(
        default=40.0,
        ge=0.0,
        le=1000.0,
        description="extent in px from which a piece is never a glint, however long it stays in one place",
    )
    follow_reach_px: float = Field(
        default=12.0,
        ge=2.0,
        le=200.0,
        description="largest distance in px that the stripe moves from one frame to the next",
    )
    lonely_length_px: float = Field(
        default=60.0,
        ge=0.0,
        le=1000.0,
        description="extent in px below which a piece is dropped if most of it has no stripe near in the frame before "
        "or after",
    )
    largest_blur: float = Field(
        default=1.5,
        ge=1.0,
        le=100.0,
        description="multiple of the film's median width and of its median sigma: a piece that exceeds both and is "
        "hardly red is the lit rim of the skin; has no effect in films of fewer than eight frames",
    )
    ghost_reach_px: float = Field(
        default=60.0,
        ge=0.0,
        le=500.0,
        description="distance in px across the stripe within which its weaker, parallel image in a glass plate may lie",
    )
    ghost_strength: float = Field(
        default=0.05,
        ge=0.0,
        le=1.0,
        description="light, relative to the stripe beside it, below which a piece is a ghost; a piece parallel to the "
        "stripe is a ghost below half of the stripe's light",
    )

    def with_laser(self, laser: Laser | None) -> Self:
        """The same parameters with this laser; None, and parameters that name a laser, change nothing."""
        if laser is None or self.laser != "auto":
            return self
        return self.model_copy(update={"laser": laser})

    @property
    def searched_laser(self) -> Laser:
        """The laser whose stripe is searched; red while none was named or found."""
        return "red" if self.laser == "auto" else self.laser

    @model_validator(mode="after")
    def _ends_are_fainter(self) -> Self:
        strong, faint = self.smallest_contrast, self.faintest_contrast
        if faint > strong:
            raise ValueError(f"faintest_contrast: expected at most smallest_contrast, {strong:g}, found {faint:g}")
        return self

"""How far the foot moved while it was filmed."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document

Length = Annotated[float, Field(ge=0)]
Way = Annotated[float, Field(ge=-1e3, le=1e3)]


class MovementReport(Document):
    """Movement of the foot from frame to frame, as its stripes show it.

    Moments are counted in frames. Frames with one number are of one moment within a pass.
    """

    first_moments: dict[int, int] = Field(default_factory=dict)
    """Camera -> moment of its frame 0, of cameras that filmed in a later pass; 0 of all others."""
    tremor_mm: Length = 0.0
    """Root mean square of the fast movement along X, of 2 to about 8 frames to and fro."""
    agreement: Annotated[float, Field(ge=-1, le=1)] | None = None
    """Correlation between the movements that the cameras of two heads show; None with one head, or of a foot that
    hardly trembled."""
    first_frame: Annotated[int, Field(ge=0)] = 0
    x_mm: list[Way] = Field(default_factory=list)
    """Way along X by which the foot was moved back, from moment `first_frame` on; empty if it was not."""
    sway_mm: Length = 0.0
    """Standard deviation of the slow movement, at 0.2 to 1 Hz: that of most feet, or what heads show that film the same
    skin at different times; 0 if none do."""
    sway_by_axis_mm: tuple[Length, Length] | None = None
    """The same along X and along Y; None if no two heads film the same skin at different times: what was not seen may
    be there."""
    y_mm: list[Way] = Field(default_factory=list)
    """Way along Y by which the foot was moved back, from moment 0 on; empty if it was not."""
    left_x_mm: Length | None = None
    """Standard deviation of a movement along X at 0.2 to 1 Hz that has the same slope as the slow one; None if it is
    not known."""
    left_y_mm: list[Length] = Field(default_factory=list)
    """Standard deviation of what is left along Y, from moment 0 on; empty if it is not known."""
    left_y_frames: Annotated[float, Field(gt=0, le=1e3)] | None = None
    """How slowly that varies: its standard deviation relative to that of its slope by frame; None if not known."""
    warnings: list[str] = Field(default_factory=list)
    doubt: str | None = None
    """Reason for which measures are uncertain, if the foot moved so that it cannot be moved back."""

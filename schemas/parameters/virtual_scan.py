"""What a suite films."""

from typing import Literal

from schemas.base.model import Document
from schemas.parameters.simulation import SimulationSettings


class VirtualScan(Document):
    """A parametric foot before the virtual scanner: filmed once, and again where the simulator has changed."""

    side: Literal["right", "left"] = "right"
    laser_off: bool = False
    """Whether each frame is taken again with the laser off, so that the surface bears colours."""
    settings: SimulationSettings = SimulationSettings()

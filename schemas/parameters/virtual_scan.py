"""Parameters of a film of a regression suite."""

from typing import Literal

from schemas.base.model import Document
from schemas.parameters.simulation import SimulationSettings


class VirtualScan(Document):
    """A parametric foot before the virtual scanner: filmed once, and again after the simulator has changed."""

    side: Literal["right", "left"] = "right"
    laser_off: bool = False
    """True if each frame is taken again with the laser off, so that the surface has colours."""
    settings: SimulationSettings = SimulationSettings()

"""Parameters of the demo's film."""

from typing import Literal

from schemas.base.model import Document, Pseudonym
from schemas.parameters.simulation import SimulationSettings


class FilmedFoot(Document):
    """A parametric foot in front of the virtual scanner."""

    patient: Pseudonym = "P0001"
    scan: Pseudonym = "demo-R"
    side: Literal["right", "left"] = "right"
    settings: SimulationSettings = SimulationSettings()

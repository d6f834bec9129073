"""Parameters of the search for the heads' places in a scan."""

from typing import Annotated

from pydantic import Field

from schemas.base.model import Document


class HeadParameters(Document):
    """Parameters that decide where the heads are, from the skin that cameras of two heads see."""

    correct_heads: bool = True
    """True if the points of a head may be displaced along X to agree with other heads on the skin that both see."""
    smallest_mm: Annotated[float, Field(ge=0, le=10)] = 0.05
    """Heads whose points would be displaced less are left where they are."""
    largest_mm: Annotated[float, Field(gt=0, le=10)] = 0.5
    """If points would be displaced farther, the measures of the scan are uncertain."""
    largest_turn: Annotated[float, Field(gt=0, le=1)] = 0.005
    """If planes are turned against each other by more, mm per mm, the measures are uncertain: how far all of them are
    turned alike is not seen."""
    largest_scale: Annotated[float, Field(gt=0, le=1)] = 0.0005
    """If the travels of two heads differ by more, mm per mm, the measures are uncertain: by how much all of them are
    wrong alike is not seen. 0.0005 is 0.13 mm over a foot."""

"""Parameters of a foot that are known before it is measured."""

from schemas.base.model import Document, Posture, Side
from schemas.measures import Axis


class FootParameters(Document):
    """The side of the foot."""

    side: Side


class MeasureParameters(FootParameters):
    """The side of the foot, how the person stood, and the axis that is wanted."""

    posture: Posture = "unknown"
    axis: Axis = "toe2"

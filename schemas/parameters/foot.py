"""Parameters of a foot that are known before it is measured."""

from schemas.base.model import Document, Posture, Side


class FootParameters(Document):
    """The side of the foot."""

    side: Side


class MeasureParameters(FootParameters):
    """The side of the foot, and how the person stood."""

    posture: Posture = "unknown"

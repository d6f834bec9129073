"""Parameters of a foot that are known before it is measured."""

from schemas.base.model import Document, Side


class FootParameters(Document):
    """The side of the foot."""

    side: Side

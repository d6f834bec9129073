"""What is known of a foot before it is measured."""

from schemas.base.model import Document, Side


class FootParameters(Document):
    """Which foot it is."""

    side: Side

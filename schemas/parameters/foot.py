"""What is known of a foot before it is measured."""

from schemas.documents import Document
from schemas.scan import Side


class FootParameters(Document):
    """Which foot it is."""

    side: Side

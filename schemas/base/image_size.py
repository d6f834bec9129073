"""The size of a camera's images: the one place that holds it, and the order of rows and columns."""

from typing import NamedTuple


class ImageSize(NamedTuple):
    """Size of an image in the order of an array's axes: rows, columns.

    >>> print(FRAME_SIZE, tuple(FRAME_SIZE), FRAME_SIZE.px)
    640 x 480 (480, 640) (640, 480)
    """

    rows: int
    columns: int

    @property
    def px(self) -> tuple[int, int]:
        """Columns and rows: the order of i and j, in which documents have it (`image_px`)."""
        return self.columns, self.rows

    def __str__(self) -> str:
        """Columns x rows, as people say it."""
        return f"{self.columns} x {self.rows}"


FRAME_SIZE = ImageSize(rows=480, columns=640)
"""Size of the frames of the scanner's cameras."""
SMALLEST_FRAME = ImageSize(rows=240, columns=320)
"""Size from which frames are accepted."""

"""What the frames of one camera are: written with the Zarr array, and the result of ingesting a film."""

from typing import Annotated, Literal

from pydantic import Field

from schemas.base.image_size import ImageSize
from schemas.base.model import Document

GROUP = "frames.zarr"
"""Name of the Zarr group of arrays beside a scan's films."""

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


Encoding = Literal["image", "pixels"]
"""`image`: a frame is the camera's own JPEG (or PNG), bit for bit; `pixels`: a raw frame."""


class FrameManifest(Document):
    """The frames of one camera, by their digests."""

    format: Literal["footscan.frames/1"] = "footscan.frames/1"
    encoding: Encoding
    """`image`: a chunk is the camera's own JPEG (or PNG), bit for bit; `pixels`: a raw frame, losslessly compressed."""
    height: Annotated[int, Field(ge=1)]
    width: Annotated[int, Field(ge=1)]
    frames: list[Sha256 | None]
    """Digest of each frame's bytes (as stored for `image`, as decoded for `pixels`); None for a frame that was lost."""

    @property
    def size(self) -> ImageSize:
        """Rows and columns of each frame."""
        return ImageSize(self.height, self.width)

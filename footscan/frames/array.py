"""A camera's array of frames as it lies on the disk: which file a frame is, what the array holds, what is behind it."""

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from schemas.base.errors import DamagedError, Fault, RefusedInput
from schemas.base.limits import BeyondLimitError, read_bounded, refuse_beyond
from schemas.frames import FrameManifest

METADATA = "zarr.json"


def chunk_name(frame: int) -> str:
    """File of one frame within its array."""
    return f"{frame}.0.0.0"


def is_complete(array: Path) -> bool:
    """Whether a whole array is there; what it holds is checked frame by frame on reading."""
    try:
        return (array / "zarr.json").is_file()
    except OSError:  # no name that a file could have
        return False


def read_manifest(array: Path) -> FrameManifest:
    """What a complete array of ours holds; RefusedInput where it is another's, or its metadata are damaged."""
    try:
        manifest = FrameManifest.model_validate(_attributes(array)["footscan"])
    except OSError as error:
        raise RefusedInput(array, error.strerror or "cannot be read") from None
    except (*_BROKEN, ValidationError):
        raise RefusedInput(array, "expected an array of frames with its manifest", field="zarr.json") from None
    refuse_beyond("image_pixels", manifest.height * manifest.width, array)
    refuse_beyond("film_frames", len(manifest.frames), array)
    return manifest


def is_recorded(array: Path) -> bool:
    """Whether the frames were recorded straight into this array: there is no film that it could be made from anew."""
    try:
        return is_complete(array) and _attributes(array)["film"] is None
    except (OSError, *_BROKEN):
        return False


def stored_bytes(array: Path, frame: int) -> bytes | None:
    """A frame's file itself; None where it cannot be read.

    What is in it is the image, and Zarr's own way takes as long as the decoding.
    """
    try:
        return read_bounded(array / chunk_name(frame), "image_bytes")
    except BeyondLimitError:
        raise
    except (OSError, RefusedInput):
        return None


def damage(array: Path, frame: int) -> Fault:
    """What to raise where a frame is not the one that was stored."""
    if is_recorded(array):
        return Fault(f"{array}: frame {frame} is damaged, expected the frame that was recorded: restore it from a copy")
    return DamagedError(f"{array}: frame {frame} is damaged, expected the frame that was ingested")


def discard(array: Path) -> None:
    """Take back the completeness of an array that was found damaged."""
    (array / METADATA).unlink(missing_ok=True)


_BROKEN = (ValueError, KeyError, TypeError, RecursionError)


def _attributes(array: Path) -> dict[str, Any]:
    attributes: dict[str, Any] = json.loads(read_bounded(array / METADATA, "json_bytes"))["attributes"]
    return attributes

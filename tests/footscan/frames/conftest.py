"""Films made by a second hand: PyAV writes them, simplejpeg encodes their pictures."""

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
WriteMjpeg = Callable[..., Path]
WriteFilm = Callable[..., Path]
WriteRaw = Callable[[Path, Sequence[Pixels]], Path]


def _pixels(number: int, rows: int = 48, columns: int = 64) -> Pixels:
    """A picture that no other number has: noise over a ramp."""
    noise = np.random.default_rng(number).integers(0, 96, (rows, columns, 3))
    ramp = np.linspace(0, 120, columns)[np.newaxis, :, np.newaxis]
    return (noise + ramp).astype(np.uint8)


def _jpeg(number: int, rows: int = 48, columns: int = 64) -> bytes:
    return bytes(simplejpeg.encode_jpeg(_pixels(number, rows, columns), 85, "RGB", "420"))


def _write_mjpeg(
    path: Path, pictures: Sequence[bytes], numbers: Sequence[int] | None = None, rows: int = 48, columns: int = 64
) -> Path:
    """A Motion-JPEG AVI of `pictures`; `numbers` leaves gaps as a camera does that drops frames."""
    with av.open(path, "w", format="avi") as container:
        stream = container.add_mux_stream("mjpeg", rate=18, width=columns, height=rows)
        stream.time_base = Fraction(1, 18)
        container.start_encoding()
        for number, picture in zip(numbers or range(len(pictures)), pictures, strict=True):
            packet = av.Packet(picture)
            packet.stream = stream
            packet.time_base = stream.time_base
            packet.pts = packet.dts = number
            packet.duration = 1
            packet.is_keyframe = True
            container.mux(packet)
    return path


def _write_encoded(path: Path, frames: Sequence[Pixels], codec: str, pixel_format: str, form: str = "avi") -> Path:
    with av.open(path, "w", format=form) as container:
        stream = container.add_stream(codec, rate=18)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = pixel_format
        for pixels in frames:
            container.mux(
                stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24").reformat(format=pixel_format))
            )
        container.mux(stream.encode())
    return path


def _write_film(path: Path, encoding: str, lost: Collection[int] = ()) -> Path:
    """A film of four frames, of which one of encoded images may have lost some."""
    if encoding == "pixels":
        return _write_encoded(path, [_pixels(number) for number in range(4)], "rawvideo", "bgr24")
    numbers = [number for number in range(4) if number not in lost]
    return _write_mjpeg(path, [_jpeg(number) for number in numbers], numbers)


@pytest.fixture(scope="session")
def pixels() -> Callable[..., Pixels]:
    return _pixels


@pytest.fixture(scope="session")
def jpeg() -> Callable[..., bytes]:
    return _jpeg


@pytest.fixture(scope="session")
def write_mjpeg() -> WriteMjpeg:
    return _write_mjpeg


@pytest.fixture(scope="session")
def write_encoded() -> Callable[..., Path]:
    return _write_encoded


@pytest.fixture(scope="session")
def write_raw() -> WriteRaw:
    return lambda path, frames: _write_encoded(path, frames, "rawvideo", "bgr24")


@pytest.fixture(scope="session")
def write_film() -> WriteFilm:
    return _write_film


@pytest.fixture(params=["image", "pixels"])
def encoding(request: pytest.FixtureRequest) -> str:
    return str(request.param)

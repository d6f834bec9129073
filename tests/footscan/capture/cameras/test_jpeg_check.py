import numpy as np
import pytest
import simplejpeg
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.capture.cameras.jpeg_check import torn_reason
from schemas.base.image_size import ImageSize

SIZE = ImageSize(rows=120, columns=160)


def picture(rows: int = SIZE.rows, columns: int = SIZE.columns) -> bytes:
    j, i = np.mgrid[0:rows, 0:columns]
    noise = np.random.default_rng(3).integers(0, 40, (rows, columns))
    red = (200 * np.exp(-0.5 * ((j - 60 - 10 * np.sin(i / 20)) / 2) ** 2) + noise).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(np.stack([red, red // 4, red // 4], axis=-1), 80, "RGB", "420"))


JPEG = picture()
SCAN = JPEG.index(b"\xff\xda") + 14
"""Where the entropy-coded data start: behind the header of the scan, of 12 bytes and its marker."""


def test_a_whole_frame() -> None:
    assert torn_reason(JPEG, SIZE) is None
    assert torn_reason(JPEG) is None


def test_padding_behind_the_end_is_no_tear() -> None:
    assert torn_reason(JPEG + bytes(100)) is None


def test_padding_within_the_codes_is_no_tear() -> None:
    assert torn_reason(JPEG[:-2] + b"\x55\x55" + JPEG[-2:]) is None


def test_missing_huffman_tables_are_no_tear() -> None:
    assert torn_reason(_without(JPEG, 0xC4), SIZE) is None


@pytest.mark.parametrize(
    ("jpeg", "reason"),
    [
        (b"", "empty"),
        (b"--frame\r\n" + JPEG, "does not start as a JPEG"),
        (JPEG[:-2], "its end is missing"),
        (JPEG[: len(JPEG) // 2], "its end is missing"),
        (JPEG[:SCAN] + JPEG[-2:], "damaged"),
        (JPEG[:20] + JPEG[-2:], "damaged"),
        (picture(60, 80), "80 x 60 pixels instead of 160 x 120"),
    ],
)
def test_a_torn_frame_says_what_is_wrong(jpeg: bytes, reason: str) -> None:
    found = torn_reason(jpeg, SIZE)
    assert found is not None
    assert found.startswith(reason)


@settings(max_examples=200, deadline=None)
@given(at=st.integers(2, len(JPEG) - 1))
def test_every_cut_is_found(at: int) -> None:
    assert torn_reason(JPEG[:at]) is not None


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_bytes_whatever_break_the_check(seed: int) -> None:
    """Bytes changed at random may leave a decodable picture; they must never do worse than that."""
    random = np.random.default_rng(seed)
    changed = bytearray(JPEG)
    for _ in range(int(random.integers(1, 30))):
        changed[random.integers(0, len(changed))] = random.integers(0, 256)
    reason = torn_reason(bytes(changed))
    assert reason is None or reason.isprintable()


def test_lost_pieces_are_found_ninety_five_times_in_a_hundred() -> None:
    random = np.random.default_rng(5)
    missed = 0
    for _ in range(400):
        first, last = np.sort(random.integers(SCAN, len(JPEG) - 2, 2))
        missed += last - first > 8 and torn_reason(JPEG[:first] + JPEG[last:]) is None
    assert missed <= 20


def _without(jpeg: bytes, marker: int) -> bytes:
    """`jpeg` without the segments of a marker."""
    while (at := jpeg.find(bytes([0xFF, marker]))) >= 0:
        jpeg = jpeg[:at] + jpeg[at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big") :]
    return jpeg

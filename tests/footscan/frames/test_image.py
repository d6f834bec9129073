"""Encoded images to pixels; what is torn is said to be so, by a ValueError and nothing else."""

import io

import numpy as np
import pytest
import simplejpeg
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from footscan.frames.image import (
    decode_image,
    encode_png,
    image_size,
    padded_pixels,
    pixel_buffer,
)

RAMP = np.arange(8 * 9 * 3, dtype=np.uint8).reshape(8, 9, 3)
JPEG = bytes(simplejpeg.encode_jpeg(RAMP, 90, "RGB", "420"))
PNG = encode_png(RAMP)


def png(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, format="PNG")
    return out.getvalue()


def without_huffman_tables(data: bytes) -> bytes:
    """A JPEG as Motion-JPEG has it: the segments with the (standard) Huffman tables left out."""
    out, at = data[:2], 2
    while data[at : at + 2] != b"\xff\xda":
        length = 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        if data[at + 1] != 0xC4:
            out += data[at : at + length]
        at += length
    return out + data[at:]


def test_png_is_lossless() -> None:
    np.testing.assert_array_equal(decode_image(PNG), RAMP)
    assert image_size(PNG) == (8, 9)


def test_jpeg_is_decoded_by_libjpeg_turbo() -> None:
    np.testing.assert_array_equal(decode_image(JPEG), simplejpeg.decode_jpeg(JPEG, "RGB"))
    assert image_size(JPEG) == (8, 9)


def test_a_pixel_buffer_holds_a_pixel_in_a_word() -> None:
    buffer = pixel_buffer(8, 9)
    assert buffer.shape == (8, 9, 3)
    assert buffer.dtype == np.uint8
    assert buffer.strides == (36, 4, 1)
    assert not buffer.any()
    buffer[2, 3] = [1, 2, 3]
    padded = padded_pixels(buffer)
    assert padded is not None
    assert padded.shape == (8, 9, 4)
    assert np.shares_memory(padded, buffer)
    assert padded[2, 3, :3].tolist() == [1, 2, 3]
    padded[7, 8] = [4, 5, 6, 255]
    assert buffer[7, 8].tolist() == [4, 5, 6]


def test_only_what_fills_a_pixel_buffer_is_padded() -> None:
    buffer = pixel_buffer(8, 9)
    padded = np.zeros((8, 9, 4), np.uint8)
    others = [
        RAMP,
        buffer.copy(),
        buffer[1:],
        buffer[:, :8],
        buffer[::-1],
        buffer[:, ::-1],
        buffer[..., ::-1],
        padded[..., 1:],  # green, blue and what counts for nothing
        np.zeros((8, 4, 9), np.uint8).transpose(0, 2, 1)[..., :3],
        np.zeros((16, 9, 4), np.uint8)[::2, :, :3],
        np.zeros((1, 8, 9, 4), np.uint8)[0, ..., :3],
    ]
    assert [padded_pixels(other) for other in others[:-1]] == [None] * (len(others) - 1)
    last = padded_pixels(others[-1])
    assert last is None or np.shares_memory(last, others[-1])
    assert padded_pixels(padded[..., :3]) is not None


@pytest.mark.parametrize("shape", [(0, 0), (0, 9), (8, 0), (1, 1)])
def test_pixel_buffers_of_any_size(shape: tuple[int, int]) -> None:
    buffer = pixel_buffer(*shape)
    assert buffer.shape == (*shape, 3)
    padded = padded_pixels(buffer)
    assert padded is None or padded.shape == (*shape, 4)


def test_a_jpeg_is_decoded_into_a_pixel_buffer() -> None:
    expected = decode_image(JPEG)
    buffer = pixel_buffer(8, 9)
    for _ in range(2):
        assert decode_image(JPEG, buffer) is buffer
        np.testing.assert_array_equal(buffer, expected)
        buffer[...] = 7
    extraneous = JPEG[:-2] + bytes(5) + JPEG[-2:]  # as webcams pad their entropy-coded data
    assert decode_image(extraneous, buffer) is buffer
    np.testing.assert_array_equal(buffer, expected)


def test_a_buffer_of_another_shape_or_kind_is_left_alone() -> None:
    for other in (pixel_buffer(9, 8), pixel_buffer(16, 9), pixel_buffer(8, 10)[:, :9], np.zeros((8, 9, 3), np.uint8)):
        decoded = decode_image(JPEG, other)
        np.testing.assert_array_equal(decoded, decode_image(JPEG))
        assert not np.shares_memory(decoded, other)
        assert not other.any()


def test_a_png_needs_no_buffer() -> None:
    np.testing.assert_array_equal(decode_image(PNG, pixel_buffer(8, 9)), RAMP)


def test_an_image_is_the_same_with_and_without_a_buffer() -> None:
    generator = np.random.default_rng(3)
    for subsampling in ("444", "422", "420", "Gray"):
        pixels = generator.integers(0, 256, (33, 50, 1 if subsampling == "Gray" else 3), dtype=np.uint8)
        space = "Gray" if subsampling == "Gray" else "RGB"
        data = bytes(simplejpeg.encode_jpeg(pixels, 80, space, subsampling))
        np.testing.assert_array_equal(decode_image(data, pixel_buffer(33, 50)), decode_image(data))


def test_chroma_is_interpolated_not_repeated() -> None:
    rows = np.zeros((16, 16, 3), np.uint8)
    rows[:, 8:, 0] = 255
    data = simplejpeg.encode_jpeg(rows, 100, "RGB", "420")
    red = decode_image(bytes(data))[8, :, 0].astype(int)
    assert len(set(red[5:11])) > 3  # repeated samples would make pairs


def test_huffman_tables_may_be_missing() -> None:
    bare = without_huffman_tables(JPEG)
    assert len(bare) < len(JPEG) - 300
    np.testing.assert_array_equal(decode_image(bare), decode_image(JPEG))


def test_padding_behind_the_image_is_accepted() -> None:
    np.testing.assert_array_equal(decode_image(JPEG + bytes(64)), decode_image(JPEG))
    padded = JPEG[:-2] + bytes(5) + JPEG[-2:]  # as webcams pad their entropy-coded data
    np.testing.assert_array_equal(decode_image(padded), decode_image(JPEG))


@pytest.mark.parametrize("mode", ["L", "P", "1", "RGBA", "LA"])
def test_other_kinds_of_png_become_rgb(mode: str) -> None:
    image = Image.fromarray(RAMP).convert(mode)
    np.testing.assert_array_equal(decode_image(png(image)), np.asarray(image.convert("RGB")))


def test_sixteen_bits_keep_their_high_byte() -> None:
    grey = np.array([[0, 255, 256, 0x1234, 0xFFFF]], np.uint16)
    decoded = decode_image(png(Image.fromarray(grey)))
    np.testing.assert_array_equal(decoded[0, :, 1], [0, 0, 1, 0x12, 0xFF])


@pytest.mark.parametrize("seed", [JPEG, PNG], ids=["jpeg", "png"])
def test_a_cut_image_is_a_value_error_or_all_there(seed: bytes) -> None:
    whole, refused = decode_image(seed), 0
    for length in range(len(seed)):
        try:
            np.testing.assert_array_equal(decode_image(seed[:length]), whole)
        except ValueError:
            refused += 1
    assert refused >= len(seed) - 24  # what follows the pixels: checksums and the end mark


@given(st.sampled_from([JPEG, PNG]), st.lists(st.tuples(st.integers(0, 4095), st.integers(0, 255)), max_size=4))
def test_changed_bytes_give_an_image_or_a_value_error(seed: bytes, changes: list[tuple[int, int]]) -> None:
    data = bytearray(seed)
    for at, value in changes:
        data[at % len(data)] = value
    for look in (decode_image, image_size):
        try:
            result = look(bytes(data))
        except ValueError:
            continue
        assert len(result)


def test_unknown_colour_space_of_a_jpeg_is_a_value_error() -> None:
    at = JPEG.index(b"\xff\xc0")
    torn = JPEG[: at + 11] + b"\xff" + JPEG[at + 12 :]  # sampling factors that there are not
    for look in (decode_image, image_size):
        with pytest.raises(ValueError, match=r"JPEG|sampling"):
            look(torn)


def test_bombs_are_refused_before_they_are_decoded() -> None:
    for columns, rows in ((50_000, 50_000), (16_000_001, 1), (0, 8)):
        bomb = PNG[:16] + columns.to_bytes(4, "big") + rows.to_bytes(4, "big") + PNG[24:]
        for look in (decode_image, image_size):
            with pytest.raises(ValueError, match=f"{columns} x {rows} pixels"):
                look(bomb)

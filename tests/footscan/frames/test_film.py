"""Films: every frame keeps its number, and a film that is not whole is refused."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import simplejpeg

from footscan.frames.film import film_files, open_film
from footscan.frames.image import Rgb, frame_digest
from footscan.frames.ingest import ingest_film
from footscan.frames.reader import FrameReader, pixel_frames
from schemas.base.errors import RefusedInput
from schemas.base.image_size import FRAME_SIZE, ImageSize

SIZE = ImageSize(rows=48, columns=64)

MANIFEST = (
    b'{"attributes": {"film": null, "footscan": '
    b'{"format": "footscan.frames/1", "height": 48, "width": 64, "encoding": %b}}}'
)


def holds(film: FrameReader) -> tuple[str, int, ImageSize]:
    return film.encoding, film.count, film.size


def pictures_of(path: Path) -> list[bytes | Rgb | None]:
    return list(open_film(path).stored())


def refusal(path: Path, film: Path | None = None, size: ImageSize | None = None) -> str:
    """What is said of `path`, when it, or the film that it is a part of, is opened."""
    with pytest.raises(RefusedInput) as caught:
        open_film(film or path, size)
    text = str(caught.value)
    assert text.isprintable()
    assert text.startswith(f"{path}: ")
    return text.removeprefix(f"{path}: ")


@pytest.fixture
def film(tmp_path: Path, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]) -> Path:
    return write_mjpeg(tmp_path / "cam1.avi", [jpeg(number) for number in range(8)])


def test_packets_are_taken_untouched(film: Path, jpeg: Callable[..., bytes]) -> None:
    assert holds(open_film(film)) == ("image", 8, SIZE)
    assert pictures_of(film) == [jpeg(number) for number in range(8)]
    for number, pixels in enumerate(pixel_frames(open_film(film))):
        assert pixels is not None
        np.testing.assert_array_equal(pixels, simplejpeg.decode_jpeg(jpeg(number), "RGB"))


def test_suffix_of_an_avi_may_be_any(film: Path) -> None:
    film.rename(film.with_name("CAM1.AVI"))
    assert open_film(film.with_name("CAM1.AVI")).count == 8


def test_raw_film_gives_its_pixels_exactly(
    tmp_path: Path, pixels: Callable[..., Any], write_raw: Callable[..., Path]
) -> None:
    frames = [pixels(number, 47, 63) for number in range(5)]  # rows of odd length are padded in the file
    path = write_raw(tmp_path / "raw.avi", frames)
    assert holds(open_film(path)) == ("pixels", 5, (47, 63))
    for expected, found in zip(frames, pixel_frames(open_film(path)), strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("numbers", [[0, 1, 2, 5, 6, 9, 10, 15], [0, 40, 41, 42, 43, 44, 45, 46], [*range(7), 99]])
def test_dropped_frames_leave_the_others_their_numbers(
    tmp_path: Path, numbers: list[int], jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]
) -> None:
    path = write_mjpeg(tmp_path / "cam1.avi", [jpeg(number) for number in numbers], numbers)
    found = pictures_of(path)
    assert found == [jpeg(number) if number in numbers else None for number in range(numbers[-1] + 1)]
    assert [pixels is not None for pixels in pixel_frames(open_film(path))] == [data is not None for data in found]


@pytest.mark.parametrize("torn", [b"", b"\xff", b"\xff\xd8", b"no picture at all", "header", "half", "size"])
def test_torn_frame_keeps_its_number(
    tmp_path: Path, torn: bytes | str, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]
) -> None:
    pictures = [jpeg(number) for number in range(6)]
    whole = pictures[3]
    at = whole.index(b"\xff\xc0") + 11
    parts = {
        "header": whole[:at] + b"\xff" + whole[at + 1 :],
        "half": whole[: len(whole) // 2],
        "size": jpeg(3, 32, 32),
    }
    pictures[3] = parts[torn] if isinstance(torn, str) else torn
    path = write_mjpeg(tmp_path / "cam1.avi", pictures)
    for number, found in enumerate(pixel_frames(open_film(path))):
        if number == 3:
            assert found is None
        else:
            np.testing.assert_array_equal(found, simplejpeg.decode_jpeg(jpeg(number), "RGB"))


def test_folder_of_images_in_name_order(tmp_path: Path, pixels: Callable[..., Any], jpeg: Callable[..., bytes]) -> None:
    from PIL import Image

    for number in (2, 0, 1, 3):
        if number % 2:
            (tmp_path / f"{number:03}.JPG").write_bytes(jpeg(number))
        else:
            Image.fromarray(pixels(number)).save(tmp_path / f"{number:03}.png")
    (tmp_path / "notes.txt").write_text("not a frame")
    (tmp_path / "._000.png").write_text("not a frame either")
    film = open_film(tmp_path)
    assert holds(film) == ("image", 4, SIZE)
    for number, found in enumerate(pixel_frames(film)):
        expected = simplejpeg.decode_jpeg(jpeg(number), "RGB") if number % 2 else pixels(number)
        np.testing.assert_array_equal(found, expected)
    assert pictures_of(tmp_path)[1] == jpeg(1)
    one = tmp_path / "002.png"
    assert holds(open_film(one)) == ("image", 1, SIZE)
    np.testing.assert_array_equal(next(pixel_frames(open_film(one))), pixels(2))


def test_torn_image_in_a_folder_is_lost_and_no_image_is_refused(tmp_path: Path, jpeg: Callable[..., bytes]) -> None:
    for number in range(3):
        (tmp_path / f"{number}.jpg").write_bytes(jpeg(number))
    (tmp_path / "1.jpg").write_bytes(jpeg(1)[:-400])
    assert [found is None for found in pixel_frames(open_film(tmp_path))] == [False, True, False]
    (tmp_path / "1.jpg").write_bytes(jpeg(1, 32, 32))
    assert (
        refusal(tmp_path / "1.jpg", film=tmp_path) == "frame size: expected 64 x 48 pixels as in 0.jpg, found 32 x 32"
    )
    (tmp_path / "1.jpg").write_bytes(b"")
    assert refusal(tmp_path / "1.jpg", film=tmp_path) == "expected a JPEG or PNG image (neither JPEG nor PNG)"


@pytest.mark.parametrize("raw", [False, True], ids=["mjpeg", "raw"])
def test_every_cut_is_refused(
    tmp_path: Path,
    raw: bool,
    film: Path,
    pixels: Callable[..., Any],
    write_raw: Callable[..., Path],
) -> None:
    path = write_raw(tmp_path / "raw.avi", [pixels(number) for number in range(8)]) if raw else film
    whole = path.read_bytes()
    cuts = {0, 1, 8, 12, 63, 64, len(whole) - 1, len(whole) - 16, *random.Random(1).sample(range(len(whole)), 60)}
    for cut in sorted(cuts):
        path.write_bytes(whole[:cut])
        assert refusal(path)
    path.write_bytes(whole + bytes(100))  # padding, as card readers leave it
    assert open_film(path).count == 8


@pytest.mark.parametrize("header", ["main", "stream"])
def test_header_with_another_number_of_frames_is_refused(film: Path, header: str) -> None:
    whole = bytearray(film.read_bytes())
    if header == "main":
        assert whole[48:52] == (8).to_bytes(4, "little")
        whole[48:52] = (9).to_bytes(4, "little")
        film.write_bytes(whole)
        assert refusal(film) == "frames: truncated: expected the 9 frames that its header declares, found 8"
        whole[48:52] = (0).to_bytes(4, "little")  # left out by its recorder
        film.write_bytes(whole)
        assert open_film(film).count == 8
    else:
        whole[136:140] = (5).to_bytes(4, "little")  # dwStart: every time stamp is late by five frames
        film.write_bytes(whole)
        assert refusal(film).startswith("frames: expected the 8 frames that its header declares, found 13")


def test_lost_chunk_never_shifts_the_frames_behind_it(film: Path, jpeg: Callable[..., bytes]) -> None:
    whole = film.read_bytes()
    at = whole.index(jpeg(4)) - 8
    assert whole[at : at + 4] == b"00dc"
    length = int.from_bytes(whole[at + 4 : at + 8], "little")
    for damaged in (
        whole[:at] + b"XXXX" + whole[at + 4 :],
        whole[: at + 4] + bytes(4) + whole[at + 8 :],
        whole[: at + 4] + b"\xff" * 4 + whole[at + 8 :],
        whole[:at] + bytes(length) + whole[at + length :],
        whole[: at + 8] + bytes(length) + whole[at + 8 + length :],
        whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2),
    ):
        film.write_bytes(damaged)
        try:
            found = pictures_of(film)
        except RefusedInput:
            continue
        assert [data for number, data in enumerate(found) if number != 4] == [jpeg(n) for n in range(8) if n != 4]
        assert found[4] != jpeg(4)


def test_changed_bytes_are_refused_or_cost_single_frames(film: Path, jpeg: Callable[..., bytes]) -> None:
    whole, chance = film.read_bytes(), random.Random(7)
    pictures = {jpeg(number): number for number in range(8)}
    for _ in range(300):
        damaged = bytearray(whole)
        # headers, which are a hundredth of the file, as often as all the rest
        at = chance.choice([chance.randrange(212), chance.randrange(len(whole))])
        damaged[at] = chance.choice([0, 255, chance.randrange(256)])
        film.write_bytes(damaged)
        try:
            opened = open_film(film)
            found = list(opened.stored()) if opened.encoding == "image" else []
            list(pixel_frames(opened))
        except RefusedInput as error:
            assert str(error).isprintable()  # noqa: PT017 (either is right)
            continue
        assert all(pictures.get(data, number) == number for number, data in enumerate(found) if data is not None)


def test_size_is_checked(film: Path) -> None:
    assert open_film(film, SIZE).count == 8
    expected = "frame size: expected frames of 640 x 480 pixels, found 64 x 48"
    assert refusal(film, size=FRAME_SIZE) == expected


def test_other_codecs_are_refused(
    tmp_path: Path, pixels: Callable[..., Any], write_encoded: Callable[..., Path]
) -> None:
    frames = [pixels(number) for number in range(3)]
    path = write_encoded(tmp_path / "cam1.avi", frames, "mpeg4", "yuv420p")
    assert refusal(path) == "codec: expected Motion-JPEG or raw video, found mpeg4"
    path = write_encoded(tmp_path / "cam2.avi", frames, "mjpeg", "yuvj420p", "matroska")
    assert refusal(path) == "header: expected an AVI film"
    whole = bytearray(write_encoded(tmp_path / "cam3.avi", frames, "rawvideo", "bgr24").read_bytes())
    whole[112:116] = whole[188:192] = b"NONE"
    (tmp_path / "cam3.avi").write_bytes(whole)
    assert refusal(tmp_path / "cam3.avi").startswith("codec: expected Motion-JPEG or raw video, found ")


def test_sound_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cam1.avi"
    with av.open(path, "w", format="avi") as container:
        stream = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        frame.rate = 8000
        container.mux(stream.encode(frame))
    assert refusal(path) == "streams: expected a video stream, found none"


def test_what_is_no_film_is_refused(tmp_path: Path, write_mjpeg: Callable[..., Path]) -> None:
    text = tmp_path / "text.avi"
    text.write_text("RIFF, but not really " * 100)
    empty = tmp_path / "empty.avi"
    empty.touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder/notes.txt").touch()
    assert refusal(text) == "header: expected an AVI film"
    assert refusal(empty) == "header: expected an AVI film"
    assert refusal(write_mjpeg(tmp_path / "none.avi", [])).startswith("frames: expected at least one frame, found none")
    assert refusal(tmp_path / "folder") == "no PNG or JPEG images in this folder"
    assert refusal(tmp_path / "missing.avi") == "no such film"
    assert refusal(tmp_path / "missing.png") == "no such film"
    assert refusal(tmp_path / ("x" * 300)) == "File name too long"
    with pytest.raises(RefusedInput, match=r"missing: no such film$"):
        film_files(tmp_path / "missing")


def test_unfinished_recording_is_refused(film: Path) -> None:
    whole = bytearray(film.read_bytes())
    for size in (0, 0xFFFFFFFF):
        whole[4:8] = size.to_bytes(4, "little")
        film.write_bytes(whole)
        assert refusal(film) == "header: never finished by its recorder: its length is not written"


def test_frame_digest_is_that_of_the_bytes() -> None:
    # SHA-256 of "abc", FIPS 180-2, appendix B.1
    assert frame_digest(b"abc").startswith("ba7816bf8f01cfea")
    assert frame_digest(np.frombuffer(b"abc", np.uint8).reshape(1, 1, 3)).startswith("ba7816bf8f01cfea")
    spread = np.zeros((2, 2, 6), np.uint8)[:, :, ::2]
    assert frame_digest(spread) == frame_digest(bytes(12))


def test_a_folder_among_frames_is_named(tmp_path: Path, jpeg: Callable[..., bytes]) -> None:
    (tmp_path / "1.jpg").write_bytes(jpeg(1))
    (tmp_path / "2.jpg").mkdir()
    with pytest.raises(RefusedInput, match=r"2\.jpg: expected an image, found a folder"):
        film_files(tmp_path)


def test_an_array_is_a_film(tmp_path: Path, jpeg: Callable[..., bytes], write_mjpeg: Callable[..., Path]) -> None:
    film = write_mjpeg(tmp_path / "cam1.avi", [jpeg(number) for number in (0, 1, 3)], [0, 1, 3])
    array = tmp_path / "frames.zarr/cam1"
    ingest_film(film, array, SIZE)
    opened = open_film(array, SIZE)
    assert holds(opened) == ("image", 4, SIZE)
    assert list(opened.stored()) == [jpeg(0), jpeg(1), None, jpeg(3)]
    assert [frame is None for frame in pixel_frames(opened)] == [False, False, True, False]
    assert film_files(array) == [array / "zarr.json"]


@pytest.mark.parametrize(
    ("metadata", "problem"),
    [
        (b"", "expected an array of frames with its manifest"),
        (b"[]", "expected an array of frames with its manifest"),
        (b'{"attributes": {"footscan": {}}}', "expected an array of frames with its manifest"),
        (b'{"zarr_format": 3, "node_type": "array"}', "expected an array of frames with its manifest"),
        (MANIFEST % b'"pixels", "frames": []', "expected an array of encoded images, found one of pixels"),
        (MANIFEST % b'"image", "frames": []', "expected at least one frame, found none"),
    ],
)
def test_another_array_is_refused(tmp_path: Path, metadata: bytes, problem: str) -> None:
    (tmp_path / "cam1").mkdir()
    (tmp_path / "cam1/zarr.json").write_bytes(metadata)
    with pytest.raises(RefusedInput, match=f"cam1: .*{problem}"):
        open_film(tmp_path / "cam1")

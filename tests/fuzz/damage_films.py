"""Films and stores that are torn, spliced, or forged in their lengths and counts."""

import json
import os
import struct
from pathlib import Path
from random import Random

from footscan.frames.shard import SHARD

SIZES = (0, 1, 7, 2**15, 2**31 - 1, 2**31, 2**32 - 1)
TAGS = (b"RIFF", b"LIST", b"avih", b"strh", b"strf", b"idx1", b"movi", b"JUNK", b"00dc", b"01wb", b"\0\0\0\0")
SHAPES = (0, -1, 1, 2**31, 2**62, 2**63, 1e308, "640", None, [1])


def damage_film(random: Random, film: bytes) -> tuple[bytes, str]:
    """An AVI with one to three things done to it, and what."""
    words = []
    for _ in range(random.choice((1, 1, 2, 3))):
        film, what = random.choice((_truncated, _spliced, _forged_length, _other_tag, _forged_header, _doubled))(
            random, film
        )
        words.append(what)
    return film, "; ".join(words)


def damage_store(random: Random, group: Path) -> str:
    """Something done to a Zarr group of arrays on the disk, and what."""
    if random.random() < 0.3:
        return random.choice((_other_metadata, _other_manifest))(random, group / "cam1" / "zarr.json")
    array = group / "cam1"
    shard = array / SHARD
    place = random.choice((shard, shard, array / "zarr.json", group / "zarr.json"))
    return f"{place.name} {random.choice(DAMAGES)(random, place)}"


def _other_metadata(random: Random, file: Path) -> str:
    document = json.loads(file.read_text())
    name = random.choice(
        ("shape", "chunk_grid", "data_type", "codecs", "fill_value", "attributes", "chunk_key_encoding")
    )
    document[name] = random.choice((*SHAPES, {}, [[1, 2**62, 2**62, 3]], [1, 2**62, 640, 3]))
    file.write_text(json.dumps(document))
    return f"{name} = {document[name]}"


def _other_manifest(random: Random, file: Path) -> str:
    document = json.loads(file.read_text())
    name = random.choice(("height", "width", "frames", "encoding", "format"))
    document["attributes"]["footscan"][name] = random.choice((*SHAPES, [None] * 200_000, ["0" * 64] * 3, "pixels"))
    file.write_text(json.dumps(document))
    return f"manifest's {name}"


def _a_folder(_: Random, place: Path) -> str:
    place.unlink()
    place.mkdir()
    return "is a folder"


def _a_pipe(_: Random, place: Path) -> str:
    place.unlink()
    os.mkfifo(place)
    return "is a pipe"


def _another_length(random: Random, place: Path) -> str:
    os.truncate(place, random.choice((0, 1, 100, 9 * 10**6, 5 * 10**9)))
    return "has another length"


def _a_link(random: Random, place: Path) -> str:
    place.unlink()
    place.symlink_to(random.choice((place.name, "/dev/zero", "/nowhere", "..")))
    return "is a link"


def _a_part(_: Random, place: Path) -> str:
    place.write_bytes(next(place.parent.glob(f"**/{SHARD}")).read_bytes()[:1000])
    return "is a part of the frames"


def _random(random: Random, place: Path) -> str:
    place.write_bytes(random.randbytes(random.choice((1, 50, 5000))))
    return "is random"


DAMAGES = (_a_folder, _a_pipe, _another_length, _a_link, _a_part, _random)


def _truncated(random: Random, film: bytes) -> tuple[bytes, str]:
    length = random.randrange(len(film))
    return film[:length], f"truncated after {length}"


def _spliced(random: Random, film: bytes) -> tuple[bytes, str]:
    a, b, c = sorted(random.randrange(len(film)) for _ in range(3))
    return film[:a] + film[b:c] + film[a:b] + film[c:], f"{a}, {b}, {c} spliced"


def _doubled(random: Random, film: bytes) -> tuple[bytes, str]:
    a, b = sorted(random.randrange(len(film)) for _ in range(2))
    return film[:b] + film[a:], f"{a} to {b} doubled"


def _forged_length(random: Random, film: bytes) -> tuple[bytes, str]:
    tag = random.choice(TAGS)
    places = [at for at in range(len(film) - 8) if film.startswith(tag, at)] if tag in film else [0]
    at, size = random.choice(places), random.choice(SIZES)
    return film[: at + 4] + struct.pack("<I", size) + film[at + 8 :], f"{tag!r} of length {size}"


def _other_tag(random: Random, film: bytes) -> tuple[bytes, str]:
    old, new = random.choice(TAGS), random.choice(TAGS)
    return film.replace(old, new, random.choice((1, 1000))), f"{old!r} is {new!r}"


def _forged_header(random: Random, film: bytes) -> tuple[bytes, str]:
    at, size = random.randrange(24, 320, 4), random.choice((*SIZES, 90_000, 20))
    return film[:at] + struct.pack("<I", size) + film[at + 4 :], f"{size} at byte {at}"

"""What may befall any text file: encodings, line ends, torn and overwritten bytes. Each damage says what it did."""

import gzip
from collections.abc import Callable
from random import Random

TextDamage = Callable[[Random, bytes], tuple[bytes, str]]

GARBAGE = (
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
    b"PK\x03\x04\x14\0",
    b"%PDF-1.7\n",
    b"\xff\xd8\xff\xe0",
    b"RIFF\0\0\0\0AVI ",
    b"",
)
STRAYS = (
    b"\0",
    b"\xff",
    b"\xe9",
    b"\x1b[31m",
    b"\x0c",
    b"\x1c",
    b"\xe2\x80\xa8",
    b"\xe2\x80\x8b",
    b'"',
    b"'",
    b"#",
    b"\t",
)
STRAYS += (
    b",",
    b";",
    b"\n",
    b"\r",
    b"\\",
    b"%s",
    b"{0}",
    b"[red]",
    b"\xef\xbb\xbf",
    b"\xf0\x9f\xa6\xb6",
    b"\xed\xa0\x80",
)


def damage_text(random: Random, content: bytes) -> tuple[bytes, str]:
    """`content` with one thing done to its bytes, and what."""
    return random.choice(TEXT_DAMAGES)(random, content)


def _encoded_anew(random: Random, content: bytes) -> tuple[bytes, str]:
    encoding = random.choice(("utf-8-sig", "utf-16", "utf-16-le", "utf-32", "cp037"))
    return content.decode("utf-8", "replace").encode(encoding, "replace"), f"encoded as {encoding}"


def _other_line_ends(random: Random, content: bytes) -> tuple[bytes, str]:
    end = random.choice((b"\r\n", b"\r", b"\n\n", b"\r\r\n", b"\x0b", b"\xc2\x85"))
    return content.replace(b"\n", end), f"line ends {end!r}"


def _mixed_line_ends(random: Random, content: bytes) -> tuple[bytes, str]:
    lines = content.split(b"\n")
    return b"".join(line + random.choice((b"\n", b"\r\n", b"\r")) for line in lines), "line ends of all kinds"


def _without_last_end(_: Random, content: bytes) -> tuple[bytes, str]:
    return content.rstrip(b"\r\n"), "no line end at the end"


def _truncated(random: Random, content: bytes) -> tuple[bytes, str]:
    length = random.randrange(len(content) + 1)
    return content[:length], f"truncated after {length} of {len(content)} bytes"


def _torn_start(random: Random, content: bytes) -> tuple[bytes, str]:
    length = random.randrange(len(content) + 1)
    return content[length:], f"first {length} of {len(content)} bytes lost"


def _overwritten(random: Random, content: bytes) -> tuple[bytes, str]:
    if not content:
        return content, "nothing to overwrite"
    damaged, count = bytearray(content), random.choice((1, 1, 2, 5, 50))
    for _ in range(count):
        damaged[random.randrange(len(damaged))] = random.randrange(256)
    return bytes(damaged), f"{count} bytes overwritten"


def _flipped(random: Random, content: bytes) -> tuple[bytes, str]:
    if not content:
        return content, "nothing to flip"
    damaged, count = bytearray(content), random.choice((1, 1, 2, 5))
    for _ in range(count):
        damaged[random.randrange(len(damaged))] ^= 1 << random.randrange(8)
    return bytes(damaged), f"{count} bits flipped"


def _stray(random: Random, content: bytes) -> tuple[bytes, str]:
    what, where = random.choice(STRAYS), random.randrange(len(content) + 1)
    return content[:where] + what + content[where:], f"{what!r} put in at byte {where}"


def _block_lost(random: Random, content: bytes) -> tuple[bytes, str]:
    start, length = random.randrange(len(content) + 1), random.choice((1, 7, 64, 512))
    filler = random.choice((b"", b"\0" * length, b" " * length))
    return content[:start] + filler + content[start + length :], f"{length} bytes from {start} are {filler[:1]!r}"


def _line_twice(random: Random, content: bytes) -> tuple[bytes, str]:
    lines = content.splitlines(keepends=True) or [b"\n"]
    number = random.randrange(len(lines))
    lines.insert(random.randrange(len(lines) + 1), lines[number])
    return b"".join(lines), f"line {number + 1} is given twice"


def _line_lost(random: Random, content: bytes) -> tuple[bytes, str]:
    lines = content.splitlines(keepends=True) or [b"\n"]
    number = random.randrange(len(lines))
    del lines[number]
    return b"".join(lines), f"line {number + 1} lost"


def _garbage(random: Random, content: bytes) -> tuple[bytes, str]:
    length = random.choice((0, 1, 10, 1000, len(content)))
    return random.choice(GARBAGE) + random.randbytes(length), f"{length} random bytes instead of the file"


def _blank(random: Random, _: bytes) -> tuple[bytes, str]:
    content = random.choice((b"", b"\n", b" \n\n\t\n", b"\xef\xbb\xbf", b"\0" * 4096, b"---\n", b",,,,,,\n"))
    return content, f"nothing but {content[:8]!r}"


def _compressed(_: Random, content: bytes) -> tuple[bytes, str]:
    return gzip.compress(content, mtime=0), "gzipped"


def _written_twice(random: Random, content: bytes) -> tuple[bytes, str]:
    between = random.choice((b"", b"\n", b"---\n"))
    return content + between + content, f"written twice, with {between!r} between"


def _huge_field(random: Random, content: bytes) -> tuple[bytes, str]:
    length, where = random.choice((5_000, 140_000)), random.randrange(len(content) + 1)
    what = random.choice((b"9", b"x", b"(", b"[", b" ", b'"', b","))
    return content[:where] + what * length + content[where:], f"{what!r} {length} times at byte {where}"


TEXT_DAMAGES: tuple[TextDamage, ...] = (
    *(_encoded_anew, _other_line_ends, _mixed_line_ends, _without_last_end, _truncated, _truncated, _torn_start),
    *(_overwritten, _flipped, _flipped, _stray, _stray, _stray, _block_lost, _line_twice, _line_lost, _garbage),
    *(_blank, _compressed, _written_twice, _huge_field),
)

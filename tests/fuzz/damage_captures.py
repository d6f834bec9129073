"""Damage to a calibration capture: its two documents, its films as files, and the pictures in them."""

import os
from collections.abc import Callable
from copy import deepcopy
from math import cos, pi, sin
from pathlib import Path
from random import Random
from typing import Any

import yaml
from damage_frames import Film, damage_film
from damage_text import damage_text
from PIL import Image

from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from schemas.base.errors import FootscanError

Document = dict[str, Any]
DocumentDamage = Callable[[Random, Document], str]
FolderDamage = Callable[[Random, Path], str]
Profile = list[list[float]]
"""(Y, Z) of the corners."""
ProfileDamage = Callable[[Random, Profile], Any]

VALUES: tuple[Any, ...] = (
    *(None, "", "text", "~", "no", True, 0, -1, 1, 3, 8, 9, 1e9, 1e308, float("nan"), float("inf"), 10**30, "1e3"),
    *("0x1F", [], [[]], {}, {"id": 1}, [1, 2], [[0, 0]], ["a"], "2026-11-20", "\0", "é", "a" * 5000, "[1, 2]", "{}"),
    "1_0",
)
PATHS = (
    *("../cam1.avi", "/etc/hostname", "~/x", "cam9.avi", "", ".", "..", "cam1.avi/", "capture.yaml", "reference.yaml"),
    *("C:\\x", "./cam1.avi", "cam5.avi", "sub/../cam1.avi", "a" * 300, "cam1\0.avi", "nul", "chart.csv"),
    *("https://a.org/x.avi", "*"),
)


def damage_capture(random: Random, folder: Path) -> list[str]:
    """One to three things done to the files of a capture, and which."""
    return [word for _ in range(random.choice((1, 1, 1, 2, 3))) if (word := random.choice(DAMAGES)(random, folder))]


def _capture_yaml(random: Random, folder: Path) -> str:
    return _in_document(random, folder / "capture.yaml", CAPTURE_DAMAGES)


def _reference_yaml(random: Random, folder: Path) -> str:
    return _in_document(random, folder / "reference.yaml", REFERENCE_DAMAGES)


def _in_document(random: Random, file: Path, damages: tuple[DocumentDamage, ...]) -> str:
    if not file.is_file():
        return ""  # a pipe would be waited for
    try:
        document = yaml.safe_load(file.read_text())
        what = random.choice(damages)(random, document)
    except (OSError, yaml.YAMLError, UnicodeError, TypeError, LookupError, AttributeError, ValueError):
        return ""  # damaged before
    file.write_text(yaml.safe_dump(document, sort_keys=False, allow_unicode=True))
    return f"{file.name}: {what}"


def _document_bytes(random: Random, folder: Path) -> str:
    file = folder / random.choice(("capture.yaml", "reference.yaml"))
    if not file.is_file():
        return ""
    content, what = damage_text(random, file.read_bytes())
    file.write_bytes(content)
    return f"{file.name}: {what}"


def _value_changed(random: Random, document: Document) -> str:
    """A value anywhere in a document becomes another, is lost, or comes under another name."""
    holder, name = _any_place(random, document)
    what, value = random.choice(("changed", "changed", "lost", "renamed", "repeated")), random.choice(VALUES)
    if what == "lost":
        del holder[name]
    elif what == "renamed" and isinstance(holder, dict):
        holder[random.choice((f"{name}s", str(name).upper(), "x", "", "profile_cm"))] = holder.pop(name)
    elif what == "repeated" and isinstance(holder, list):
        holder.insert(random.randrange(len(holder) + 1), deepcopy(holder[name]))
    else:
        what = f"became {str(value)[:20]!r}"
        holder[name] = deepcopy(value)
    return f"{name} {what}"


def _any_place(random: Random, holder: Any) -> tuple[Any, Any]:
    while True:
        name = random.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
        value = holder[name]
        if not isinstance(value, dict | list) or not value or random.random() < 0.3:
            return holder, name
        holder = value


def _path_changed(random: Random, document: Document) -> str:
    path = random.choice(PATHS)
    if random.random() < 0.3:
        document["reference"] = path
        return f"reference {path[:20]!r}"
    camera = random.choice(document["cameras"])
    camera["file"] = path
    return f"file of camera {camera['id']} {path[:20]!r}"


def _cameras_renumbered(random: Random, document: Document) -> str:
    numbers = random.choice(
        ([5, 1], [2, 6], [3, 7], [1, 1], [9, 10], [0, 5], [-1, 5], [10**9, 5], [1.5, 5], ["1", 5], [4, 8])
    )
    for camera, number in zip(document["cameras"], numbers, strict=False):
        camera["id"] = number
    return f"cameras numbered {numbers}"


def _cameras_stand(random: Random, document: Document) -> str:
    sides = ["front", "behind", "left", "right", "above", "below"]
    camera = random.choice(document["cameras"])
    camera["stands"] = random.choice(
        ([], random.sample(sides, 1), random.sample(sides, 2), random.sample(sides, 3), "front", ["up"])
    )
    return f"camera {camera['id']} stands {camera['stands']}"


def _one_camera(random: Random, document: Document) -> str:
    del document["cameras"][random.randrange(len(document["cameras"]))]
    return "a camera less"


def _profile_changed(random: Random, document: Document) -> str:
    what, change = random.choice(PROFILES)
    document["profile_mm"] = change(random, document["profile_mm"])
    return f"profile {what}"


def _corner_moved(random: Random, profile: Profile) -> Profile:
    corner = random.choice(profile)
    corner[random.randrange(2)] += random.choice((-30, -10, -2, -0.5, 0.5, 2, 10, 100))
    return profile


def _regular(random: Random, _: Profile) -> Profile:
    corners = random.choice([6, 8, 12, 40])
    turns = [2 * pi * k / corners for k in range(corners)]
    return [[round(50 * cos(turn), 3), round(50 + 50 * sin(turn), 3)] for turn in turns]


def _times(factor: float) -> ProfileDamage:
    return lambda _, profile: [[factor * y, factor * z] for y, z in profile]


PROFILES: tuple[tuple[str, ProfileDamage], ...] = (
    ("with a corner moved", _corner_moved),
    ("with a corner moved", _corner_moved),
    ("with a corner twice", lambda random, profile: profile[:3] + profile[random.randrange(3) :]),
    ("closed by its first corner", lambda _, profile: profile + profile[:1]),
    ("shuffled", lambda random, profile: random.sample(profile, len(profile))),
    ("the other way round", lambda _, profile: profile[::-1]),
    ("begun elsewhere", lambda _, profile: profile[5:] + profile[:5]),
    ("of two corners", lambda _, profile: profile[:2]),
    ("of three corners", lambda _, profile: profile[:3]),
    ("without some corners", lambda random, profile: [c for c in profile if random.random() < 0.8]),
    ("in cm", _times(0.1)),
    ("in m", _times(0.001)),
    ("in tenths", _times(10)),
    ("of no size", _times(0)),
    ("2 % larger", _times(1.02)),
    ("15 % larger", _times(1.15)),
    ("mirrored", _times(-1)),
    ("lying down", lambda _, profile: [[z, y] for y, z in profile]),
    ("a line", lambda _, profile: [[y, 0] for y, _ in profile]),
    ("a sliver", lambda *_: [[0, 0], [100, 0], [100, 0.02], [0, 0.02]]),
    ("a bow tie", lambda *_: [[0, 0], [50, 50], [50, 0], [0, 50]]),
    ("a box", lambda *_: [[-50, 0], [50, 0], [50, 100], [-50, 100]]),
    ("a triangle", lambda *_: [[-50, 0], [50, 0], [0, 87]]),
    ("a regular polygon", _regular),
    ("of three coordinates", lambda _, profile: [[0, *corner] for corner in profile]),
    ("far away", lambda _, profile: [[y + 500, z] for y, z in profile]),
    (
        "with corners on its edges",
        lambda _, profile: [
            c
            for a, b in zip(profile, profile[1:] + profile[:1], strict=True)
            for c in (a, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2])
        ],
    ),
)


def _placements_changed(random: Random, document: Document) -> str:
    places = document["placements_mm"]
    what = random.choice(
        (
            "swapped",
            "swapped",
            "one off",
            "one off",
            "all off",
            "mirrored",
            "one less",
            "one more",
            "cm",
            "equal",
            "huge",
        )
    )
    if what == "swapped":
        a, b = random.sample(range(len(places)), 2)
        places[a], places[b] = places[b], places[a]
        what = f"{a} and {b} swapped"
    elif what == "one off":
        k, by = random.randrange(len(places)), [random.gauss(0, random.choice((0.3, 1, 5, 40))) for _ in range(2)]
        places[k] = [round(a + b, 3) for a, b in zip(places[k], by, strict=True)]
        what = f"{k} off by {by[0]:.2f}, {by[1]:.2f}"
    elif what == "all off":
        document["placements_mm"] = [[y + 7, z - 3] for y, z in places]
    elif what == "mirrored":
        document["placements_mm"] = [[-y, z] for y, z in places]
    elif what == "one less":
        places.pop()
    elif what == "one more":
        places.append([12, 3])
    elif what == "cm":
        document["placements_mm"] = [[y / 10, z / 10] for y, z in places]
    elif what == "equal":
        places[1:] = [list(places[0]) for _ in places[1:]]
    else:
        places[-1] = [1e6, 0]
    return f"placements: {what}"


def _film_bytes(random: Random, folder: Path) -> str:
    """An AVI torn, empty, overwritten; mostly in its first bytes, where its structure stands."""
    film = random.choice(_films(folder))
    content = film.read_bytes() if film.is_file() else b""
    if random.random() < 0.4 and len(content) > 6000:
        head, what = damage_text(random, content[:6000])
        film.write_bytes(head + content[6000:])
        return f"{film.name}: in its first 6000 bytes: {what}"
    content, what = damage_text(random, content)
    if film.is_file():
        film.write_bytes(content)
    return f"{film.name}: {what}"


def _film_file(random: Random, folder: Path) -> str:
    films = _films(folder)
    film = random.choice(films)
    what = random.choice(
        ("missing", "swapped", "another's", "an empty folder", "a broken link", "a link to itself", "a text")
    )
    if not film.is_file():
        return ""
    content = film.read_bytes()
    film.unlink()
    if what in ("swapped", "another's"):
        other = next((one for one in films if one != film and one.is_file()), None)
        film.write_bytes(content if other is None else other.read_bytes())
        if what == "swapped" and other is not None:
            other.write_bytes(content)
    elif what == "an empty folder":
        film.mkdir()
    elif what.startswith("a "):
        if what == "a text":
            film.write_text("no film\n" * 100)
        else:
            film.symlink_to(film if what.endswith("itself") else folder / "nowhere.avi")
    return f"{film.name} {what}"


def _pictures(random: Random, folder: Path) -> str:
    """A film, decoded, damaged and written as a folder of pictures. `capture.yaml` names the folder."""
    film = random.choice(_films(folder))
    words, chosen = [], [film] if random.random() < 0.5 else _films(folder)
    seed = random.getrandbits(32)
    for film in chosen:
        if not film.is_file():
            continue
        try:
            frames = [frame.copy() for frame in pixel_frames(open_film(film)) if frame is not None]
        except FootscanError:
            continue  # damaged before
        if not frames:
            continue
        alike = Random(seed)  # to all cameras the same, as when the light goes or the object is moved
        words.append(f"{film.name}: {damage_film(alike, frames)}")
        film.unlink()
        _write_pictures(alike, film, frames, words)
    return ", ".join(words)


def _write_pictures(random: Random, folder: Path, frames: Film, words: list[str]) -> None:
    """Under the film's own name: a folder may be called cam1.avi."""
    folder.mkdir()
    kind = random.choice(("png", "png", "jpg"))
    for number, frame in enumerate(frames):
        Image.fromarray(frame).save(
            folder / f"{number}.{kind}", **({"compress_level": 1} if kind == "png" else {"quality": 95})
        )
    if frames and random.random() < 0.15:
        picture = random.choice(sorted(folder.iterdir()))
        words.append(f"{picture.name}: {_picture_file(random, picture)}")


def _picture_file(random: Random, picture: Path) -> str:
    what = random.choice(("bytes", "bytes", "bytes", "mode", "named", "claims", "a folder", "16 bits"))
    if what == "bytes":
        content, what = damage_text(random, picture.read_bytes())
        picture.write_bytes(content)
    elif what == "mode":
        what = random.choice(("L", "1", "P", "RGBA", "CMYK"))
        image = Image.open(picture).convert(what)
        image.save(picture, format="JPEG" if what == "CMYK" else "PNG")
    elif what == "16 bits":
        Image.open(picture).convert("I").convert("I;16").save(picture, format="PNG")
    elif what == "named":
        picture.rename(picture.with_name(random.choice(("2.PNG", ".0.png", "0.txt", "10.png", "a\nb.png"))))
    elif what == "claims":
        content = bytearray(picture.read_bytes())
        content[16:24] = (60_000).to_bytes(4, "big") * 2
        picture.write_bytes(content)
        what = "claims 60000 x 60000 pixels"
    else:
        picture.unlink()
        picture.mkdir()
    return what


def _folder_file(random: Random, folder: Path) -> str:
    file = folder / random.choice(("capture.yaml", "reference.yaml"))
    if not file.is_file():
        return ""
    content = file.read_bytes()
    file.unlink()
    what = random.choice(("missing", "a folder", "a link to itself", "a link out", "a pipe", "too large"))
    if what == "a folder":
        file.mkdir()
    elif what == "a link to itself":
        file.symlink_to(file)
    elif what == "a link out":
        outside = folder.parent / f"outside-{file.name}"
        outside.write_bytes(content)
        file.symlink_to(outside)
    elif what == "a pipe" and hasattr(os, "mkfifo"):
        os.mkfifo(file)
    elif what == "too large":
        file.write_bytes(content + b"\n" * 9_000_000)
    return f"{file.name} {what}"


def _films(folder: Path) -> list[Path]:
    return [folder / "cam1.avi", folder / "cam5.avi"]


CAPTURE_DAMAGES: tuple[DocumentDamage, ...] = (
    *(_value_changed, _value_changed, _path_changed, _path_changed, _cameras_renumbered, _cameras_stand, _one_camera),
)
REFERENCE_DAMAGES: tuple[DocumentDamage, ...] = (
    *(_value_changed, _value_changed, _profile_changed, _profile_changed, _profile_changed, _placements_changed),
    *(_placements_changed, _placements_changed),
)
DAMAGES: tuple[FolderDamage, ...] = (
    *(_capture_yaml, _capture_yaml, _reference_yaml, _reference_yaml, _reference_yaml, _document_bytes),
    *(_film_bytes, _film_bytes, _film_file, _pictures, _pictures, _pictures, _pictures, _folder_file),
)

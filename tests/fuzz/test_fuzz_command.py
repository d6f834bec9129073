"""Bad input of several kinds through the command: no traceback, a documented status, at most 10 s and 1 GB.

    FOOTSCAN_FUZZ=4000 pytest tests/fuzz/test_fuzz_command.py       1,000 cases of each of four kinds instead of a few
    FOOTSCAN_FUZZ_FIRST=417 FOOTSCAN_FUZZ=4 pytest ...              case 417 of each, again
    FOOTSCAN_FUZZ_RECORD=cases.jsonl       one line a case: damage, arguments, status, time, memory

The cases run within one process that is watched from outside; every hundredth goes through the executable as well. A
case follows from its number alone.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest
from argument_lines import draw_line
from bounded import BoundedCommand
from damage_documents import damage_document, damage_table
from damage_films import damage_film, damage_store
from damage_text import damage_text
from sound_files import DOCUMENTS, READERS, SCAN, TABLES, make_sound_files

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
CASES = range(FIRST, FIRST + (10 if ASKED is None else int(ASKED) // 4))
RECORD = os.environ.get("FOOTSCAN_FUZZ_RECORD")
EXECUTABLE_EVERY = 100


@pytest.fixture(scope="session")
def sound(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sound file of every kind. To be read only."""
    folder = tmp_path_factory.mktemp("sound") / "home"
    make_sound_files(pristine, folder)
    return folder


@pytest.fixture(scope="session")
def bounded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BoundedCommand]:
    command = BoundedCommand(tmp_path_factory.mktemp("told"), longest_s=60.0)
    yield command
    command.close()


Try = Callable[[int, str, list[str]], None]


@pytest.fixture
def home(sound: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the sound files, to be spoilt."""
    yield Path(shutil.copytree(sound, tmp_path / "home"))
    shutil.rmtree(tmp_path / "home")


@pytest.fixture
def try_line(bounded: BoundedCommand, home: Path) -> Try:
    """Runs an argument line beside the damaged file, and checks how that ends."""

    def run(number: int, case: str, arguments: list[str]) -> None:
        ended = bounded.run(arguments, home)
        case = f"{case}; footscan {arguments}"
        if RECORD:
            line = {
                "case": case,
                "status": ended.status,
                "seconds": ended.seconds,
                "peak": ended.peak,
                "err": ended.err,
            }
            with Path(RECORD).open("a") as file:
                file.write(json.dumps(line) + "\n")
        assert ended.broken() is None, f"{case}: {ended.broken()}: {ended.err[-3000:]}"
        if number % EXECUTABLE_EVERY == 0 and not any("\0" in word for word in arguments):
            executable = Path(sys.executable).with_name("footscan")
            done = subprocess.run([executable, *arguments], cwd=home, capture_output=True, timeout=300, check=False)
            assert done.returncode in (0, 1, 2, 3), case
            assert b"Traceback" not in done.stderr, case

    return run


@pytest.mark.parametrize("number", CASES)
def test_damaged_bytes(number: int, home: Path, try_line: Try) -> None:
    random = Random(f"bytes {number}")
    name = random.choice(tuple(READERS))
    content, what = damage_text(random, (home / name).read_bytes())
    (home / name).write_bytes(content)
    try_line(number, f"bytes {number}: {name}: {what}", random.choice(READERS[name]).split())


@pytest.mark.parametrize("number", CASES)
def test_hostile_values(number: int, home: Path, try_line: Try) -> None:
    random = Random(f"values {number}")
    name = random.choice((*DOCUMENTS, *DOCUMENTS, *TABLES))
    sound = (home / name).read_bytes()
    content, what = damage_table(random, sound) if name in TABLES else damage_document(random, name, sound)
    (home / name).write_bytes(content)
    try_line(number, f"values {number}: {name}: {what}", random.choice(READERS[name]).split())


@pytest.mark.parametrize("number", CASES)
def test_torn_films_and_stores(number: int, home: Path, try_line: Try) -> None:
    random = Random(f"films {number}")
    film = home / SCAN / "cam1.avi"
    if random.random() < 0.6:
        content, what = damage_film(random, film.read_bytes())
        film.write_bytes(content)
        lines = READERS[f"{SCAN}/cam1.avi"]
    else:
        what = damage_store(random, home / SCAN / "frames.zarr")
        lines = READERS[f"{SCAN}/frames.zarr/cam1/zarr.json"]
    try_line(number, f"films {number}: {what}", random.choice(lines).split())


@pytest.mark.parametrize("number", CASES)
def test_argument_lines(number: int, try_line: Try) -> None:
    random = Random(f"arguments {number}")
    try_line(number, f"arguments {number}", draw_line(random))

"""Damaged charts and captures end in a calibration or in one clear line, never in a traceback.

    FOOTSCAN_FUZZ=2000 pytest tests/fuzz            1,000 charts and 1,000 captures instead of a few
    FOOTSCAN_FUZZ_FIRST=417 FOOTSCAN_FUZZ=2 pytest tests/fuzz      case 417 of either, again
    FOOTSCAN_FUZZ_RECORD=cases.jsonl                one line a case: damage, end, how far the maps moved

A case follows from its number alone.
"""

import hashlib
import json
import os
import shutil
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from types import FrameType

import numpy as np
import pytest
from damage_captures import damage_capture
from damage_charts import damage_chart

from footscan.calibration.models.maps import is_supported, to_world
from footscan.thesis.printed import CHARTS_FILE
from pipelines.cli.main import run_command
from schemas.calibration import Calibration, read_calibration

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
CHARTS, CAPTURES = (24, 6) if ASKED is None else (int(ASKED) - int(ASKED) // 2, int(ASKED) // 2)
RECORD = os.environ.get("FOOTSCAN_FUZZ_RECORD")
LONGEST_S = 60

THESIS = CHARTS_FILE
CHART_OPTIONS = (
    *([] for _ in range(6)),
    ["--json"],
    *(["--model", model] for model in ("quadratic", "polynomial", "homography")),
    *(["--model", f"homography-{more}"] for more in ("distortion", "correction")),
    *(["--model", "polynomial", "--order", str(order)] for order in (1, 5)),
)
CAPTURE_OPTIONS = (
    *(["--model", "homography-distortion"] for _ in range(6)),
    ["--model", "homography", "--json"],
    ["--model", "homography-correction"],
    ["--model", "polynomial", "--order", "2"],
    ["--tolerance-mm", "50", "--model", "homography"],
    [],
)
GRID = np.stack(np.meshgrid(np.arange(0.0, 640.0, 16.0), np.arange(0.0, 480.0, 16.0)), -1).reshape(-1, 2)


CleanOf = Callable[..., Calibration | None]


@dataclass(frozen=True)
class Made:
    """How a case ended."""

    case: str
    seconds: float
    told: str
    calibration: Calibration | None


class TooLongError(BaseException):
    """Nothing catches it on its way."""


@pytest.fixture(scope="session")
def clean_of(tmp_path_factory: pytest.TempPathFactory) -> CleanOf:
    """What the undamaged input gives with the same options; None where it gives nothing. For the record alone."""

    @cache
    def calibrated(what: str, clean: Path, *options: str) -> Calibration | None:
        out = tmp_path_factory.mktemp("clean") / "calibration.json"
        status = run_command(["calibrate", what, str(clean), "--out", str(out), *options])
        return read_calibration(out) if status == 0 else None

    return calibrated


@pytest.mark.parametrize("number", range(FIRST, FIRST + CHARTS))
def test_damaged_chart(
    number: int,
    filmed: Path,
    clean_of: CleanOf,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    random = Random(f"chart {number}")
    name, clean = random.choice((("simulated chart", filmed / "chart.csv"), ("chart of the thesis", THESIS)))
    content, words = damage_chart(random, clean.read_bytes())
    options = [*random.choice(CHART_OPTIONS), *(["--keep-going"] if random.random() < 0.3 else [])]
    folder = tmp_path / "input"
    folder.mkdir()
    (folder / "chart.csv").write_bytes(content)
    case = f"chart {number}: {name}; {'; '.join(words)}"
    made = try_case(case, "chart", folder / "chart.csv", options, tmp_path, capsys)
    record(made, lambda: clean_of("chart", clean, *options))


@pytest.mark.parametrize("number", range(FIRST, FIRST + CAPTURES))
def test_damaged_capture(
    number: int,
    filmed: Path,
    clean_of: CleanOf,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    random = Random(f"capture {number}")
    monkeypatch.chdir(tmp_path)  # where a refused capture is drawn
    folder = Path(shutil.copytree(filmed, tmp_path / "input"))
    words = damage_capture(random, folder)
    case = f"capture {number}: {'; '.join(words)}"
    options = random.choice(CAPTURE_OPTIONS)
    made = try_case(case, "capture", folder, options, tmp_path, capsys)
    record(made, lambda: clean_of("capture", filmed, *options))
    shutil.rmtree(folder)


def try_case(
    case: str,
    what: str,
    damaged: Path,
    options: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> Made:
    """Calibrates from the `damaged` file or folder and checks how that ends."""
    out = tmp_path / "out" / "calibration.json"
    out.parent.mkdir()
    before = digests(tmp_path / "input")
    case = f"{case}; calibrate {what} {' '.join(options)}"
    capsys.readouterr()
    began = time.monotonic()
    try:
        with warnings.catch_warnings(), at_most(LONGEST_S):
            warnings.simplefilter("error")
            status = run_command(["calibrate", what, str(damaged), "--out", str(out), *options])
        told = capsys.readouterr().err
        assert status in (0, 2), f"exit status {status}: {told}"
        assert digests(tmp_path / "input") == before, "the input was changed"
        if status == 0:
            assert [file.name for file in out.parent.iterdir()] == [out.name]
            calibration = read_calibration(out)
            assert is_finite(calibration), "the map is not finite"
            return Made(case, time.monotonic() - began, told, calibration)
        assert list(out.parent.iterdir()) == [], "a calibration was left behind"
        assert told.startswith("footscan: "), told
        assert told.endswith("\n"), told
        assert len(told.splitlines()) == 1, f"not one line: {told}"
        assert str(damaged) in told, f"does not name what is damaged: {told}"
    except (Exception, TooLongError) as error:
        raise AssertionError(case) from error
    return Made(case, time.monotonic() - began, told, None)


def is_finite(calibration: Calibration) -> bool:
    """Whether all maps are, where data support them."""
    return all(
        bool(np.isfinite(to_world(camera, GRID[is_supported(camera, GRID)])).all()) for camera in calibration.cameras
    )


def apart_mm(found: Calibration, clean: Calibration | None) -> dict[int, float]:
    """How far the maps of each camera that both have are apart where data support both, mm rms."""
    known = {camera.camera: camera for camera in clean.cameras} if clean is not None else {}
    apart = {}
    for camera in found.cameras:
        if camera.camera in known:
            both = GRID[is_supported(camera, GRID) & is_supported(known[camera.camera], GRID)]
            away = to_world(camera, both) - to_world(known[camera.camera], both)
            apart[camera.camera] = float(np.sqrt(np.mean(np.sum(away**2, axis=1)))) if len(both) else 0.0
    return apart


def digests(folder: Path) -> dict[str, str]:
    """What lies in a folder, and its content."""
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
        for file in sorted(folder.rglob("*"))
    }


@contextmanager
def at_most(seconds: int) -> Iterator[None]:
    """Ends what takes longer, where the system has such an alarm."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise TooLongError(f"after {seconds} s")

    if not hasattr(signal, "SIGALRM"):
        yield
        return
    earlier = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, earlier)


def record(made: Made, clean: Callable[[], Calibration | None]) -> None:
    """One line for those who read what was told."""
    if RECORD:
        apart = None if made.calibration is None else apart_mm(made.calibration, clean())
        line = {"case": made.case, "seconds": made.seconds, "told": made.told, "status": 0 if apart is not None else 2}
        with Path(RECORD).open("a") as file:
            file.write(json.dumps(line | {"apart": apart}) + "\n")

"""Virtual sets of a suite: filmed once, and calibrated once for all recordings of a scanner."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.pool import StepEnd
from pipelines.regression import film
from pipelines.regression.sets import PreparedSet, parameters_of, prepare
from pipelines.steps import (
    all_recognise,
    calibrate,
    capture_stripe,
    fit,
    own_side,
    place,
    recognise,
    simulate_capture,
)
from schemas.base.errors import Fault
from schemas.parameters.simulation import SimulationSettings
from schemas.parameters.virtual_scan import VirtualScan
from schemas.regression import Suite

STEPS = (capture_stripe, recognise, place, all_recognise, own_side, fit, calibrate)
KINDS = {"film", "capture", "calibrate"}
"""Kinds of the steps that film, and of the last step of a calibration."""

SUITE: dict[str, Any] = {
    "format": "footscan.suite/1",
    "parameters": {"extraction": {"red_threshold": 20, "ridge_px": 2.0}},
    "sets": {
        "ambient": {"virtual": {"settings": {"frames": 36, "step_mm": 8}}},
        "dark": {
            "virtual": {"settings": {"ambient": "dark", "seed": 2}},
            "parameters": {"extraction": {"ridge_px": 3}},
        },
        "other-scanner": {"virtual": {"settings": {"scanner_seed": 2}}},
    },
}


class Filming:
    """Counts the steps that would film and calibrate, and writes their outputs in their place."""

    def __init__(self, patch: pytest.MonkeyPatch, out: Path) -> None:
        self.out = out
        for module, file in (
            (film, "scan.yaml"),
            (simulate_capture, "capture.yaml"),
            *((step, None) for step in STEPS),
        ):
            patch.setattr(module, "run", self.step(file))

    def step(self, file: str | None) -> Any:
        def run(inputs: Mapping[str, bytes], parameters: Any, places: Mapping[str, Path]) -> bytes:
            del inputs
            if file is not None:
                places["folder"].mkdir(parents=True, exist_ok=True)
                (places["folder"] / file).write_text("filmed")
            return json.dumps({"known": {"foot_length": 262.0}, "of": str(parameters)}).encode()

        return run

    def prepare(self, name: str) -> tuple[PreparedSet, list[str]]:
        """The set, and those of `KINDS` that ran for it."""
        ends: list[StepEnd] = []
        prepared = prepare(name, Suite.model_validate(SUITE), Path("nowhere"), self.out, ends.append)
        return prepared, [end.step.kind for end in ends if end.ran and end.step.kind in KINDS]


@pytest.fixture
def filming(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Filming:
    return Filming(monkeypatch, tmp_path)


def test_what_was_filmed_is_not_filmed_again(filming: Filming) -> None:
    prepared, ran = filming.prepare("ambient")
    assert sorted(ran) == ["calibrate", "capture", "film"]
    assert prepared.truths == {"foot_length": 262.0}
    assert prepared.job.folders == [filming.out / "films/virtual/ambient"]
    assert filming.prepare("ambient")[1] == []
    (prepared.job.folders[0] / "scan.yaml").unlink()  # which is written last: without it nothing was filmed
    assert filming.prepare("ambient")[1] == ["film"]


def test_a_scanner_is_calibrated_once(filming: Filming) -> None:
    filming.prepare("ambient")
    assert filming.prepare("dark")[1] == ["film"]
    assert sorted(filming.prepare("other-scanner")[1]) == ["calibrate", "capture", "film"]


def test_the_parameters_of_a_set_stand_in_place_of_the_suites(filming: Filming) -> None:
    extraction = filming.prepare("dark")[0].job.parameters.extraction
    assert (extraction.red_threshold, extraction.ridge_px) == (20, 3.0)
    assert parameters_of("ambient", Suite.model_validate(SUITE)).extraction.ridge_px == 2.0


def test_a_set_may_have_a_preset() -> None:
    sets = {"ours": SUITE["sets"]["ambient"], "theirs": {**SUITE["sets"]["ambient"], "preset": "thesis:surface"}}
    suite = Suite.model_validate({**SUITE, "sets": sets})
    assert [parameters_of(name, suite).surface.method for name in sets] == ["closed", "ball_pivoting"]
    assert parameters_of("theirs", suite).extraction == parameters_of("ours", suite).extraction


def test_what_cannot_be_filmed_is_a_fault(filming: Filming, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> bytes:
        raise ValueError("no laser")

    monkeypatch.setattr(film, "run", broken)
    with pytest.raises(Fault, match=r"ambient/film: .*no laser"):
        filming.prepare("ambient")


@pytest.mark.slow
def test_the_film_step_tells_what_was_filmed(tmp_path: Path) -> None:
    settings = SimulationSettings(frames=1, start_mm=150.0)
    result = json.loads(film.run({}, VirtualScan(side="left", settings=settings), {"folder": tmp_path / "one"}))
    assert result["known"]["foot_length"] == pytest.approx(262.0)
    assert sorted(result["films"]) == [f"cam{camera}.avi" for camera in range(1, 9)]
    assert len(set(result["films"].values())) == 8
    assert "side: left" in (tmp_path / "one/scan.yaml").read_text()

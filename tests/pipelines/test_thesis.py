"""The thesis beside footscan, on few frames: both methods run to their end, and a second run has nothing to do."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from footscan.report.thesis.page import thesis_page
from pipelines import thesis
from pipelines.engine.pool import OnStepEnd, Threads
from schemas.parameters.simulation import SimulationSettings

COARSE = SimulationSettings(frames=66, step_mm=6.0)


@pytest.mark.slow
def test_both_methods_on_the_same_films(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FOOT", "BLOCK"):
        film = getattr(thesis, name)
        monkeypatch.setattr(thesis, name, film.model_copy(update={"settings": COARSE}))
    to_run: list[int] = []

    @contextmanager
    def watch(_part: str, count: int, _steps: int) -> Iterator[OnStepEnd]:
        to_run.append(count)
        yield lambda _: None

    result = thesis.run_thesis(tmp_path, 0, Threads(2), watch)

    assert (result.coefficients, result.agreeing) == (43, 43)
    feet = {foot.method: foot for foot in result.feet}
    ours = feet["footscan"].comparison
    assert ours is not None
    assert ours.mean < 0.3
    assert [row.nominal_mm for row in result.block] == [150.0, 100.0, 50.0]
    assert all(abs((row.found_mm["footscan"] or 0.0) - row.nominal_mm) < 1.0 for row in result.block)
    errors = {corners.points: corners.median_mm for corners in result.corners}
    assert errors[5] > 5.0 * errors[6] > 0.0
    assert "Table 6-2" in thesis_page(result, thesis.reference_png(tmp_path))
    assert sum(to_run) > 0

    to_run.clear()
    again = thesis.run_thesis(tmp_path, 0, Threads(2), watch)
    assert sum(to_run) == 0
    assert again == result

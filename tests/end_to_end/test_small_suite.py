"""The suite in its small form: the code as it is measures the coarse virtual foot as the accepted baseline says."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from footscan.measure.measures import measure_foot
from footscan.mesh.formats.files import read_mesh

ROOT = Path(__file__).parents[2]
DRAWS = 6


@pytest.mark.slow
def test_nothing_is_worse_than_accepted_and_no_last_digit_counts(
    footscan: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    done = footscan("regress", ROOT / "regression/small.yaml", "--out", tmp_path, "--junit", tmp_path / "junit.xml")
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert 'failures="0"' in (tmp_path / "junit.xml").read_text(encoding="utf-8")

    [delivered] = (tmp_path / "results").rglob("foot.stl")
    points, faces = read_mesh(delivered)
    vertices = np.asarray(points, np.float64)
    before = measure_foot(vertices, faces, "right").measures
    assert len(before) > 25
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        moved = measure_foot(vertices + random.normal(0.0, 1e-6, vertices.shape), faces, "right").measures
        assert {name: one.status for name, one in moved.items()} == {name: one.status for name, one in before.items()}
        for name, measure in before.items():
            if measure.value is not None:
                assert moved[name].value == pytest.approx(measure.value, abs=0.01, rel=1e-6), name

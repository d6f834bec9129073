"""Outliers are dropped, the foot is held still, and its heel is judged once more if it trembled."""

import numpy as np
import pytest

from footscan import clean as module
from footscan.clean import clean
from footscan.cloud.outliers.remove import KEPT, REASONS
from schemas.base.errors import Finding
from schemas.parameters.outliers import OutlierParameters
from tests.helpers.moving_foot import FRAMES, scan

TREMOR = np.tile(0.4 * np.sin(2.9 * np.arange(FRAMES)), (2, 1))


def test_what_the_heel_of_a_trembling_foot_shows_is_dropped_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "is_off_heel", lambda points, _: points["x"] < 20.0)
    for still, points in ((True, scan(0.0 * TREMOR)), (False, scan(TREMOR))):
        kept, removed, movement = clean(points, {}, OutlierParameters())
        of_lasers = removed.codes == 1 + REASONS.index("laser")
        assert bool(movement.x_mm) != still
        assert of_lasers.any() != still
        assert np.any(kept["x"] < 20.0) == still
        assert np.count_nonzero(removed.codes == KEPT) == len(kept) == len(removed.parted_mm)
        for camera in (1, 2):
            assert removed.counts[camera]["laser"] == np.count_nonzero(of_lasers & (points["camera"] == camera))


def test_points_that_are_all_outliers_are_named() -> None:
    with pytest.raises(Finding, match="every point is an outlier"):
        clean(scan(0.0 * TREMOR), {}, OutlierParameters(x_mm=(1e4, 2e4)))

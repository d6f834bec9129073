"""The virtual scanner is delivered with a calibration and latencies that hold."""

import numpy as np
import pytest

from pipelines.live.storing import LARGEST_SD_MM
from pipelines.live.virtual import delivery
from pipelines.live.virtual.delivery import SCANNER_SEED, delivery_of
from pipelines.live.virtual.world import CAMERAS, LATENCIES_S, World


def test_what_is_delivered_was_filmed_by_this_code() -> None:
    delivered = delivery_of(SCANNER_SEED)
    assert delivered is not None, "the code that films has changed: python -m pipelines.live.virtual.deliver"
    assert sorted(camera.camera for camera in delivered.calibration.cameras) == list(CAMERAS)
    random = np.random.default_rng([SCANNER_SEED, 9])  # as `VirtualWorld` draws them
    for camera in CAMERAS:
        latency = delivered.latencies[camera]
        assert abs(latency.seconds - random.uniform(*LATENCIES_S)) < 3.5 * latency.sd_s
        assert World(pictures="").mm_per_s * np.hypot(latency.sd_s, latency.frame_sd_s) < 0.6 * LARGEST_SD_MM


def test_nothing_is_delivered_with_another_scanner_or_by_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert delivery_of(SCANNER_SEED + 1) is None
    monkeypatch.setattr(delivery, "digest_of_filming", lambda: "other code")
    assert delivery_of(SCANNER_SEED) is None

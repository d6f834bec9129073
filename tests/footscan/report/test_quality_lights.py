"""Lights and lines that judge a scan, at their limits and beyond."""

from typing import Any

import numpy as np
import pytest

from footscan.report.quality_lights import apart_mm, quality_lights, worst
from schemas.fusion import Disagreement, FusionReport, PairDisagreement
from schemas.measures import Measure, Measures
from schemas.quality import CameraQuality, MeshQuality, Quality
from schemas.used_calibration import UsedCalibration

IDENTITY = [[float(row == column) for column in range(4)] for row in range(4)]


def quality(*, lost: int = 0, points: int = 9, rms: float = 0.05, **mesh: Any) -> Quality:
    whole = {"vertices": 4, "triangles": 4, "open_edges": 0, "non_manifold_edges": 0, "components": 1, "holes": 0}
    apart = Disagreement(median_mm=0.0, deviation_mm=rms, rms_mm=rms)
    return Quality(
        calibration=UsedCalibration(name="c", sha256=""),
        cameras=[
            CameraQuality(
                camera=3, frames=100, frames_lost=lost, frames_with_stripe=1, points=points, removed={"end": 1}
            )
        ],
        fusion=FusionReport(pairs=[PairDisagreement(cameras=(1, 3), points=5, before=apart, after=apart)]),
        cloud_points=9,
        mesh=MeshQuality.model_validate(whole | {"filled_share": 0.05} | mesh),
    )


def measures(*statuses: str, **known: Any) -> Measures:
    return Measures(
        side="left",
        axis="toe2",
        transform=IDENTITY,
        measures={
            f"girth_{number}": Measure.model_validate(
                {"unit": "mm", "status": status, "definition": "d", "note": "n",
                 "value": None if status == "incomplete" else 1.0}
            )
            for number, status in enumerate(statuses)
        },
        **known,
    )  # fmt: skip


GOOD = ["good"] * 4


@pytest.mark.parametrize(
    ("of_quality", "statuses", "levels"),
    [
        ({}, ["ok"], GOOD),
        ({"lost": 5}, ["ok"], ["fair", *GOOD[1:]]),
        ({"lost": 6}, ["ok"], ["poor", *GOOD[1:]]),
        ({"points": 0}, ["ok"], ["poor", *GOOD[1:]]),
        ({"rms": 0.1}, ["ok"], GOOD),
        ({"rms": 0.11}, ["ok"], ["good", "fair", "good", "good"]),
        ({"rms": 0.26}, ["ok"], ["good", "poor", "good", "good"]),
        ({"filled_share": 0.11}, ["ok"], ["good", "good", "fair", "good"]),
        ({"filled_share": 0.26}, ["ok"], ["good", "good", "poor", "good"]),
        ({"filled_share": None}, ["ok"], ["good", "good", "unknown", "good"]),
        ({"open_edges": 3}, ["ok"], ["good", "good", "poor", "good"]),
        ({}, ["ok", "uncertain"], ["good", "good", "good", "fair"]),
        ({}, ["uncertain", "incomplete"], ["good", "good", "good", "poor"]),
        ({}, ["uncertain", "uncertain"], ["good", "good", "good", "poor"]),
        ({}, [*["ok"] * 9, "incomplete"], ["good", "good", "good", "fair"]),
        ({}, [*["ok"] * 8, "incomplete"], ["good", "good", "good", "poor"]),
    ],
)
def test_each_light_goes_by_its_own_figure(of_quality: dict[str, Any], statuses: list[str], levels: list[str]) -> None:
    lights = quality_lights(measures(*statuses), quality(**of_quality))
    assert [light.level for light in lights] == levels
    order = ["good", "fair", "unknown", "poor"]
    assert worst(lights) == max(levels, key=order.index)


def test_what_is_no_foot_has_a_poor_light() -> None:
    assert quality_lights(measures(finding="no foot"), quality())[3].why == "none: no foot"
    assert worst([]) == "unknown"


def test_a_camera_is_judged_by_all_that_it_shares_with_others() -> None:
    """Few places of a pair say little; many of a camera that was knocked say all."""

    def pair(cameras: tuple[int, int], points: int, median: float) -> PairDisagreement:
        apart = Disagreement(median_mm=median, deviation_mm=0.03, rms_mm=abs(median))
        return PairDisagreement(cameras=cameras, points=points, before=apart, after=apart)

    shared = [pair((1, 2), 2000, 0.0), pair((1, 3), 1000, -0.4), pair((2, 3), 1000, 0.4), pair((1, 4), 500, 0.0)]
    of_pairs = quality().model_copy(update={"fusion": FusionReport(pairs=[*shared, pair((2, 4), 4, 2.0)])})
    apart = apart_mm(of_pairs)
    assert max(apart, key=lambda camera: apart[camera]) == 3
    assert apart[3] == pytest.approx(np.hypot(0.4, 0.03))
    assert apart[4] == pytest.approx(np.sqrt((504 * 0.03**2 + 4 * 2.0**2) / 504))
    assert quality_lights(measures("ok"), of_pairs)[1].level == "poor"

"""A sitting: the scans of the present person, and their quality."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from footscan.report.quality_lights import Level, quality_lights, worst
from pipelines.console.pages.results import read_measures, read_quality
from pipelines.console.scanner import Scanned
from schemas.base.errors import RefusedInput


@dataclass(frozen=True)
class ScannedFoot:
    """A scan of the sitting."""

    scanned: Scanned
    level: Level
    length_mm: float | None = None

    @property
    def href(self) -> str | None:
        """Address of its page; None if it was not measured."""
        scanned = self.scanned
        return None if scanned.problem else f"/foot/{scanned.patient}/{scanned.scan}"


@dataclass(frozen=True)
class Sitting:
    """The present person, and the scans in the order in which they were made."""

    patient: str = ""
    feet: tuple[ScannedFoot, ...] = ()

    def begun(self, patient: str) -> "Sitting":
        """The sitting of `patient`: this one, or a new one if the person is another."""
        return self if patient == self.patient else Sitting(patient)

    def with_foot(self, foot: ScannedFoot) -> "Sitting":
        """The sitting with one more scan, or with another judgement of a scan that it has."""
        others = tuple(other for other in self.feet if other.scanned.scan != foot.scanned.scan)
        return replace(self, feet=(*others, foot))

    def pair_href(self) -> str | None:
        """Address of the page of both feet, the last measured one of each side; None if one is missing."""
        last = {foot.scanned.side: foot.scanned.scan for foot in self.feet if foot.href}
        return f"/pair/{self.patient}/{last['left']}/{last['right']}" if len(last) == 2 else None

    def as_json(self) -> dict[str, Any]:
        """The sitting as a JSON object for the page."""
        feet = [
            {
                "side": foot.scanned.side,
                "scan": foot.scanned.scan,
                "href": foot.href,
                "problem": foot.scanned.problem,
                "level": foot.level,
                "length_mm": foot.length_mm,
                "left_out": [f"camera {camera}: {why}" for camera, why in sorted(foot.scanned.left_out.items())],
            }
            for foot in self.feet
        ]
        return {"patient": self.patient, "feet": feet, "pair": self.pair_href()}


def judge_scan(scanned: Scanned, results: Path) -> ScannedFoot:
    """Judge the results of a scan."""
    if scanned.problem is not None:
        return ScannedFoot(scanned, "poor")
    try:
        measures = read_measures(results, scanned.patient, scanned.scan)
        quality = read_quality(results, scanned.patient, scanned.scan)
    except RefusedInput as error:
        return ScannedFoot(replace(scanned, problem=str(error)), "poor")
    if measures.finding is not None:
        return ScannedFoot(replace(scanned, problem=measures.finding), "poor")
    length = measures.measures.get("foot_length")
    return ScannedFoot(scanned, worst(quality_lights(measures, quality)), None if length is None else length.value)

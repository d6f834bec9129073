"""What makes a set of parameters good: a figure of each scan, and of all."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from statistics import fmean, variance

from footscan.recordings.scans import RecordedScan
from pipelines.tuning.report.result import Goal
from schemas.base.errors import RefusedInput
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.tuning import Objective

GOALS = {
    "accuracy": Goal("accuracy", "mm", "mean distance of the surface to the truth"),
    "accuracy_p99": Goal("accuracy_p99", "mm", "distance to the truth that 99 % of the surface keep"),
    "repeatability": Goal(
        "repeatability", "mm", "standard deviation of the lengths and girths between scans of one foot, pooled"
    ),
    "completeness": Goal("completeness", "%", "share of the truth within 1 mm of the surface", larger_is_better=True),
    "disagreement": Goal(
        "disagreement", "mm", "root mean square of the distances between what two cameras see of the same skin"
    ),
    "false_points": Goal("false_points", "%", "share of the cloud farther than 1 mm from the truth"),
    "time": Goal("time", "s", "time that all steps of a scan take, added up"),
}
WITHOUT_TRUTH = {
    "completeness": "without truth: share of the surface that some camera saw",
    "false_points": "without truth: share of the stripe points that were taken out as outliers",
}
WORST = {"mm": 100.0, "s": 1e5}
"""What a scan that has no figure counts as, by its unit; of shares that is the whole, or nothing."""

FLOORS = {"mm": 1e-3, "%": 0.1, "s": 1e-2}
"""Below which no value is better than another, by unit."""


@dataclass(frozen=True)
class Judged:
    """What a set of parameters made of one scan."""

    figures: Mapping[str, float] = field(default_factory=dict)
    """By objective, as far as they are known."""
    lengths: Mapping[str, float] = field(default_factory=dict)
    """Its measures in mm."""
    problem: str | None = None
    kind: str | None = None
    """As in `Failure`."""


def goals_of(objectives: Sequence[Objective], scans: Sequence[RecordedScan]) -> tuple[list[Goal], list[str]]:
    """What stands for the objectives with these scans, and what is to be said of it.

    Raises
    ------
    RefusedInput
        Repeatability is asked for, and no foot was scanned twice.
    """
    known = [scan for scan in scans if scan.truth is not None]
    repeated = any(len(names) > 1 for names in feet(scans).values())
    goals: dict[str, Goal] = {}
    notes: list[str] = []
    for name in objectives:
        if name in ("accuracy", "accuracy_p99") and not known:
            stands_in = ["disagreement", *(["repeatability"] if repeated else [])]
            goals |= {other: goals.get(other, GOALS[other]) for other in stands_in}
            instead = "agreement of the cameras" + (" and of repeated scans" if repeated else "")
            notes.append(f"No scan names a truth: {instead} stands in for {name}, and shows no error common to all.")
        elif name == "repeatability" and not repeated:
            raise RefusedInput("tune.objectives", "repeatability needs two scans of one patient and side, found none")
        else:
            goals[name] = GOALS[name]
            if known and len(known) < len(scans) and name.startswith("accuracy"):
                notes.append(f"{name} is that of the {len(known)} of {len(scans)} scans that name a truth.")
    if not known:
        for other in WITHOUT_TRUTH.keys() & goals.keys():
            goals[other] = replace(goals[other], meaning=WITHOUT_TRUTH[other])
    elif len(known) < len(scans):
        notes += [f"{other}, {meaning}." for other, meaning in WITHOUT_TRUTH.items() if other in goals]
    return list(goals.values()), notes


def feet(scans: Sequence[RecordedScan]) -> dict[str, list[str]]:
    """Names of the scans of each foot that is known: patient and side."""
    found: dict[str, list[str]] = {}
    for scan in scans:
        if scan.document.side != "unknown":
            found.setdefault(f"{scan.document.patient} {scan.document.side}", []).append(scan.name)
    return found


def figures_of(quality: Quality, shares: bytes | None) -> dict[str, float]:
    """The figures of a scan that its documents tell; `shares` is the result of `pipelines.tuning.judge`."""
    figures: dict[str, float] = {}
    if quality.truth is not None:
        figures |= {"accuracy": quality.truth.mean, "accuracy_p99": quality.truth.p99}
    if shares is not None:
        judged = json.loads(shares)
        figures |= {"completeness": 100 * judged["there"], "false_points": 100 * judged["false"]}
    else:
        points = sum(camera.points for camera in quality.cameras)
        removed = sum(sum(camera.removed.values()) for camera in quality.cameras)
        figures |= {"false_points": 100 * removed / max(points, 1)}
        if quality.mesh.filled_share is not None:
            figures["completeness"] = 100 * (1 - quality.mesh.filled_share)
    pairs = quality.fusion.pairs
    if compared := sum(pair.points for pair in pairs):
        figures["disagreement"] = sqrt(sum(pair.points * pair.after.rms_mm**2 for pair in pairs) / compared)
    return figures


def lengths_of(measures: Measures) -> dict[str, float]:
    """The measures that say how far apart scans of one foot are."""
    return {name: m.value for name, m in measures.measures.items() if m.unit == "mm" and m.value is not None}


def values_of(goal: Goal, judged: Mapping[str, Judged], scans: Sequence[RecordedScan]) -> dict[str, float | None]:
    """The figure of each scan that can have one, or of each foot that was scanned twice; None where it failed."""
    if goal.name == "repeatability":
        groups = {foot: [judged[name] for name in names] for foot, names in feet(scans).items() if len(names) > 1}
        return {foot: _repeatability(group) for foot, group in groups.items()}
    needs_truth = goal.name in ("accuracy", "accuracy_p99")
    return {
        scan.name: judged[scan.name].figures.get(goal.name)
        for scan in scans
        if scan.truth is not None or not needs_truth
    }


def mean_of(goal: Goal, values: Mapping[str, float | None]) -> float:
    """Over the data sets, at least one; what failed counts as the worst that there is."""
    worst = (0.0 if goal.larger_is_better else 100.0) if goal.unit == "%" else WORST[goal.unit]
    return fmean(worst if value is None else value for value in values.values())


def _repeatability(group: Sequence[Judged]) -> float | None:
    """Root of the mean variance of the measures that all scans of a foot have."""
    common = set.intersection(*(set(judged.lengths) for judged in group))
    if not common:
        return None
    return sqrt(fmean(variance([judged.lengths[name] for judged in group]) for name in sorted(common)))

"""Objectives of a search: the figure of each scan, and the mean of all."""

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
    "accuracy_p99": Goal("accuracy_p99", "mm", "distance to the truth that 99 % of the surface do not exceed"),
    "repeatability": Goal(
        "repeatability", "mm", "standard deviation of the lengths and girths between scans of one foot, pooled"
    ),
    "completeness": Goal("completeness", "%", "share of the truth within 1 mm of the surface", larger_is_better=True),
    "disagreement": Goal(
        "disagreement", "mm", "root mean square distance between the same skin as seen by two cameras"
    ),
    "false_points": Goal("false_points", "%", "share of the cloud farther than 1 mm from the truth"),
    "time": Goal("time", "s", "total time of all steps of a scan"),
}
WITHOUT_TRUTH = {
    "completeness": "without truth: share of the surface that a camera saw",
    "false_points": "without truth: share of the stripe points that were removed as outliers",
}
WORST = {"mm": 100.0, "s": 1e5}
"""Value of a scan without a figure, by unit, for all but shares: worse than any real scan; chosen by hand."""
FLOORS = {"mm": 1e-3, "%": 0.1, "s": 1e-2}
"""Values below which differences do not count, by unit; chosen by hand."""


@dataclass(frozen=True)
class Judged:
    """Figures of one scan with a set of parameters."""

    figures: Mapping[str, float] = field(default_factory=dict)
    """Figures by objective, as far as known."""
    lengths: Mapping[str, float] = field(default_factory=dict)
    """Measures in mm, by name."""
    problem: str | None = None
    kind: str | None = None
    """Kind of the problem, as in `Failure`."""


def goals_of(objectives: Sequence[Objective], scans: Sequence[RecordedScan]) -> tuple[list[Goal], list[str]]:
    """Choose the goals for the objectives with these scans, and the notes on the choice.

    Raises
    ------
    RefusedInput
        Repeatability is an objective, but no foot was scanned twice.
    """
    with_truth = [scan for scan in scans if scan.truth is not None]
    repeated = any(len(names) > 1 for names in feet(scans).values())
    goals: dict[str, Goal] = {}
    notes: list[str] = []
    for name in objectives:
        if name in ("accuracy", "accuracy_p99") and not with_truth:
            substitutes = ["disagreement", *(["repeatability"] if repeated else [])]
            goals |= {other: goals.get(other, GOALS[other]) for other in substitutes}
            substitute = "agreement of the cameras" + (" and of repeated scans" if repeated else "")
            notes.append(
                f"No scan names a truth: {substitute} stands in for {name}, and shows no error that all share."
            )
        elif name == "repeatability" and not repeated:
            raise RefusedInput("tune.objectives", "repeatability needs two scans of one patient and side, found none")
        else:
            goals[name] = GOALS[name]
            if with_truth and len(with_truth) < len(scans) and name.startswith("accuracy"):
                notes.append(f"{name} is that of the {len(with_truth)} of {len(scans)} scans that name a truth.")
    if not with_truth:
        for other in WITHOUT_TRUTH.keys() & goals.keys():
            goals[other] = replace(goals[other], meaning=WITHOUT_TRUTH[other])
    elif len(with_truth) < len(scans):
        notes += [f"{other}, {meaning}." for other, meaning in WITHOUT_TRUTH.items() if other in goals]
    return list(goals.values()), notes


def feet(scans: Sequence[RecordedScan]) -> dict[str, list[str]]:
    """Names of the scans of each foot, by patient and side; scans of unknown side are left out."""
    names: dict[str, list[str]] = {}
    for scan in scans:
        if scan.document.side != "unknown":
            names.setdefault(f"{scan.document.patient} {scan.document.side}", []).append(scan.name)
    return names


def figures_of(quality: Quality, shares: bytes | None) -> dict[str, float]:
    """Figures of a scan from its documents; `shares` is the result of the step `pipelines.tuning.judge`."""
    figures: dict[str, float] = {}
    if quality.truth is not None:
        figures |= {"accuracy": quality.truth.mean, "accuracy_p99": quality.truth.p99}
    if shares is not None:
        share = json.loads(shares)
        figures |= {"completeness": 100 * share["there"], "false_points": 100 * share["false"]}
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
    """Measures in mm by name, from which the repeatability is computed."""
    return {name: m.value for name, m in measures.measures.items() if m.unit == "mm" and m.value is not None}


def values_of(goal: Goal, judged: Mapping[str, Judged], scans: Sequence[RecordedScan]) -> dict[str, float | None]:
    """Values of a goal by scan, or by foot that was scanned more than once; None for a failure."""
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
    """Mean of the values of a goal over the data sets, at least one; a failure counts as the worst value."""
    worst = (0.0 if goal.larger_is_better else 100.0) if goal.unit == "%" else WORST[goal.unit]
    return fmean(worst if value is None else value for value in values.values())


def _repeatability(group: Sequence[Judged]) -> float | None:
    """Root of the mean variance of the measures common to all scans of a foot; None without common measures."""
    common = set.intersection(*(set(judged.lengths) for judged in group))
    if not common:
        return None
    return sqrt(fmean(variance([judged.lengths[name] for judged in group]) for name in sorted(common)))

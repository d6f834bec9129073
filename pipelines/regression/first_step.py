"""The first steps whose results differ from the accepted ones: those that do not depend on another such step.

Processors of different kinds round differently: with a baseline from another machine, all steps may differ although no
figure does. A step that agrees with the last good night on this machine is therefore not reported.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success
from pipelines.engine.audit import input_digests
from pipelines.engine.explain import changes, side_by_side
from pipelines.engine.store.store import Store
from pipelines.regression.report.result import Change, FirstStep, JudgedFigure
from schemas.regression import AcceptedStep

FILMED_FROM = {"ingest": "film", "background": "film"}
"""Kinds of steps that read the films of a virtual scan, and the step that makes the films."""
CALIBRATED = {"map", "heads", "clean", "orient", "texture", "quality", "report"}
"""Kinds of steps that use the calibration of a virtual scan."""
LINES = 12
"""Lines of a change that are shown; chosen by hand."""
SLOWER, LARGER = "takes longer", "takes more memory"


@dataclass(frozen=True)
class PresentStep:
    """A step of the last night."""

    step: Step
    key: str
    """Key of its action; empty if a step before it failed."""
    image: str
    """The text that `key` is the hash of; empty if a step before it failed."""
    result: str
    """As in `AcceptedStep`."""

    @property
    def name(self) -> str:
        """Name within its scan: `extract-3`."""
        return self.step.name.removeprefix(f"{self.step.scan}/")

    @property
    def accepted(self) -> AcceptedStep:
        """The step as it is written into the baseline."""
        return AcceptedStep(step=self.name, key=self.key, result=self.result)


@dataclass(frozen=True)
class EarlierSteps:
    """Earlier results of the steps of a set."""

    accepted: Sequence[AcceptedStep]
    """Results when the baseline was accepted; empty if unknown."""
    good: Sequence[AcceptedStep] = ()
    """Results in the last night on this machine in which nothing of the set was worse; empty without such a night."""

    def of(self, name: str) -> list[AcceptedStep]:
        """Results of a step: in the last good night, then in the baseline."""
        return [step for step in (*self.good, *self.accepted) if step.step == name]

    @property
    def lasting(self) -> list[str]:
        """Names of the accepted steps that the last good night had, too."""
        kept = {step.step for step in self.good or self.accepted}
        return [step.step for step in self.accepted if step.step in kept]


def present_steps(steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> list[PresentStep]:
    """Combine each step with its result; steps without an outcome failed by a fault, or waited for such a step."""
    present = []
    for step in steps:
        outcome = outcomes.get(step.name)
        digests = input_digests(step, outcomes)
        image = image_text(step, digests) if digests.keys() == step.inputs.keys() else ""
        if isinstance(outcome, Success):
            result = outcome.digest
        else:
            result = f"no result: {outcome.kind if isinstance(outcome, Failure) else 'fault'}"
        present.append(PresentStep(step, key_of(image) if image else "", image, result))
    return present


def first_steps(earlier: EarlierSteps, present: Sequence[PresentStep], store: Store) -> list[FirstStep]:
    """Find the steps at which two runs begin to differ; empty if they agree, or nothing was accepted."""
    if not earlier.accepted:
        return []
    names = {step.name for step in present}
    missing = [name for name in earlier.lasting if name not in names]
    first = [FirstStep([name], "no longer exists") for name in _chain_starts(missing)]
    differ: set[str] = set()
    roots: list[PresentStep] = []
    for step in present:
        if all(before.result != step.result for before in earlier.of(step.name)):
            differ.add(step.name)
            follows = any(name in differ for name in _before(step.step, names))
            # A step that combines all cameras differs if one of them is missing.
            if not follows and (step.step.camera is not None or not any(map(_of_a_camera, missing))):
                roots.append(step)
    first += [_explained(step, earlier, store) for step in roots]
    return list(_grouped(first))


def costly_steps(
    figures: Sequence[JudgedFigure],
    keeps_most: str | None,
    earlier: EarlierSteps,
    present: Sequence[PresentStep],
    store: Store,
) -> list[FirstStep]:
    """Find the first kind of step that takes longer than accepted, and the first that takes more memory.

    Parameters
    ----------
    keeps_most : the kind of step after which memory grows most from pass to pass
    """
    costly = []
    for group, why in (("time", SLOWER), ("memory", LARGER)):
        worse = {
            figure.name.removeprefix(f"{group}.").removesuffix("_mb"): figure
            for figure in figures
            if figure.name.startswith(f"{group}.") and figure.verdict == "worse"
        }
        if not worse:
            continue
        kinds = list(dict.fromkeys(step.step.kind for step in present))
        kind = next((kind for kind in kinds if kind in worse), None)
        if kind is None:
            kind = keeps_most if group == "memory" else _slowest(figures, kinds)
        steps = [step for step in present if step.step.kind == kind]
        if steps:
            first = _explained(steps[0], earlier, store)
            costly.append(FirstStep([step.name for step in steps], why, first.changes))
    return costly


def _slowest(figures: Sequence[JudgedFigure], kinds: Sequence[str]) -> str | None:
    """The kind of step whose time has grown most: only the sum exceeds its tolerance, no kind alone."""
    grown = {
        kind: figure.value - figure.accepted
        for figure in figures
        if (kind := figure.name.removeprefix("time.")) in kinds and figure.name.startswith("time.")
        if figure.value is not None and figure.accepted is not None
    }
    return max(grown, key=lambda kind: grown[kind], default=None)


def _before(step: Step, names: set[str]) -> Iterator[str]:
    """Names of the steps that a step depends on, including those that film and calibrate."""
    for source in step.inputs.values():
        if isinstance(source, Output):
            yield source.step.removeprefix(f"{step.scan}/")
    if (film := FILMED_FROM.get(step.kind)) in names:
        yield str(film)
    if step.kind in CALIBRATED and "calibrate" in names:
        yield "calibrate"


def _chain_starts(missing: Sequence[str]) -> list[str]:
    """The first missing step of each camera, or the first of all; `missing` is in the order of the steps."""
    starts: dict[str, str] = {}
    for name in missing:
        starts.setdefault(name.rpartition("-")[2] if _of_a_camera(name) else "", name)
    return [name for camera, name in starts.items() if camera or len(starts) == 1]


def _of_a_camera(name: str) -> bool:
    return name.rpartition("-")[2].isdecimal()


def _explained(step: PresentStep, earlier: EarlierSteps, store: Store) -> FirstStep:
    before = earlier.of(step.name)
    if not before:
        return FirstStep([step.name], "is new")
    rows = (store.row(accepted.key) for accepted in before if accepted.key and step.image)
    row = next((row for row in rows if row is not None), None)
    shown: list[Change] = []
    if row is not None:
        for change in changes(step.step, row.image, json.loads(step.image), store):
            as_lines = change.what == "code" or "\n" in f"{change.old}{change.new}"
            if as_lines and change.old is not None and change.new is not None:
                shown.append(Change(str(change), side_by_side(change)[:LINES]))
            elif change.what in {"parameter", "library"}:
                shown += [Change(f"{change}: {values}") for values in _old_and_new(change.old, change.new)]
            else:
                shown.append(Change(str(change)))
    why = step.result if step.result.startswith("no result") else "its result differs"
    return FirstStep([step.name], why, shown)


def _old_and_new(old: str | None, new: str | None) -> list[str]:
    """An old and a new value; of groups of values, only those that differ."""
    try:
        was, now = json.loads(old or "null"), json.loads(new or "null")
    except ValueError:  # a version of a library
        was = now = None
    if not (isinstance(was, dict) and isinstance(now, dict)):
        return [f"{old} → {new}"]
    differ = sorted(name for name in was.keys() | now.keys() if was.get(name) != now.get(name))
    return [f"{name} {json.dumps(was.get(name))} → {json.dumps(now.get(name))}" for name in differ]


def _grouped(steps: Sequence[FirstStep]) -> Iterator[FirstStep]:
    """Combine steps of one kind with the same explanation, such as those of several cameras."""
    groups: dict[tuple[object, ...], FirstStep] = {}
    for step in steps:
        name = step.steps[0]
        kind = name.rpartition("-")[0] if _of_a_camera(name) else name
        explanation = (kind, step.why, tuple(change.text for change in step.changes))
        group = groups.get(explanation)
        groups[explanation] = step if group is None else FirstStep([*group.steps, *step.steps], step.why, group.changes)
    yield from groups.values()

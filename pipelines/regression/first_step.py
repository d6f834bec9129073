"""Which step came out otherwise first: of all whose results differ from the accepted ones, those that rest on none.

Another kind of processor rounds otherwise, so that with a baseline from elsewhere every step differs from the first on,
and no figure does. What came out alike in the last good night on this machine is therefore not where it begins.
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
"""The steps that take the films of a virtual scan, and the one that makes them."""
CALIBRATED = {"map", "clean", "orient", "texture", "quality", "report"}
"""Those that take its calibration."""
LINES = 12
"""Of a change that are shown."""
SLOWER, LARGER = "takes longer", "takes more memory"


@dataclass(frozen=True)
class PresentStep:
    """A step of last night."""

    step: Step
    key: str
    """Of its action; empty where a step before it failed."""
    image: str
    result: str
    """As in `AcceptedStep`."""

    @property
    def name(self) -> str:
        """Within its scan: `extract-3`."""
        return self.step.name.removeprefix(f"{self.step.scan}/")

    @property
    def accepted(self) -> AcceptedStep:
        """As it is written down."""
        return AcceptedStep(step=self.name, key=self.key, result=self.result)


@dataclass(frozen=True)
class KnownSteps:
    """What the steps of a set came to before."""

    accepted: Sequence[AcceptedStep]
    """When the baseline was accepted; empty where that is not known."""
    good: Sequence[AcceptedStep] = ()
    """In the last night on this machine in which nothing of the set was worse; empty where there was none."""

    def of(self, name: str) -> list[AcceptedStep]:
        """A step in the last good night, and when it was accepted."""
        return [step for step in (*self.good, *self.accepted) if step.step == name]

    @property
    def lasting(self) -> list[str]:
        """Names of the accepted steps, without those that the last good night did without."""
        kept = {step.step for step in self.good or self.accepted}
        return [step.step for step in self.accepted if step.step in kept]


def present_steps(steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> list[PresentStep]:
    """What each step came to; those that failed by a fault, and what waits for them, have no outcome."""
    found = []
    for step in steps:
        outcome = outcomes.get(step.name)
        digests = input_digests(step, outcomes)
        image = image_text(step, digests) if digests.keys() == step.inputs.keys() else ""
        if isinstance(outcome, Success):
            result = outcome.digest
        else:
            result = f"no result: {outcome.kind if isinstance(outcome, Failure) else 'fault'}"
        found.append(PresentStep(step, key_of(image) if image else "", image, result))
    return found


def first_steps(known: KnownSteps, present: Sequence[PresentStep], store: Store) -> list[FirstStep]:
    """Where the difference between two runs begins; empty where there is none, or nothing was accepted."""
    if not known.accepted:
        return []
    names = {step.name for step in present}
    gone = [name for name in known.lasting if name not in names]
    found = [FirstStep([name], "is no more") for name in _chain_starts(gone)]
    differ: set[str] = set()
    roots: list[PresentStep] = []
    for step in present:
        if all(before.result != step.result for before in known.of(step.name)):
            differ.add(step.name)
            follows = any(name in differ for name in _before(step.step, names))
            # What cameras come together in differs where one of them is missing.
            if not follows and (step.step.camera is not None or not any(map(_of_a_camera, gone))):
                roots.append(step)
    found += [_explained(step, known, store) for step in roots]
    return list(_together(found))


def costly_steps(
    figures: Sequence[JudgedFigure],
    keeps_most: str | None,
    known: KnownSteps,
    present: Sequence[PresentStep],
    store: Store,
) -> list[FirstStep]:
    """The first kind of step that takes longer than accepted, and the first that takes more memory.

    Parameters
    ----------
    keeps_most : the kind after which memory grows most from pass to pass
    """
    found = []
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
            first = _explained(steps[0], known, store)
            found.append(FirstStep([step.name for step in steps], why, first.changes))
    return found


def _slowest(figures: Sequence[JudgedFigure], kinds: Sequence[str]) -> str | None:
    """The kind whose time has grown most, where the sum has grown too much, but none by itself."""
    grown = {
        kind: figure.value - figure.accepted
        for figure in figures
        if (kind := figure.name.removeprefix("time.")) in kinds and figure.name.startswith("time.")
        if figure.value is not None and figure.accepted is not None
    }
    return max(grown, key=lambda kind: grown[kind], default=None)


def _before(step: Step, names: set[str]) -> Iterator[str]:
    """The steps that a step takes from, those that film and calibrate among them."""
    for source in step.inputs.values():
        if isinstance(source, Output):
            yield source.step.removeprefix(f"{step.scan}/")
    if (film := FILMED_FROM.get(step.kind)) in names:
        yield str(film)
    if step.kind in CALIBRATED and "calibrate" in names:
        yield "calibrate"


def _chain_starts(gone: Sequence[str]) -> list[str]:
    """Of steps that are no more, in their order: the first of each camera, or the first of all."""
    starts: dict[str, str] = {}
    for name in gone:
        starts.setdefault(name.rpartition("-")[2] if _of_a_camera(name) else "", name)
    return [name for camera, name in starts.items() if camera or len(starts) == 1]


def _of_a_camera(name: str) -> bool:
    return name.rpartition("-")[2].isdecimal()


def _explained(step: PresentStep, known: KnownSteps, store: Store) -> FirstStep:
    before = known.of(step.name)
    if not before:
        return FirstStep([step.name], "is new")
    rows = (store.row(one.key) for one in before if one.key and step.image)
    row = next((row for row in rows if row is not None), None)
    found: list[Change] = []
    if row is not None:
        for change in changes(step.step, row.image, json.loads(step.image), store):
            as_lines = change.what == "code" or "\n" in f"{change.old}{change.new}"
            if as_lines and change.old is not None and change.new is not None:
                found.append(Change(str(change), side_by_side(change)[:LINES]))
            elif change.what in {"parameter", "library"}:
                found += [Change(f"{change}: {told}") for told in _old_and_new(change.old, change.new)]
            else:
                found.append(Change(str(change)))
    why = step.result if step.result.startswith("no result") else "its result is another"
    return FirstStep([step.name], why, found)


def _old_and_new(old: str | None, new: str | None) -> list[str]:
    """Two values; of groups of values, those that differ."""
    try:
        was, now = json.loads(old or "null"), json.loads(new or "null")
    except ValueError:  # a version of a library
        was = now = None
    if not (isinstance(was, dict) and isinstance(now, dict)):
        return [f"{old} → {new}"]
    differ = sorted(name for name in was.keys() | now.keys() if was.get(name) != now.get(name))
    return [f"{name} {json.dumps(was.get(name))} → {json.dumps(now.get(name))}" for name in differ]


def _together(found: Sequence[FirstStep]) -> Iterator[FirstStep]:
    """Steps of one kind of which the same is to be said, such as those of the cameras, in one."""
    alike: dict[tuple[object, ...], FirstStep] = {}
    for one in found:
        first = one.steps[0]
        kind = first.rpartition("-")[0] if _of_a_camera(first) else first
        said = (kind, one.why, tuple(change.text for change in one.changes))
        known = alike.get(said)
        alike[said] = one if known is None else FirstStep([*known.steps, *one.steps], one.why, known.changes)
    yield from alike.values()

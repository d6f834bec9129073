"""How long steps take, whenever it was that they ran."""

import importlib
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success
from pipelines.engine.pool import StepEnd
from pipelines.engine.run import content_of
from pipelines.engine.store.store import Store


@dataclass
class Clock:
    """Counts the steps that run, and notes how long each takes."""

    seconds: dict[str, float]
    """By the key of its action; of earlier runs, too."""
    ran: Counter[str] = field(default_factory=Counter)
    """Steps that ran, by kind."""
    _lasted: dict[str, float] = field(default_factory=dict)
    """Of steps that have just run, by name."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def on_step_end(self, end: StepEnd) -> None:
        """Hears that a step has ended."""
        with self._lock:
            if end.ran:
                self.ran[end.step.kind] += 1
                self._lasted[end.step.name] = end.seconds

    def note(self, steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> dict[str, float]:
        """Keep how long those of the steps took that have just run; returns it."""
        noted: dict[str, float] = {}
        for step in steps:
            lasted = self._lasted.pop(step.name, None)
            if lasted is not None and (digests := _inputs(step, outcomes)) is not None:
                noted[key_of(image_text(step, digests))] = lasted
        self.seconds |= noted
        return noted

    def of(self, steps: Sequence[Step], outcomes: Mapping[str, Outcome], store: Store) -> float:
        """What steps take, added up; one whose result is known, but not how long it took, is run again for that."""
        total = 0.0
        for step in steps:
            digests = _inputs(step, outcomes)
            if digests is None or not isinstance(outcomes[step.name], Success):
                continue
            key = key_of(image_text(step, digests))
            if key not in self.seconds:
                self.seconds[key] = _timed(step, digests, store)
            total += self.seconds[key]
        return total


def _inputs(step: Step, outcomes: Mapping[str, Outcome]) -> dict[str, str] | None:
    """Digests of what a step takes; None where one of the steps before it has failed."""
    digests: dict[str, str] = {}
    for name, source in step.inputs.items():
        if not isinstance(source, Output):
            digests[name] = source.digest
        elif isinstance(outcome := outcomes[source.step], Failure):
            return None
        else:
            digests[name] = outcome.digest
    return digests


def _timed(step: Step, digests: Mapping[str, str], store: Store) -> float:
    content = {name: content_of(step, source, digests[name], store) for name, source in step.inputs.items()}
    start = time.perf_counter()
    importlib.import_module(step.module).run(content, step.parameters, step.places)
    return time.perf_counter() - start

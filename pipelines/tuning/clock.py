"""Times of steps, including those that ran earlier."""

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
    """Counts the steps that run, and records their times."""

    seconds: dict[str, float]
    """Time of each step by the key of its action, including earlier runs."""
    ran: Counter[str] = field(default_factory=Counter)
    """Number of steps that ran, by kind."""
    _lasted: dict[str, float] = field(default_factory=dict)
    """Times of the steps that have just run, by name."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def on_step_end(self, end: StepEnd) -> None:
        """Record the end of a step."""
        with self._lock:
            if end.ran:
                self.ran[end.step.kind] += 1
                self._lasted[end.step.name] = end.seconds

    def note(self, steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> dict[str, float]:
        """Keep the times of the steps that have just run, and return them by the key of their action."""
        noted: dict[str, float] = {}
        for step in steps:
            lasted = self._lasted.pop(step.name, None)
            if lasted is not None and (digests := _inputs(step, outcomes)) is not None:
                noted[key_of(image_text(step, digests))] = lasted
        self.seconds |= noted
        return noted

    def of(self, steps: Sequence[Step], outcomes: Mapping[str, Outcome], store: Store) -> float:
        """Sum of the times of steps; a step with a stored result but unknown time is run again to time it."""
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
    """Digests of the inputs of a step; None if a step before it has failed."""
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

"""What steps took lately: their times and the sizes of their results, from which a plan is estimated."""

import json
import logging
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import NamedTuple

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import StepEnd
from schemas.base.errors import Fault

log = logging.getLogger("footscan.store")

KEPT = 50
"""Runs kept of each kind of step; chosen by hand: their median bears a few slow ones."""


class Cost(NamedTuple):
    """What one run of a step took."""

    seconds: float
    size: int
    """Bytes of its result."""


@dataclass
class History:
    """The last runs of each kind of step, kept in one file of this machine. It may be lost."""

    file: Path
    _runs: dict[str, deque[Cost]] = field(default_factory=dict)
    _is_changed: bool = False

    @classmethod
    def load(cls, file: Path) -> "History":
        """Load the history; empty if the file is missing or damaged."""
        try:
            document = json.loads(file.read_bytes())
            runs = {
                str(kind): deque((Cost(float(seconds), int(size)) for seconds, size in rows), KEPT)
                for kind, rows in document.items()
            }
        except (OSError, ValueError, TypeError, AttributeError, RecursionError, OverflowError):
            runs = {}
        return cls(file, runs)

    def add(self, end: StepEnd) -> None:
        """Note the end of a step that ran and has a result."""
        if end.ran and end.size:
            self._runs.setdefault(end.step.kind, deque(maxlen=KEPT)).append(Cost(end.seconds, end.size))
            self._is_changed = True

    def of(self, kind: str) -> Cost | None:
        """What a step of this kind takes, as the median of its last runs; None if it never ran."""
        runs = self._runs.get(kind)
        if not runs:
            return None
        return Cost(median(run.seconds for run in runs), round(median(run.size for run in runs)))

    def save(self) -> None:
        """Write the history for later plans; a failure only costs their estimates."""
        if self._is_changed:
            document = {kind: [[round(s, 6), size] for s, size in runs] for kind, runs in sorted(self._runs.items())}
            try:
                write_atomically(self.file, json.dumps(document).encode())
            except Fault as error:
                log.debug("%s", error)
            self._is_changed = False

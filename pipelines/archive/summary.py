"""A plan in few lines: the steps to run by kind and reason, with the time and the bytes that they will take."""

from collections.abc import Sequence
from typing import NamedTuple

from pipelines.archive.planning import PlannedJob, Waiting
from pipelines.scan import DELIVERABLE


class Line(NamedTuple):
    """Steps of one kind that would run for the same reason."""

    kind: str
    reason: str
    """That of `Waiting`, without the number of a camera."""
    steps: int
    seconds: float | None
    """Of all of them, one after the other; None if no such step ever ran here."""
    size: int | None
    """Bytes that they write: results in the store, frames, and delivered files; None likewise."""


def summary_of(planned: PlannedJob) -> list[Line]:
    """Sum up a plan that was made with its reasons, in the order of the steps.

    Times and sizes are medians of what such steps took before in this store. They are upper limits: a step that waits
    for another one runs only if that one's result changes.
    """
    alike: dict[tuple[str, str], list[Waiting]] = {}
    for waiting in planned.waiting:
        alike.setdefault((waiting.kind, waiting.reason.partition(" of camera ")[0]), []).append(waiting)
    return [_line(kind, reason, planned, steps) for (kind, reason), steps in alike.items()]


def total(values: Sequence[float | None]) -> float | None:
    """Sum of the known values; None if none is known."""
    known = [value for value in values if value is not None]
    return sum(known) if known or not values else None


def _line(kind: str, reason: str, planned: PlannedJob, steps: Sequence[Waiting]) -> Line:
    cost, frames = planned.workspace.history.of(kind), sum(step.frame_bytes for step in steps)
    if cost is None:
        return Line(kind, reason, len(steps), None, frames or None)
    copies = 2 if kind in DELIVERABLE.values() else 1
    return Line(kind, reason, len(steps), cost.seconds * len(steps), cost.size * len(steps) * copies + frames)

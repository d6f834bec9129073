"""Results that a new version of a library or of the code has made stale, and which of them may stay.

A step's key stands for its code and the libraries that it computes with. Where a sample of the steps that an upgrade
would run again comes to the same bytes, the results of all of them can be accepted under the new key.
"""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipelines.engine.actions.key import image_text, key_of
from pipelines.engine.actions.step import Outcome, Step
from pipelines.engine.audit import Repeatable, input_digests
from pipelines.engine.explain import changes
from pipelines.engine.plan import cached_outcome
from pipelines.engine.run import record_outcome
from pipelines.engine.store.store import Acceptance, Row, Store


class Upgrade(NamedTuple):
    """A kind of step whose code, or a library that it computes with, is of another version than when it ran last."""

    kind: str
    old: str
    """Digest of the code's identity in the last action."""
    new: str


@dataclass(frozen=True)
class Stale:
    """An action that would run for its code alone: with the old code and the same inputs it has a result."""

    action: Repeatable
    """With the result of the old code."""
    image: str
    """Pre-image of the key under the new code."""
    row: Row
    """Of the old code."""

    @property
    def upgrade(self) -> Upgrade:
        """What it shares with the same step of other scans and cameras."""
        return Upgrade(self.action.step.kind, str(self.row.image["code"]), str(json.loads(self.image)["code"]))


def stale_actions(steps: Sequence[Step], store: Store, refused: Collection[Upgrade] = ()) -> dict[str, Stale]:
    """The stale actions of a graph by their new keys, in an order in which they can run.

    Parameters
    ----------
    steps : sequence of Step
        Each after the steps whose results it takes.
    store : Store
    refused : collection of Upgrade
        Whose results may not stay. What follows from one of them is left out: its inputs are not known.
    """
    outcomes: dict[str, Outcome | None] = {}
    stale: dict[str, Stale] = {}
    for step in steps:
        digests = input_digests(step, outcomes)
        if len(digests) < len(step.inputs):
            continue
        image = image_text(step, digests)
        outcome = cached_outcome(step, store.lookup(key_of(image)))
        if outcome is None:
            candidate = _stale(step, digests, image, store)
            if candidate is None or candidate.upgrade in refused:
                continue
            stale[key_of(image)], outcome = candidate, candidate.action.outcome
        outcomes[step.name] = outcome
    return stale


def versions(stale: Stale, store: Store) -> list[str]:
    """What differs between the two versions of the code, a line each."""
    found = changes(stale.action.step, stale.row.image, json.loads(stale.image), store)
    return [change.with_versions for change in found]


def accept(stale: Stale, acceptance: Acceptance, store: Store) -> None:
    """Record the old result under the new key, and why it stands there."""
    record_outcome(stale.action.step, stale.image, (stale.row.digest, stale.row.failure), store, acceptance)


def _stale(step: Step, inputs: dict[str, str], image: str, store: Store) -> Stale | None:
    latest = store.latest(step.name)
    row = None if latest is None else store.row(latest.key)
    if latest is None or row is None:
        return None
    new = json.loads(image)
    if row.image.get("code") == new["code"] or {**row.image, "code": new["code"]} != new:
        return None
    outcome = cached_outcome(step, store.lookup(latest.key))
    return None if outcome is None else Stale(Repeatable(step, inputs, outcome), image, row)

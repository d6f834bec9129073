"""Upgrades: results that a new version of a library or of the code has made stale, and their acceptance.

The key of a step covers its code and the libraries that it computes with. If a sample of the steps that an upgrade
would run again gives the same bytes, the results of all these steps can be accepted under their new keys.
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
    """A kind of step whose code, or a library that it computes with, has changed since its last run."""

    kind: str
    old: str
    """Digest of the code's identity in the last action."""
    new: str


@dataclass(frozen=True)
class Stale:
    """An action that would run only because its code changed: the old code has a result for the same inputs."""

    action: Repeatable
    """The action, with the result of the old code."""
    image: str
    """Pre-image of the key under the new code."""
    row: Row
    """Row of the old code."""

    @property
    def upgrade(self) -> Upgrade:
        """The upgrade that made it stale, the same for this kind of step in other scans and cameras."""
        return Upgrade(self.action.step.kind, str(self.row.image["code"]), str(json.loads(self.image)["code"]))


def stale_actions(steps: Sequence[Step], store: Store, refused: Collection[Upgrade] = ()) -> dict[str, Stale]:
    """The stale actions of a graph by their new keys, in an order in which they can run.

    Parameters
    ----------
    steps : sequence of Step
        In topological order: each step after the steps whose results it takes.
    store : Store
    refused : collection of Upgrade
        Upgrades whose results are not accepted. Steps that depend on them are left out: their inputs are unknown.
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
    """List the differences between the two versions of the code, one line each."""
    differences = changes(stale.action.step, stale.row.image, json.loads(stale.image), store)
    return [change.with_versions for change in differences]


def accept(stale: Stale, acceptance: Acceptance, store: Store) -> None:
    """Record the old result under the new key, together with the acceptance."""
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

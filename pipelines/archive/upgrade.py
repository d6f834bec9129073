"""Upgrade of an archive to new versions of libraries or code: a sample is computed again, and accepted if it agrees."""

import random
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime

from pipelines.archive.planning import PlannedJob, draw_steps
from pipelines.difference import difference_in_words
from pipelines.engine.audit import Difference, repeat
from pipelines.engine.store.store import Acceptance
from pipelines.engine.upgrade import Stale, Upgrade, accept, stale_actions, versions
from schemas.base.errors import Fault, one_line


@dataclass
class Trial:
    """The trial of an upgrade for one kind of step."""

    upgrade: Upgrade
    changes: list[str]
    """Differences between the two versions of the code, one line each."""
    stale: list[str]
    """Keys of the actions that would run again."""
    sample: list[str]
    """Keys of the actions that were run again."""
    differences: list[tuple[Difference, str]] = field(default_factory=list)
    """Actions of the sample with another result, each with its difference from the recorded one in words."""
    problems: list[str] = field(default_factory=list)
    """Actions of the sample that could not be computed, one line each."""

    @property
    def agrees(self) -> bool:
        """True if the whole sample has the recorded results."""
        return not self.differences and not self.problems


def try_upgrade(planned: PlannedJob, size: int, seed: int) -> list[Trial]:
    """Run a random sample of `size` stale actions of each kind of step again, or all if there are fewer."""
    trials: dict[Upgrade, Trial] = {}
    for key, stale in _all_stale(planned):
        if stale.upgrade not in trials:
            trials[stale.upgrade] = Trial(stale.upgrade, versions(stale, planned.workspace.store), [], [])
        trials[stale.upgrade].stale.append(key)
    for trial in trials.values():
        trial.sample = random.Random(seed).sample(sorted(trial.stale), min(size, len(trial.stale)))
    chosen = {key for trial in trials.values() for key in trial.sample}
    with ThreadPoolExecutor(planned.job.threads) as pool:
        submitted = [
            (stale, pool.submit(repeat, stale.action, planned.workspace.store))
            for key, stale in _all_stale(planned)
            if key in chosen
        ]
        for stale, future in submitted:
            trial = trials[stale.upgrade]
            try:
                difference = future.result()
            except Fault as error:
                trial.problems.append(str(error))
            except Exception as error:  # a defect of the new version in one step must not hide the others
                trial.problems.append(one_line(f"{stale.action.step.name}: {type(error).__name__}: {error}"))
            else:
                if difference is not None:
                    trial.differences.append((difference, _words(difference, planned)))
    return list(trials.values())


def accept_upgrade(planned: PlannedJob, trials: Sequence[Trial], reason: str) -> int:
    """Accept the results of all kinds of steps whose sample agrees; returns their number.

    Results that depend on a kind of step whose sample differs are not accepted.
    """
    tried = {key: trial for trial in trials for key in trial.stale}
    refused = {trial.upgrade for trial in trials if not trial.agrees}
    date = datetime.now(UTC).isoformat(timespec="seconds")
    count = 0
    with planned.workspace.lease():
        for key, stale in _all_stale(planned, refused):
            trial = tried.get(key)
            if trial is None:  # it became stale after the sample was drawn
                continue
            acceptance = Acceptance(stale.upgrade.old, trial.changes, len(trial.sample), len(trial.stale), date, reason)
            accept(stale, acceptance, planned.workspace.store)
            count += 1
    return count


def _all_stale(planned: PlannedJob, refused: Collection[Upgrade] = ()) -> Iterator[tuple[str, Stale]]:
    """The stale actions of all scans, one scan at a time, each once."""
    seen: set[str] = set()
    for scan in planned.scans:
        stale = stale_actions(draw_steps(scan.scan, planned), planned.workspace.store, refused)
        yield from ((key, stale[key]) for key in stale if key not in seen)
        seen |= stale.keys()


def _words(difference: Difference, planned: PlannedJob) -> str:
    """Difference of two results in words; empty for failures, whose texts are reported anyway."""
    if difference.result is None:
        return ""
    try:
        old = planned.workspace.store.get(difference.recorded)
    except ValueError:  # the recorded outcome is a failure
        return ""
    return "" if old is None else difference_in_words(old, difference.result)

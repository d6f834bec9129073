"""An archive under a new version of a library: a sample is computed again, and its results are kept where it agrees."""

import random
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime

from pipelines.archive.job import PlannedJob, draw_steps
from pipelines.difference import difference_in_words
from pipelines.engine.audit import Difference, repeat
from pipelines.engine.store.store import Acceptance
from pipelines.engine.upgrade import Stale, Upgrade, accept, stale_actions, versions
from schemas.base.errors import Fault, one_line


@dataclass
class Trial:
    """What an upgrade does to one kind of step."""

    upgrade: Upgrade
    changes: list[str]
    """What differs between the two versions, a line each."""
    stale: list[str]
    """Keys of the actions that would run again."""
    sample: list[str]
    """Keys of those that were."""
    differences: list[tuple[Difference, str]] = field(default_factory=list)
    """Those of the sample that came to another result, and how far it is from the recorded one."""
    problems: list[str] = field(default_factory=list)
    """Those that could not be computed, a line each."""

    @property
    def agrees(self) -> bool:
        """Whether the whole sample came to what is recorded."""
        return not self.differences and not self.problems


def try_upgrade(planned: PlannedJob, size: int, seed: int) -> list[Trial]:
    """Compute `size` stale actions of each kind of step again, or all where there are fewer."""
    trials: dict[Upgrade, Trial] = {}
    for key, stale in _every_stale(planned):
        if stale.upgrade not in trials:
            trials[stale.upgrade] = Trial(stale.upgrade, versions(stale, planned.workspace.store), [], [])
        trials[stale.upgrade].stale.append(key)
    for trial in trials.values():
        trial.sample = random.Random(seed).sample(sorted(trial.stale), min(size, len(trial.stale)))
    chosen = {key for trial in trials.values() for key in trial.sample}
    with ThreadPoolExecutor(planned.job.threads) as pool:
        waiting = [
            (stale, pool.submit(repeat, stale.action, planned.workspace.store))
            for key, stale in _every_stale(planned)
            if key in chosen
        ]
        for stale, ended in waiting:
            trial = trials[stale.upgrade]
            try:
                difference = ended.result()
            except Fault as error:
                trial.problems.append(str(error))
            except Exception as error:  # a defect under the new version, in one step, must not hide the others
                trial.problems.append(one_line(f"{stale.action.step.name}: {type(error).__name__}: {error}"))
            else:
                if difference is not None:
                    trial.differences.append((difference, _words(difference, planned)))
    return list(trials.values())


def accept_upgrade(planned: PlannedJob, trials: Sequence[Trial], reason: str) -> int:
    """Keep the results of all kinds of steps whose sample agreed; returns how many.

    Results that follow from a kind that did not agree are not kept.
    """
    tried = {key: trial for trial in trials for key in trial.stale}
    refused = {trial.upgrade for trial in trials if not trial.agrees}
    date = datetime.now(UTC).isoformat(timespec="seconds")
    count = 0
    with planned.workspace.lease():
        for key, stale in _every_stale(planned, refused):
            trial = tried.get(key)
            if trial is None:  # it became stale after the sample was drawn
                continue
            acceptance = Acceptance(stale.upgrade.old, trial.changes, len(trial.sample), len(trial.stale), date, reason)
            accept(stale, acceptance, planned.workspace.store)
            count += 1
    return count


def _every_stale(planned: PlannedJob, refused: Collection[Upgrade] = ()) -> Iterator[tuple[str, Stale]]:
    """The stale actions of all scans, one scan at a time, each once."""
    seen: set[str] = set()
    for scan in planned.scans:
        stale = stale_actions(draw_steps(scan.scan, planned), planned.workspace.store, refused)
        yield from ((key, stale[key]) for key in stale if key not in seen)
        seen |= stale.keys()


def _words(difference: Difference, planned: PlannedJob) -> str:
    """How far the results are apart; of a failure both are named already."""
    if difference.result is None:
        return ""
    try:
        old = planned.workspace.store.get(difference.recorded)
    except ValueError:  # the recorded outcome is a failure
        return ""
    return "" if old is None else difference_in_words(old, difference.result)

"""A part of an archive: which scans a run takes, how far it goes, and which steps it runs in any case."""

import datetime
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from footscan.recordings.scans import RecordedScan
from pipelines.engine.actions.step import Step, is_named, steps_to
from schemas.base.errors import RefusedInput
from schemas.profile import first_day


@dataclass(frozen=True)
class Selection:
    """A part of an archive, and of the graph of each scan."""

    only: tuple[str, ...] = ()
    """Patterns of `patient/scan`, of which one must match; without any, all scans are taken. `P0042` is `P0042/*`."""
    since: datetime.date | None = None
    """First day of the scans that are taken; a scan without a day is left out."""
    until: str | None = None
    """Step after which a run ends, as `is_named` takes it."""
    force: tuple[str, ...] = ()
    """Steps that run even if the cache has their results, likewise."""

    @property
    def names_steps(self) -> bool:
        """True if `until` or `force` names a step."""
        return self.until is not None or bool(self.force)

    def takes(self, scan: RecordedScan) -> bool:
        """Return True if the scan is taken."""
        day = scan.document.day
        return self.matches(scan.name) and (self.since is None or (day is not None and day >= self.since))

    def takes_unreadable(self, folder: Path) -> bool:
        """Return True if a scan whose scan.yaml cannot be read may be meant, by the names of its folders."""
        return self.matches("/".join(folder.parts[-2:]))

    def matches(self, name: str) -> bool:
        """Return True if a scan of this name, `patient/scan`, is taken for it.

        >>> [Selection(only=("P0042", "*/2026-*")).matches(name) for name in ("P0042/S1", "P1/2026-L", "P00421/S1")]
        [True, True, False]
        """
        return not self.only or any(_matches(name, pattern) for pattern in self.only)

    def part_of(self, steps: Sequence[Step]) -> list[Step]:
        """The steps of one scan that are taken: all, or those up to `until` and what they need."""
        if self.until is None:
            return list(steps)
        return steps_to(steps, [step.name for step in steps if is_named(step, self.until)])

    def check_steps(self, known: Collection[str], taken: Collection[str]) -> None:
        """Refuse a name of a step that is in no graph, or that a run does not reach.

        `known` holds the names of all steps, of kinds and with cameras, `taken` those of the steps up to `until`.

        Raises
        ------
        RefusedInput
            There is one.
        """
        for option, names in (("--until", [self.until] if self.until else []), ("--force", self.force)):
            for name in names:
                if name not in known:
                    kinds = ", ".join(sorted(one for one in known if not re.search(r"-\d+$", one)))
                    expected = f"expected one of {kinds}; one camera's as extract-3"
                    raise RefusedInput(option, f"no such step, {expected}, found {name[:80]!r}")
        for name in self.force:
            if name not in taken:
                raise RefusedInput("--force", f"{name} comes after {self.until}, at which --until ends the run")


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern if "/" in pattern else f"{pattern}/*")


def selection_of(only: Sequence[str], since: str | None, until: str | None, force: Sequence[str]) -> Selection:
    """A selection from the options of a command or a profile; ValueError if `since` is neither a date nor days."""
    day = None if since is None else first_day(since, datetime.date.today())
    return Selection(tuple(only), day, until, tuple(force))


def names_of(step: Step) -> tuple[str, str]:
    """The names of a step that `is_named` takes."""
    return step.kind, step.name.rpartition("/")[2]

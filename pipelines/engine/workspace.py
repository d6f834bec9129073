"""A workspace: the store of results with what this machine knows of files, in which graphs are planned and run.

Archives, the demo, the live scanner, nights of a regression and searches for parameters run their graphs here.
"""

import logging
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Self

from pipelines.engine.actions.step import Failure, Outcome, Step
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.plan import Plan, make_plan
from pipelines.engine.pool import OnStepEnd, Pool
from pipelines.engine.run import run_plan
from pipelines.engine.store.lease import lease
from pipelines.engine.store.store import Store, open_store
from schemas.base.errors import Fault

log = logging.getLogger("footscan.store")


class Workspace:
    """A store, and the digests of the files that steps read.

    Parameters
    ----------
    cache : Path or str
        Folder of the store, or its URL as fsspec has it.
    local : Path, optional
        Folder for what this machine remembers; default: `cache`, which is a folder then.

    Raises
    ------
    RefusedInput
        No store can lie there, or its secret cannot be read.
    """

    def __init__(self, cache: Path | str, local: Path | None = None) -> None:
        self.local = local or Path(cache)
        self.store: Store = open_store(cache, self.local / "known.sqlite")
        self.digests = FileDigests.load(self.local / "files.json", self.store.secret)

    def plan(self, steps: Sequence[Step]) -> Plan:
        """Which steps would run, and why."""
        return make_plan(steps, self.store)

    def run(self, steps: Sequence[Step], pool: Pool, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """Run steps: the outcome of each by its name.

        A damaged result has been set aside by the run that notices it, and is made again by a further run.
        """
        known: set[str] = set()
        while True:  # there may be more damage behind what was damaged
            outcomes = run_plan(self.plan(steps), self.store, pool=pool, on_step_end=on_step_end)
            damaged = {one.problem for one in outcomes.values() if isinstance(one, Failure) and one.kind == "damaged"}
            if not damaged - known:
                return outcomes
            for problem in sorted(damaged - known):
                log.warning("%s", problem)
            known |= damaged

    def lease(self) -> AbstractContextManager[str]:
        """Keeps others from deleting results while it is held."""
        return lease(self.store)

    def deliver(self, blobs: Mapping[str, str], folder: Path) -> str | None:
        """Write each blob under its file name into `folder`, where another file or none is there.

        Parameters
        ----------
        blobs : mapping of str to str
            Digests by file name.

        Returns
        -------
        problem : str or None
            Why it could not be done for one of them, in one line.
        """
        problem = None
        for name, digest in blobs.items():
            target = folder / name
            if target.is_file() and self.digests.of(target)[0] == digest:
                continue
            data = self.store.get(digest)
            if data is None:
                problem = f"{target}: its content is damaged in the store; run again to make it anew"
                continue  # so that all damage is noticed at once
            try:
                write_atomically(target, data)
            except Fault as error:
                return str(error)
        return problem

    def close(self) -> None:
        """Save what is known of files, and close the index of what was verified."""
        self.digests.save()
        if self.store.verified is not None:
            self.store.verified.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def digests_by_kind(steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> dict[str, str]:
    """What each of `steps` came to, by its kind; Fault where one failed."""
    digests: dict[str, str] = {}
    for step in steps:
        outcome = outcomes[step.name]
        if isinstance(outcome, Failure):
            raise Fault(f"{step.name}: {outcome.problem}")
        digests[step.kind] = outcome.digest
    return digests

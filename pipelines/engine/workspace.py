"""A workspace in which graphs are planned and run: the store of results and this machine's digests of files.

Archives, the demo, the live scanner, regression runs and parameter searches run their graphs here.
"""

import logging
from collections.abc import Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Self

from pipelines.engine.actions.step import Failure, Outcome, Step
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.files.packs import MANY
from pipelines.engine.history import History
from pipelines.engine.plan import Plan, make_plan
from pipelines.engine.pool import OnStepEnd, Pool, StepEnd
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
        Folder of the store, or its URL in the form of fsspec.
    local : Path, optional
        Folder for the memory of this machine; default: `cache`, which must be a folder then.

    Raises
    ------
    RefusedInput
        `cache` is not a valid place for a store, or the secret of the store cannot be read.
    """

    def __init__(self, cache: Path | str, local: Path | None = None) -> None:
        self.local = local or Path(cache)
        self.store: Store = open_store(cache, self.local / "known.sqlite")
        self.digests = FileDigests.load(self.local / "files.json", self.store.secret)
        self.history = History.load(self.local / "history.json")

    @property
    def frames(self) -> Path:
        """Folder for the frames of scans whose own folders cannot be written."""
        return self.local / "frames"

    def plan(self, steps: Sequence[Step], forced: Collection[str] = ()) -> Plan:
        """Plan which steps would run, and why; `forced` as in `make_plan`."""
        return make_plan(steps, self.store, forced)

    def run(
        self, steps: Sequence[Step], pool: Pool, on_step_end: OnStepEnd, forced: Collection[str] = ()
    ) -> dict[str, Outcome]:
        """Run steps; returns the outcome of each by its name. `forced` as in `make_plan`.

        A run removes a damaged result when it notices it; a further run makes that result again.
        """
        reported: set[str] = set()
        ran = 0

        def on_end(end: StepEnd) -> None:
            nonlocal ran
            ran += end.ran
            self.history.add(end)
            if end.ran and ran % MANY == 0:
                self._pack()
            on_step_end(end)

        while True:  # steps after a damaged result may find more damage
            outcomes = run_plan(self.plan(steps, forced), self.store, pool=pool, on_step_end=on_end)
            forced = ()  # they have run
            failures = [outcome for outcome in outcomes.values() if isinstance(outcome, Failure)]
            damaged = {failure.problem for failure in failures if failure.kind == "damaged"}
            if not damaged - reported:
                if ran:
                    self._pack()
                return outcomes
            for problem in sorted(damaged - reported):
                log.warning("%s", problem)
            reported |= damaged

    def _pack(self) -> None:
        """Pack the small files of the store if they are many."""
        try:
            if names := self.store.files.many_by_themselves():
                with lease(self.store):
                    self.store.files.pack(names)
        except (Fault, OSError) as error:  # they stay as they are, and the next run tries again
            log.debug("%s", error)

    def lease(self) -> AbstractContextManager[str]:
        """Hold a lease: others do not delete results while it is held."""
        return lease(self.store)

    def deliver(self, blobs: Mapping[str, str], folder: Path) -> str | None:
        """Write each blob under its file name into `folder`, unless the same file is there already.

        Parameters
        ----------
        blobs : mapping of str to str
            Digests by file name.

        Returns
        -------
        problem : str or None
            Reason why a file could not be delivered, in one line.
        """
        problem = None
        for name, digest in blobs.items():
            target = folder / name
            if target.is_file() and self.digests.of(target)[0] == digest:
                continue
            data = self.store.get(digest)
            if data is None:
                problem = f"{target}: its content is damaged in the store; run again to make it anew"
                continue  # checks the other files too, so that one further run repairs all
            try:
                write_atomically(target, data)
            except Fault as error:
                return str(error)
        return problem

    def close(self) -> None:
        """Save the digests of files and the history, and close the index of verified results."""
        self.digests.save()
        self.history.save()
        if self.store.verified is not None:
            self.store.verified.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def digests_by_kind(steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> dict[str, str]:
    """Digest of the result of each of `steps`, by its kind; Fault if one failed."""
    digests: dict[str, str] = {}
    for step in steps:
        outcome = outcomes[step.name]
        if isinstance(outcome, Failure):
            raise Fault(f"{step.name}: {outcome.problem}")
        digests[step.kind] = outcome.digest
    return digests

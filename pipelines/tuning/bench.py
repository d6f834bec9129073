"""Scans with trial parameters: the steps that lead to their figures, run through the cache of the engine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from footscan.recordings.scans import RecordedScan
from pipelines.archive.planning import PlannedJob, draw_steps
from pipelines.archive.running import WINDOW
from pipelines.engine.actions.step import Failure, Outcome, Output, Step, Success
from pipelines.engine.pool import OnStepEnd, Pool, StepEnd
from pipelines.scan import source_files
from pipelines.tuning.clock import Clock
from pipelines.tuning.objectives import Judged, figures_of, lengths_of
from schemas.base.errors import Fault, RefusedInput
from schemas.measures import Measures
from schemas.parameters.scan import ScanParameters
from schemas.quality import Quality

OWN = "tune/"
"""Prefix of the names of the steps, so that a trial does not count as the last run of a scan."""
OF_TRUTH = {"completeness", "false_points"}
"""Objectives that need the step `judge`."""


@dataclass(frozen=True)
class Bench:
    """The means by which sets of parameters are tried."""

    planned: PlannedJob
    pool: Pool
    on_step_end: OnStepEnd
    goals: frozenset[str]
    """Names of the objectives; only steps that they need are run."""
    clock: Clock

    def judge(
        self, parameters: ScanParameters, scans: Sequence[RecordedScan]
    ) -> tuple[dict[str, Judged], dict[str, float]]:
        """Judge scans with these parameters.

        Returns
        -------
        judged : dict
            Figures or problem of each scan, by its name.
        seconds : dict
            Times of the steps that were run, by the key of their action.

        Raises
        ------
        Fault
            All scans failed by a fault of the machine.
        """
        judged: dict[str, Judged] = {}
        seconds: dict[str, float] = {}
        at_once = WINDOW * self.pool.count
        for first in range(0, len(scans), at_once):
            batch, batch_seconds = self._judge_together(parameters, scans[first : first + at_once])
            judged |= batch
            seconds |= batch_seconds
        faults = [scan.problem for scan in judged.values() if scan.kind == "fault"]
        if faults and len(faults) == len(judged):
            raise Fault(str(faults[0]))
        return judged, seconds

    def results(self, parameters: ScanParameters, scan: RecordedScan) -> dict[str, bytes]:
        """Results of the steps of a scan up to the filter of outliers, by kind and camera (`extract-1`).

        Steps that failed are left out.
        """
        steps = self._steps(parameters, scan, {"clean"})
        outcomes = self._run(steps)
        results = {step.name.rpartition("/")[2]: self._read(step.name, outcomes) for step in steps}
        return {name: result for name, result in results.items() if result is not None}

    def _judge_together(
        self, parameters: ScanParameters, scans: Sequence[RecordedScan]
    ) -> tuple[dict[str, Judged], dict[str, float]]:
        kinds = {"quality"} | ({"judge"} if self.goals & OF_TRUTH else set())
        kinds |= {"measure"} if "repeatability" in self.goals else set()
        judged: dict[str, Judged] = {}
        steps: dict[str, list[Step]] = {}
        for scan in scans:
            try:
                steps[scan.name] = self._steps(parameters, scan, kinds)
            except RefusedInput as error:
                judged[scan.name] = Judged(problem=str(error), kind="refused")
        together = [step for of_scan in steps.values() for step in of_scan]
        outcomes = self._run(together)
        seconds = self.clock.note(together, outcomes)
        judged |= {name: self._judged(name, of_scan, outcomes) for name, of_scan in steps.items()}
        return judged, seconds

    def _steps(self, parameters: ScanParameters, scan: RecordedScan, kinds: set[str]) -> list[Step]:
        """The steps of a scan that lead to those of `kinds`, with the prefix `OWN`."""
        job = replace(self.planned.job, parameters=parameters)
        steps = draw_steps(scan, replace(self.planned, job=job))
        if scan.truth is not None:
            truth = source_files(scan.truth, self.planned.workspace.digests)
            computed = {"oriented": Output(f"{scan.name}/orient"), "surface": Output(f"{scan.name}/surface")}
            places = {"truth": scan.truth}
            steps.append(
                Step(scan.name, "judge", "pipelines.tuning.judge", None, {**computed, "truth": truth}, places=places)
            )
        return _leading_to(kinds, steps)

    def _run(self, steps: Sequence[Step]) -> dict[str, Outcome]:
        def on_step_end(end: StepEnd) -> None:
            self.clock.on_step_end(end)
            self.on_step_end(end)

        return self.planned.workspace.run(steps, self.pool, on_step_end)

    def _judged(self, scan: str, steps: Sequence[Step], outcomes: Mapping[str, Outcome]) -> Judged:
        for step in steps:
            if isinstance(outcome := outcomes[step.name], Failure):
                return Judged(problem=outcome.problem, kind="fault" if outcome.kind == "damaged" else outcome.kind)
        quality, shares, measures = (
            self._read(f"{OWN}{scan}/{kind}", outcomes) for kind in ("quality", "judge", "measure")
        )
        if quality is None:
            return Judged(problem=f"{scan}: the stored quality is damaged, run again to compute it anew", kind="fault")
        figures = figures_of(Quality.model_validate_json(quality), shares)
        if "time" in self.goals:
            figures["time"] = self.clock.of(steps, outcomes, self.planned.workspace.store)
        return Judged(figures, {} if measures is None else lengths_of(Measures.model_validate_json(measures)))

    def _read(self, step: str, outcomes: Mapping[str, Outcome]) -> bytes | None:
        """The result of a step; None if it has none, or the step does not exist."""
        outcome = outcomes.get(step)
        return self.planned.workspace.store.get(outcome.digest) if isinstance(outcome, Success) else None


def _leading_to(kinds: set[str], steps: Sequence[Step]) -> list[Step]:
    """The steps that the results of `kinds` depend on, with the prefix `OWN`."""
    needed: set[str] = set()
    leading: list[Step] = []
    for step in reversed(steps):
        if step.kind not in kinds and step.name not in needed:
            continue
        before = {source.step for source in step.inputs.values() if isinstance(source, Output)}
        needed |= before
        inputs = {
            name: Output(OWN + source.step) if isinstance(source, Output) else source
            for name, source in step.inputs.items()
        }
        leading.append(step._replace(scan=OWN + step.scan, inputs=inputs))
    return leading[::-1]

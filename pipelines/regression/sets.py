"""Data sets of a suite as jobs of the engine; virtual sets are filmed and calibrated first."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from footscan.recordings.scans import SCAN_FILE
from pipelines.archive.job import Job
from pipelines.engine.actions.step import Outcome, Step
from pipelines.engine.files.digest import sha256
from pipelines.engine.pool import OnStepEnd, Threads, cores
from pipelines.engine.workspace import Workspace, digests_by_kind
from pipelines.recordings.calibration_choice import CalibrationPlace
from pipelines.regression.film import PATIENT
from pipelines.simulate import filmed_calibration_steps
from schemas.base.errors import Fault, RefusedInput
from schemas.base.json_files import validate
from schemas.base.model import canonical_json
from schemas.parameters.presets import overlaid, preset_sections
from schemas.parameters.scan import ScanParameters
from schemas.parameters.simulation import SimulationSettings
from schemas.parameters.virtual_scan import VirtualScan
from schemas.regression import Suite

OF_A_RECORDING = SimulationSettings().model_dump(include={"seed", "start_mm", "step_mm", "frames", "ambient"})
"""Settings of a single recording, at their defaults: a scanner is calibrated once, in ordinary light."""


@dataclass(frozen=True)
class PreparedSet:
    """A data set that is ready to run."""

    name: str
    job: Job
    truths: Mapping[str, float] = field(default_factory=dict)
    """True measures of the foot, mm, by name, as far as they are known."""
    filming: Sequence[Step] = ()
    """The steps that filmed it."""
    outcomes: Mapping[str, Outcome] = field(default_factory=dict)
    """Outcomes of these steps, by name."""


def prepare(name: str, suite: Suite, base: Path, out: Path, on_step_end: OnStepEnd) -> PreparedSet:
    """Prepare the data set `name` of a suite.

    Parameters
    ----------
    base : folder that the suite's paths are relative to
    out : folder of films, cache and results

    Raises
    ------
    Fault
        The set could not be filmed.
    """
    data_set = suite.sets[name]
    parameters = parameters_of(name, suite)
    if data_set.virtual is not None:
        return _virtual(name, data_set.virtual, parameters, out, on_step_end)
    assert data_set.scan is not None, "the suite was checked for it"
    calibration = None if data_set.calibration is None else base / data_set.calibration
    return PreparedSet(name, _job(name, base / data_set.scan, calibration, parameters, out))


def parameters_of(name: str, suite: Suite) -> ScanParameters:
    """The parameters of the suite, overridden by those of the set; RefusedInput if they break a model."""
    data_set = suite.sets[name]
    below = {} if data_set.preset is None else preset_sections(data_set.preset)
    values = overlaid(overlaid(suite.parameters.model_dump(mode="json"), below), data_set.parameters)
    try:
        return validate("parameters", ScanParameters, values)
    except RefusedInput as error:
        raise RefusedInput(f"sets.{name}.parameters", error.problem, field=error.field) from None


def workspace_of(out: Path) -> Workspace:
    """The workspace in which all sets of a suite run, with their cache."""
    return Workspace(out / "cache")


def _virtual(
    name: str, virtual: VirtualScan, parameters: ScanParameters, out: Path, on_step_end: OnStepEnd
) -> PreparedSet:
    films = out / "films"
    scan = films / PATIENT / name
    scanner_settings = virtual.settings.model_copy(update=OF_A_RECORDING)
    capture = films / "captures" / sha256(canonical_json(scanner_settings.model_dump(mode="json")).encode())[:12]
    film = Step(
        name, "film", "pipelines.regression.film", virtual, places={"folder": scan}, writes=scan / SCAN_FILE
    )  # fmt: skip
    filming = [film, *filmed_calibration_steps(name, capture, scanner_settings)]
    with workspace_of(out) as workspace:
        outcomes = workspace.run(filming, Threads(1), on_step_end)
        digests = digests_by_kind(filming, outcomes)
        calibration = films / "calibrations" / name / "calibration.json"
        if problem := workspace.deliver({calibration.name: digests["calibrate"]}, calibration.parent):
            raise Fault(problem)
        filmed = json.loads(workspace.store.get(digests["film"]) or b"{}")
    job = _job(name, scan, calibration, parameters, out)
    return PreparedSet(name, job, filmed.get("known", {}), filming, outcomes)


def _job(name: str, folder: Path, calibration: Path | None, parameters: ScanParameters, out: Path) -> Job:
    return Job(
        folders=[folder],
        archives=(),
        calibrations=() if calibration is None else (CalibrationPlace(calibration),),
        calibration_wins=True,
        results=out / "results" / name,
        cache=out / "cache",
        parameters=parameters,
        threads=cores(),
    )

"""Jobs: scans to reconstruct, of an archive or a single one, with all that their steps need to know."""

from dataclasses import dataclass, field
from pathlib import Path

from footscan.recordings.scans import RecordedScan, scan_folders
from pipelines.archive.selection import Selection, selection_of
from pipelines.archive.workflow_file import check_archives, is_url, read_workflow
from pipelines.engine.files.access import group_number
from pipelines.engine.files.places import open_files
from pipelines.engine.pool import cores
from pipelines.recordings.calibration_choice import CalibrationPlace, calibration_places
from pipelines.recordings.fetched import FetchedArchive
from pipelines.scan import ORDINARY, Wanted
from schemas.base.errors import RefusedInput
from schemas.parameters.presets import overlaid
from schemas.parameters.scan import ScanParameters
from schemas.profile import Profile
from schemas.workflow import Workflow

CACHE = ".footscan"
"""Name of the store in the results folder, unless the workflow names another place."""


@dataclass(frozen=True)
class Job:
    """Scans to reconstruct, with calibrations, parameters, results folder and store."""

    folders: list[Path]
    archives: tuple[Path, ...]
    """Folders that the paths in their scans may not leave; for other scans that is the folder two levels above."""
    calibrations: tuple[CalibrationPlace, ...]
    """Calibrations for scans without their own."""
    calibration_wins: bool
    """True if `calibrations` replace the scans' own calibrations as well."""
    results: Path
    cache: Path | str
    """Folder of the store, or its URL."""
    parameters: ScanParameters
    threads: int
    """Number of steps that run at once in the default pool."""
    group: int | None = None
    """Number of the group that may access the written files as well as their owner."""
    fetched: tuple[FetchedArchive, ...] = ()
    """Those of the archives that are in an object store."""
    wanted: Wanted = ORDINARY
    """What is made of each scan beyond its results."""
    selection: Selection = field(default_factory=Selection)
    """The scans and steps that are meant."""
    fail_fast: bool = False
    """True if the first failed scan ends the run. No further step starts then; what is complete is delivered."""

    def fetch(self, scan: RecordedScan) -> None:
        """Fetch the films of a scan whose archive is in an object store; Fault if that fails."""
        for archive in self.fetched:
            if scan.folder.is_relative_to(archive.folder.resolve()):
                archive.fetch_films(scan)

    def archive_of(self, folder: Path) -> Path | None:
        """Return the archive that contains a scan; None without one."""
        return next((archive for archive in self.archives if folder.is_relative_to(archive)), None)


def job_of_workflow(
    path: Path, threads: int | None = None, profile: str | None = None, *, may_be_empty: bool = False
) -> Job:
    """Read the job from a workflow.yaml, with the options of one of its profiles.

    Raises
    ------
    RefusedInput
        The file breaks its format, an archive is missing, all archives are empty and `may_be_empty` is not set, or the
        place of the store is not valid, or the workflow has no such profile.
    """
    workflow = read_workflow(path)
    check_archives(path, workflow)
    options = profile_of(path, workflow, profile)
    base = path.resolve().parent
    results = base / workflow.results
    fetched = tuple(FetchedArchive(place, results / CACHE) for place in workflow.archive if is_url(place))
    for one in fetched:
        one.fetch_documents()
    archives = (*(base / place for place in workflow.archive if not is_url(place)), *(one.folder for one in fetched))
    folders = [folder for archive in archives for folder in scan_folders(archive)]
    if not folders and not may_be_empty:
        below = ", ".join(map(str, archives))
        raise RefusedInput(path, f"expected folders with a scan.yaml below {below}, found none", field="archive")
    return Job(
        folders=folders,
        archives=archives,
        fetched=fetched,
        calibrations=calibration_places(workflow, base),
        calibration_wins=False,
        results=results,
        cache=_cache(path, workflow.cache) or results / CACHE,
        parameters=overlaid_parameters(workflow.parameters, options.parameters),
        threads=threads or options.workers or workflow.workers or cores(),
        group=None if workflow.group is None else group_number(workflow.group, path),
        wanted=Wanted(tuple(workflow.exports), None if workflow.size_table is None else base / workflow.size_table),
        selection=selection_of(options.only, options.since, options.until, options.force),
        fail_fast=options.fail_fast,
    )


def job_of_scan(folder: Path, calibration: Path | None, results: Path, threads: int | None = None) -> Job:
    """Make the job of one scan without a workflow; RefusedInput if `results` is a file."""
    if results.exists() and not results.is_dir():
        raise RefusedInput(results, "is a file, expected a folder for the results")
    return Job(
        folders=[folder],
        archives=(),
        calibrations=() if calibration is None else (CalibrationPlace(calibration),),
        calibration_wins=True,
        results=results,
        cache=results / CACHE,
        parameters=ScanParameters(),
        threads=threads or cores(),
    )


def profile_of(path: Path, workflow: Workflow, name: str | None) -> Profile:
    """A profile of the workflow in `path`; without a name one that changes nothing.

    Raises
    ------
    RefusedInput
        The workflow has no profile of this name.
    """
    if name is None:
        return Profile()
    if name not in workflow.profiles:
        listed = ", ".join(workflow.profiles) or "none"
        problem = f"no profile {name[:40]!r}, expected one of {listed}; a page that --profile writes ends with .html"
        raise RefusedInput(path, problem, field="profiles")
    return workflow.profiles[name]


def overlaid_parameters(below: ScanParameters, above: ScanParameters) -> ScanParameters:
    """Those of a workflow, with those in their place that a profile sets."""
    if not above.model_fields_set:
        return below
    values = overlaid(below.model_dump(mode="json"), above.model_dump(mode="json", exclude_unset=True))
    return ScanParameters.model_validate(values)


def _cache(workflow: Path, place: str | None) -> Path | str | None:
    """Place of the store that a workflow names. A URL is opened here, so that a wrong one is reported only once."""
    if place is None or not is_url(place):
        return None if place is None else workflow.resolve().parent / place
    try:
        open_files(place)
    except RefusedInput as error:
        raise RefusedInput(workflow, f"{place}: {error.problem}", field="cache") from None
    return place

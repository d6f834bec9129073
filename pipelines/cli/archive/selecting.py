"""Options that say which scans and steps of a workflow are meant, with which parameters."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.archive.job import Job

WORKFLOW = Path("workflow.yaml")

WorkflowFile = Annotated[
    Path | None, typer.Argument(help="The workflow; default: workflow.yaml.", metavar="[WORKFLOW]")
]
Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only", metavar="PATTERN", help="Take scans whose patient/scan matches, such as 'P0042/*'; may be repeated."
    ),
]
Since = Annotated[
    str | None,
    typer.Option("--since", metavar="DATE", help="Take scans from this day on (2026-11-02), or of the last days (7d)."),
]
Until = Annotated[str | None, typer.Option("--until", metavar="STEP", help="End after this step, such as surface.")]
Force = Annotated[
    list[str] | None,
    typer.Option("--force", metavar="STEP", help="Run this step even if its result is known; may be repeated."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, for example extraction.red_threshold=22, or preset=thesis; may be repeated.",
    ),
]
ProfileName = Annotated[
    str | None, typer.Option("--profile", metavar="NAME", help="Take the options of this profile of the workflow.")
]


@dataclass(frozen=True)
class Chosen:
    """Values of these options; those of a profile count where an option is not given."""

    only: list[str] | None = None
    since: str | None = None
    until: str | None = None
    force: list[str] | None = None
    settings: list[str] | None = None
    profile: str | None = None

    def job(self, workflow: Path | None, threads: int | None = None, *, may_be_empty: bool = False) -> "Job":
        """The job of a workflow, with what these options say."""
        from pipelines.archive.job import job_of_workflow

        read = job_of_workflow(workflow or WORKFLOW, threads, self.profile, may_be_empty=may_be_empty)
        return self.applied(read)

    def applied(self, job: "Job") -> "Job":
        """`job` with what these options say, apart from the profile."""
        from pipelines.archive.selection import selection_of
        from pipelines.archive.settings import changed_parameters

        try:
            given = selection_of(self.only or (), self.since, self.until, self.force or ())
        except ValueError as error:
            raise RefusedInput("--since", f"{error}, found {str(self.since)[:40]!r}") from None
        own = job.selection
        selection = replace(
            own,
            only=given.only or own.only,
            since=given.since or own.since,
            until=given.until or own.until,
            force=given.force or own.force,
        )
        parameters = changed_parameters(job.parameters, self.settings) if self.settings else job.parameters
        return replace(job, selection=selection, parameters=parameters)

    def of_scan(self, folder: Path, calibration: Path | None, out: Path, threads: int | None = None) -> "Job":
        """The job of one scan folder without a workflow."""
        from pipelines.archive.job import job_of_scan

        for option, given in (("--only", self.only), ("--since", self.since), ("--profile", self.profile)):
            if given is not None:
                raise RefusedInput(option, "goes with a workflow, not with a single scan folder")
        return self.applied(job_of_scan(folder, calibration, out, threads))

"""What `run` and `plan` print of a planned job."""

import math
from typing import TYPE_CHECKING

from pipelines.cli.terminal.output import message

if TYPE_CHECKING:
    from pipelines.archive.planning import PlannedJob


def print_failure(scan: str, problem: str) -> None:
    """Print one line for a failed scan; most problems name a file of the scan and thereby the scan."""
    message(f"footscan: {problem}" if scan in problem else f"footscan: {scan}: {problem}")


def steps_to_run(planned: "PlannedJob") -> str:
    """`12 of 34 steps to run`."""
    return f"{planned.to_run} of {planned.steps} steps to run"


def print_left_out(planned: "PlannedJob") -> None:
    """Print how many scans have no day, which `--since` leaves out."""
    selection = planned.job.selection
    if not planned.scans and not planned.refused and planned.left_out:
        message(f"no scan is taken: {len(planned.left_out)} are left out by --only, --since or the profile")
    undated = [s for s in planned.left_out if s.document.day is None and selection.matches(s.name)]
    if selection.since is not None and undated:
        message(
            f"{len(undated)} scans have no date and are left out, {undated[0].name} for example: see date in scan.yaml"
        )


def duration(seconds: float) -> str:
    """A duration for a person.

    >>> duration(8.2), duration(194), duration(7460)
    ('9 s', '4 min', '2 h 5 min')
    """
    if seconds <= 90:
        return f"{math.ceil(seconds)} s"
    minutes = math.ceil(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"

"""`footscan demo`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.foot.measure import print_measures
from pipelines.cli.terminal.compiling import compile_loops
from pipelines.cli.terminal.output import message, note, print_line, print_table

if TYPE_CHECKING:
    from pipelines.engine.pool import OnStepEnd


def demo(
    folder: Annotated[Path, typer.Option(help="Folder for all files of the demo.")] = Path("demo"),
    side: Annotated[Literal["right", "left"], typer.Option(help="Which foot.")] = "right",
    light: Annotated[Literal["dark", "ambient", "bright"], typer.Option(help="Light in the room.")] = "ambient",
) -> None:
    """Film a virtual foot, calibrate, reconstruct and measure it, and compare the result with the truth."""
    from footscan.ahead_of_time import SCAN, VIRTUAL
    from pipelines.demo import run_demo
    from schemas.measures import Measures
    from schemas.parameters.demo import FilmedFoot
    from schemas.parameters.simulation import SimulationSettings
    from schemas.quality import Quality

    foot = FilmedFoot(scan=f"demo-{side[0].upper()}", side=side, settings=SimulationSettings(ambient=light))
    compile_loops(SCAN, VIRTUAL)
    result = run_demo(folder, foot, watch)

    for part, seconds in result.seconds.items():
        note(f"{part}: {seconds:.1f} s")
    measures = Measures.model_validate_json((result.results / "measures.json").read_bytes())
    print_measures(measures, result.true_measures)
    quality = Quality.model_validate_json((result.results / "quality.json").read_bytes())
    for warning in quality.scan_warnings or ():
        message(f"Warning: {warning}")
    if quality.truth is not None:
        figures = quality.truth.model_dump(include={"mean", "p50", "p95", "p99", "max"})
        rows = [[name, f"{value:.3f}"] for name, value in figures.items()]
        print_table("Distance to the true surface", ["figure", "mm"], rows)
    print_line(f"Report: {result.results / 'report.html'}")


@contextmanager
def watch(part: str, to_run: int, steps: int) -> "Iterator[OnStepEnd]":
    """Show the progress of a part; see `pipelines.demo.Watch`."""
    from pipelines.cli.terminal.progress import StepProgress

    note(f"{part}: {to_run} of {steps} steps to run")
    with StepProgress(to_run) as progress:
        yield progress.on_step_end

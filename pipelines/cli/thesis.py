"""`footscan thesis`."""

from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli.demo import watch
from pipelines.cli.terminal.output import AsJson, figure, message, print_json, print_line, print_table
from schemas.base.errors import RefusedInput

FIGURES = ("mean", "std", "p99", "max")


def thesis(
    folder: Annotated[Path, typer.Option(help="Folder for films, results and the page.")] = Path("thesis"),
    worlds: Annotated[
        int, typer.Option(min=0, max=100, help="Number of filmed worlds on which stages are exchanged.")
    ] = 4,
    as_json: AsJson = False,
) -> None:
    """Reproduce the tables of the thesis, and compare its method with footscan on the same films, stage by stage."""
    from footscan.report.thesis.page import stage_rows, thesis_page
    from pipelines.engine.files.atomic import write_atomically
    from pipelines.engine.pool import cores, local_cluster
    from pipelines.thesis import reference_png, run_thesis

    if folder.exists() and not folder.is_dir():
        raise RefusedInput(folder, "is a file, expected a folder for films, results and the page", field="--folder")
    with local_cluster(cores()) as pool:
        result = run_thesis(folder, worlds, pool, watch)
    page, figures = folder / "thesis.html", folder / "thesis.json"
    write_atomically(page, thesis_page(result, reference_png(folder)).encode())
    write_atomically(figures, (result.model_dump_json(indent=2) + "\n").encode())
    if as_json:
        print_json(result.model_dump(mode="json"))
        return
    print_line(f"Table 4-3: {result.agreeing} of {result.coefficients} rows as printed")
    rows = [
        [f"{row.nominal_mm:g}", f"{row.printed_mm:.1f}", *map(figure, row.found_mm.values())] for row in result.block
    ]
    print_table("Table 6-1: the block, mm", ["true", "print", *(foot.method for foot in result.feet)], rows)
    rows = [
        [
            foot.method,
            *(figure(None if foot.comparison is None else getattr(foot.comparison, name)) for name in FIGURES),
        ]
        for foot in result.feet
    ]
    print_table("Table 6-2: the foot, distance to the truth, mm", ["method", *FIGURES], rows)
    if result.stages:
        seeds = list(dict.fromkeys(stage.seed for stage in result.stages))
        print_table(
            "Mean, 99 %, error of the foot length; mm",
            ["method", *(f"world {seed}" for seed in seeds)],
            stage_rows(result.stages),
        )
    for foot in result.feet:
        if foot.problem is not None:
            message(f"foot, method of {foot.method}: {foot.problem}")
    print_line(f"Page: {page}")

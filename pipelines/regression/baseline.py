"""The baseline: the accepted figures in a file that is reviewed as a diff, and beside it the results of the steps.

The results of the steps in the last good night of each set are kept in the folder of the nights.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.regression.figures.of_scan import rounded
from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.regression import Acceptance, AcceptedStep, AcceptedSteps, Baseline

HEAD = (
    "# Accepted results, one figure a line. Written by 'footscan regress --accept REASON'; to be reviewed as a diff.\n"
)
STEPS_HEAD = "# Key and result of each step when the figures beside this file were accepted.\n"
GOOD = "good.steps.yaml"
"""Name of the file in the folder of the nights."""
GOOD_HEAD = "# Key and result of each step in the last night in which nothing of its set was worse.\n"


def read_baseline(path: Path) -> Baseline | None:
    """Read the baseline; None if the file does not exist. RefusedInput if it breaks its format."""
    return read_yaml(path, Baseline) if path.exists() else None


def read_steps(path: Path) -> AcceptedSteps:
    """Read the accepted results of the steps; empty if unknown. RefusedInput if the file breaks its format."""
    file = steps_file(path)
    return read_yaml(file, AcceptedSteps) if file.exists() else AcceptedSteps(sets={})


def read_good_steps(out: Path) -> Mapping[str, Sequence[AcceptedStep]]:
    """Read the results of the steps in the last good night, by set; empty if the file is missing or damaged."""
    try:
        return read_yaml(out / GOOD, AcceptedSteps).sets
    except RefusedInput:
        return {}


def write_good_steps(out: Path, sets: Mapping[str, Sequence[AcceptedStep]]) -> None:
    """Write the file that `read_good_steps` reads; Fault if the disk refuses."""
    write_atomically(out / GOOD, _steps_text(GOOD_HEAD, sets).encode())


def write_baseline(
    path: Path,
    acceptance: Acceptance,
    figures: Mapping[str, Mapping[str, float | None]],
    steps: Mapping[str, Sequence[AcceptedStep]],
) -> Baseline:
    """Accept the figures of a night; earlier reasons are kept behind the new one.

    Errors as in `read_baseline`, and Fault if the disk refuses.
    """
    before = read_baseline(path)
    baseline = Baseline(
        accepted=[acceptance, *(before.accepted if before else [])],
        sets={
            name: {f: rounded(f, value) for f, value in sorted(of_set.items())}
            for name, of_set in sorted(figures.items())
        },
    )
    write_atomically(steps_file(path), _steps_text(STEPS_HEAD, steps).encode())
    write_atomically(path, _baseline_text(baseline).encode())
    return baseline


def forget_sets(path: Path, out: Path, names: set[str]) -> None:
    """Remove sets from the baseline, from the steps beside it, and from those of the last good night.

    Errors as in `write_baseline`.
    """
    baseline = read_baseline(path)
    if baseline is not None and names & set(baseline.sets):
        kept = {name: of_set for name, of_set in baseline.sets.items() if name not in names}
        write_atomically(path, _baseline_text(baseline.model_copy(update={"sets": kept})).encode())
    for file, head, steps in (
        (steps_file(path), STEPS_HEAD, read_steps(path).sets),
        (out / GOOD, GOOD_HEAD, read_good_steps(out)),
    ):
        if names & set(steps):
            kept_steps = {name: of_set for name, of_set in steps.items() if name not in names}
            write_atomically(file, _steps_text(head, kept_steps).encode())


def steps_file(path: Path) -> Path:
    """Path of the file of the steps, beside the file of the figures: `baseline.steps.yaml`."""
    return path.with_suffix(f".steps{path.suffix}")


def _baseline_text(baseline: Baseline) -> str:
    """Write YAML line by line: a YAML library would fold long reasons."""
    lines = [f"format: {baseline.format}", "accepted:"]
    for acceptance in baseline.accepted:
        lines += [
            f"  - reason: {_quoted(acceptance.reason)}",
            f"    date: {acceptance.date.isoformat(timespec='seconds')}",
            f"    by: {_quoted(acceptance.by)}",
            f"    software: {_quoted(acceptance.software)}",
        ]
    lines.append("sets:" if baseline.sets else "sets: {}")
    for name, figures in baseline.sets.items():
        lines.append(f"  {name}:" + (" {}" if not figures else ""))
        lines += [f"    {figure}: {'null' if value is None else _plain(value)}" for figure, value in figures.items()]
    return HEAD + "\n".join(lines) + "\n"


def _steps_text(head: str, sets: Mapping[str, Sequence[AcceptedStep]]) -> str:
    lines = [f"format: {AcceptedSteps.model_fields['format'].default}", "sets:" if sets else "sets: {}"]
    for name, steps in sorted(sets.items()):
        lines.append(f"  {name}:" + (" []" if not steps else ""))
        lines += [f"    - {{step: {s.step}, key: {_quoted(s.key)}, result: {_quoted(s.result)}}}" for s in steps]
    return head + "\n".join(lines) + "\n"


def _plain(value: float) -> str:
    """Write a number in the shortest form without an exponent."""
    return str(int(value)) if value == int(value) else f"{value:.6f}".rstrip("0")


def _quoted(value: str) -> str:
    """Quote as JSON does; YAML reads it, too."""
    return json.dumps(value, ensure_ascii=False)

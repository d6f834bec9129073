"""The accepted figures: a file to be read by eye and as a diff, and beside it what the steps had come to.

What they came to in the last good night of each set is kept in the folder of the nights.
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
STEPS_HEAD = (
    "# What each step came to when the figures beside this file were accepted: its action's key and its result.\n"
)
GOOD = "good.steps.yaml"
"""In the folder of the nights."""
GOOD_HEAD = "# What each step came to in the last night in which nothing of its set was worse.\n"


def read_baseline(path: Path) -> Baseline | None:
    """The baseline, None where there is none yet; RefusedInput where it breaks its format."""
    return read_yaml(path, Baseline) if path.exists() else None


def read_steps(path: Path) -> AcceptedSteps:
    """What the steps had come to, empty where that is not known; RefusedInput where the file breaks its format."""
    beside = steps_file(path)
    return read_yaml(beside, AcceptedSteps) if beside.exists() else AcceptedSteps(sets={})


def read_good_steps(out: Path) -> Mapping[str, Sequence[AcceptedStep]]:
    """By set, what the steps came to in its last good night; empty where the file is not there or is damaged."""
    try:
        return read_yaml(out / GOOD, AcceptedSteps).sets
    except RefusedInput:
        return {}


def write_good_steps(out: Path, sets: Mapping[str, Sequence[AcceptedStep]]) -> None:
    """Keep what `read_good_steps` reads; Fault where the disk refuses."""
    write_atomically(out / GOOD, _steps_text(GOOD_HEAD, sets).encode())


def write_baseline(
    path: Path,
    acceptance: Acceptance,
    figures: Mapping[str, Mapping[str, float | None]],
    steps: Mapping[str, Sequence[AcceptedStep]],
) -> Baseline:
    """Make a night's figures the accepted ones; earlier reasons are kept behind the new one.

    Errors as in `read_baseline`, and Fault where the disk refuses.
    """
    before = read_baseline(path)
    baseline = Baseline(
        accepted=[acceptance, *(before.accepted if before else [])],
        sets={name: {f: rounded(f, value) for f, value in sorted(of.items())} for name, of in sorted(figures.items())},
    )
    write_atomically(steps_file(path), _steps_text(STEPS_HEAD, steps).encode())
    write_atomically(path, _baseline_text(baseline).encode())
    return baseline


def forget_sets(path: Path, out: Path, names: set[str]) -> None:
    """Take sets out of the baseline, of the steps beside it, and of those of the last good night.

    Errors as in `write_baseline`.
    """
    baseline = read_baseline(path)
    if baseline is not None and names & set(baseline.sets):
        left = {name: of for name, of in baseline.sets.items() if name not in names}
        write_atomically(path, _baseline_text(baseline.model_copy(update={"sets": left})).encode())
    for file, head, steps in (
        (steps_file(path), STEPS_HEAD, read_steps(path).sets),
        (out / GOOD, GOOD_HEAD, read_good_steps(out)),
    ):
        if names & set(steps):
            left_steps = {name: of for name, of in steps.items() if name not in names}
            write_atomically(file, _steps_text(head, left_steps).encode())


def steps_file(path: Path) -> Path:
    """The file of the steps beside that of the figures: `baseline.steps.yaml`."""
    return path.with_suffix(f".steps{path.suffix}")


def _baseline_text(baseline: Baseline) -> str:
    """Written line by line: a dump of YAML would fold long reasons."""
    lines = [f"format: {baseline.format}", "accepted:"]
    for one in baseline.accepted:
        lines += [
            f"  - reason: {_quoted(one.reason)}",
            f"    date: {one.date.isoformat(timespec='seconds')}",
            f"    by: {_quoted(one.by)}",
            f"    software: {_quoted(one.software)}",
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
    """As short as it can be, without an exponent."""
    return str(int(value)) if value == int(value) else f"{value:.6f}".rstrip("0")


def _quoted(value: str) -> str:
    """As JSON has it, which YAML takes, too."""
    return json.dumps(value, ensure_ascii=False)

"""Argument lines drawn from the grammar of the command: sub-commands, their arguments and options, hostile values."""

from random import Random
from typing import Any, get_args

import typer.main

from pipelines.cli.main import app

LIVE = {"run", "console", "scan", "home", "jog", "devices", "demo", "simulate", "regress", "tune", "capture", "latency"}
"""They move heads, serve pages, or compute for minutes, as `run` does where `plan` takes the same options."""
NEVER = {"--watch", "--cluster", "--workers", "--install-completion", "--show-completion"}
FILES = (
    *("solid.stl", "solid.ply", "solid.obj", "chart.csv", "lasts.csv", "pixels.csv", "left.json", "right.json"),
    *("calibration.json", "workflow.yaml", "sizes.yaml", "frame.png", "frame.jpg", "out", "new.csv", "archive"),
    *("archive/P0001", "archive/P0001/S1", "archive/P0001/S1/cam1.avi", "archive/P0001/S1/frames.zarr/cam1"),
)
VALUES = (
    *("", " ", ".", "..", "/", "-", "--", "a\0b", "\n", "x" * 300, "é\u202e", "\udcff", "\x1b[31m", "[red]", "{0}"),
    *("0", "-1", "1", "2", "5", "9" * 30, "1e308", "nan", "inf", "-inf", "0x10", "1_0", "1,5", "true", "all", "women"),
    *("no/such/file.stl", "missing.json", "/dev/null", "/dev/zero", "/proc/self/mem", "/etc", "~", "*", "s3://x/y"),
    *("extraction.red_threshold=22", "extraction.red_threshold=nan", "surface.method=", "=", "a.b.c=1", "150x100x50"),
    *("1x2", "nanxinfx1", "P0001", "P0001/S1", "2026-11-20", "auto", "quadratic", "homography", "mm", "m", "left"),
)


def draw_line(random: Random) -> list[str]:
    """One argument line; about half of what it names is there."""
    names, command = _draw_command(random)
    words: list[str] = []
    for parameter in command.params:
        is_argument = parameter.param_type_name == "argument"
        if is_argument:
            count = random.choice((1, 1, 1, 1, 0, 2))
            words += [_value(random, parameter) for _ in range(count)]
        elif parameter.opts[0] not in NEVER and random.random() < (0.9 if parameter.required else 0.2):
            words.append(random.choice(parameter.opts))
            if not parameter.is_flag:
                words.append(_value(random, parameter))
    if random.random() < 0.1:
        words.insert(random.randrange(len(words) + 1), random.choice(("--nonsense", "-x", *VALUES)))
    if random.random() < 0.1:
        random.shuffle(words)
    return [*names, *words]


def _draw_command(random: Random) -> tuple[list[str], Any]:
    command: Any = typer.main.get_command(app)
    names: list[str] = []
    while subcommands := getattr(command, "commands", None):
        name = random.choice([name for name in sorted(subcommands) if name not in LIVE])
        names.append(name)
        command = subcommands[name]
    return names, command


def _value(random: Random, parameter: Any) -> str:
    annotation = parameter.type_descriptor.annotation
    parts = (annotation, *get_args(annotation))
    choices = [word for part in parts for word in (part, *get_args(part)) if isinstance(word, str)]
    if choices and random.random() < 0.7:
        return random.choice(choices)
    if {int, float}.intersection(parts) and random.random() < 0.7:
        return random.choice(("0", "1", "2", "5", "50", "150", "0.5", "-1", "1e308", "nan"))
    return random.choice(FILES if random.random() < 0.6 else VALUES)

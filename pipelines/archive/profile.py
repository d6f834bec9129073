"""The profile of a run: which step ran when and where, and what waited for what, as a page."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from footscan.report.markup import facts, number, section, table, text
from footscan.report.page import page
from pipelines.engine.actions.step import Output
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import StepEnd
from schemas.base.errors import RefusedInput

NAMES, CHART = 130.0, 870.0
"""Widths of the names and of the time beside them, in units of the drawing."""
ROW, BAR = 18.0, 12.0
"""Heights of a row, and of the bar in it."""
TICKS = 8
"""Marks on the axis of time, about."""
MOST_ROWS = 80
"""Steps that the second chart shows at most: those of two scans of eight cameras."""
GOLDEN_DEG = 137.5
"""From one hue to the next: the golden angle keeps any number of them apart."""


Hues = Mapping[str, float]
"""Hue of each kind of step, degrees."""


class Profile:
    """Collects the ends of the steps of a run."""

    def __init__(self) -> None:
        self.ends: list[StepEnd] = []

    def on_step_end(self, end: StepEnd) -> None:
        """Keep the end of a step that ran."""
        if end.ran and end.started:
            self.ends.append(end)

    def write(self, path: Path) -> None:
        """Write the page; Fault if it cannot be written."""
        write_atomically(path, profile_page(self.ends).encode())


def check_place(path: Path) -> None:
    """Refuse a place for the page before anything runs; RefusedInput if it is a folder, or lies in none."""
    if path.is_dir() or not path.resolve().parent.is_dir():
        raise RefusedInput(f"--profile {path}", "expected the name of a file to write, in a folder that is there")


def profile_page(ends: Iterable[StepEnd]) -> str:
    """A page of two charts over the time of a run, and the sums of each kind of step.

    The first chart has a row for each worker: its gaps are idle. The second has a row for each step, in the order of
    their starts; a line leads from the end of the last input to the start, while the step waited for a worker.
    """
    steps = sorted(ends, key=lambda end: end.started)
    title = "Steps over time"
    if not steps:
        return page(title="Profile", kicker="Profile of a run", heading=title, parts=["<p>No step ran.</p>"])
    start = steps[0].started
    hues = {kind: k * GOLDEN_DEG % 360 for k, kind in enumerate(dict.fromkeys(end.step.kind for end in steps))}
    wall = max(max(end.started + end.seconds for end in steps) - start, 1e-3)
    workers = list(dict.fromkeys(end.worker for end in steps))
    busy = sum(end.seconds for end in steps)
    figures = [
        ("Steps", number(len(steps))),
        ("Time", f"{number(wall, 2)} s"),
        ("Workers", number(len(workers))),
        ("Busy", f"{number(100 * busy / wall / len(workers))} %"),
    ]
    of_steps = steps[:MOST_ROWS]
    left_out = "" if len(of_steps) == len(steps) else f" These are the first {len(of_steps)} of {len(steps)} steps."
    parts = [
        facts(figures),
        section("By worker", _chart(_of_workers(steps, workers, hues, wall), len(workers), wall)),
        section(
            "By step and camera",
            f'<p class="note">Lines: all inputs are there, and no worker is free.{left_out}</p>',
            _chart(_of_steps(of_steps, steps, hues, wall), len(of_steps), wall),
        ),
        section("Sums", _sums(steps, busy)),
    ]
    return page(title="Profile", kicker="Profile of a run", heading=title, parts=parts)


def _of_workers(steps: Sequence[StepEnd], workers: Sequence[str], hues: Hues, wall: float) -> Iterator[str]:
    for row, worker in enumerate(workers):
        yield _name(row, f"Worker {row + 1}", worker)
    for end in steps:
        yield _bar(workers.index(end.worker), end, end.started - steps[0].started, hues, wall)


def _of_steps(shown: Sequence[StepEnd], steps: Sequence[StepEnd], hues: Hues, wall: float) -> Iterator[str]:
    start = steps[0].started
    ended = {end.step.name: end.started + end.seconds for end in steps}
    for row, end in enumerate(shown):
        yield _name(row, end.step.name.rpartition("/")[2], end.step.name)
        ready = [ended.get(source.step, start) for source in end.step.inputs.values() if isinstance(source, Output)]
        since, until = (_x(moment - start, wall) for moment in (max(ready, default=start), end.started))
        if until > since:
            yield f'<path class="g5" d="M{since:.1f} {(row + 0.5) * ROW}H{until:.1f}"/>'
        yield _bar(row, end, end.started - start, hues, wall)


def _x(seconds: float, wall: float) -> float:
    return NAMES + seconds / wall * CHART


def _name(row: int, name: str, title: str) -> str:
    return f'<text x="0" y="{(row + 0.5) * ROW}" dy=".35em"><title>{text(title)}</title>{text(name)}</text>'


def _bar(row: int, end: StepEnd, start: float, hues: Hues, wall: float) -> str:
    title = f"{end.step.name}: {number(end.seconds, 3)} s, from {number(start, 3)} s on"
    return (
        f'<rect x="{_x(start, wall):.1f}" y="{row * ROW + (ROW - BAR) / 2}" height="{BAR}" '
        f'width="{max(end.seconds / wall * CHART, 0.5):.1f}" fill="hsl({hues[end.step.kind]:g} 55% 55%)">'
        f"<title>{text(title)}</title></rect>"
    )


def _chart(drawn: Iterable[str], rows: int, wall: float) -> str:
    """Rows over an axis of seconds, as SVG."""
    height = rows * ROW
    step = 10.0 ** math.floor(math.log10(wall / TICKS))
    step *= next(factor for factor in (1, 2, 5, 10) if wall / (step * factor) <= TICKS)
    decimals = max(-math.floor(math.log10(step)), 0)
    axis = "".join(
        f'<path class="g1" d="M{_x(k * step, wall):.1f} 0V{height}"/><text x="{_x(k * step, wall):.1f}" '
        f'y="{height + 12}" text-anchor="middle">{number(k * step, decimals)} s</text>'
        for k in range(int(wall / step) + 1)
    )
    return (
        f'<div class="wide"><svg class="profile" viewBox="0 0 {NAMES + CHART + 20:g} {height + 18:g}" role="img" '
        f'aria-label="Steps over time">{axis}{"".join(drawn)}</svg></div>'
    )


def _sums(steps: Sequence[StepEnd], busy: float) -> str:
    seconds: dict[str, list[float]] = {}
    for end in steps:
        seconds.setdefault(end.step.kind, []).append(end.seconds)
    rows = (
        [text(kind), number(len(of)), number(sum(of), 2), number(100 * sum(of) / busy, 1), number(max(of), 2)]
        for kind, of in sorted(seconds.items(), key=lambda item: -sum(item[1]))
    )
    return table(["Step", "Times", "Seconds", "Share, %", "Longest, s"], rows, numeric=range(1, 5))

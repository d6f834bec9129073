"""Figures of the time and memory of a scan: the least value of several passes."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

from pipelines.regression.figures.timed import Pass


def cost_figures(children: Sequence[Sequence[Pass]]) -> dict[str, float]:
    """Compute the figures of the passes of one or more processes.

    `time.KIND` is the time of all steps of a kind and `time.total` that of all steps, both in units of the reference
    computation. `memory.peak_mb` is the peak of the process, `memory.KIND_mb` the largest need of a step beyond the
    memory held before it, and `memory.kept_mb` the growth of the held memory from one pass to the next.
    """
    passes = [each for child in children for each in child]
    ratios: dict[str, float] = {}
    needed: dict[str, float] = {}
    kinds: dict[str, str] = {}
    for each in passes:
        for name, cost in each.steps.items():
            kinds[name] = cost.kind
            ratios[name] = min(cost.ratio, ratios.get(name, cost.ratio))
            needed[name] = min(cost.needed_mb, needed.get(name, cost.needed_mb))
    figures: dict[str, float] = defaultdict(float)
    for name, kind in kinds.items():
        figures[f"time.{kind}"] += ratios[name]
        memory = f"memory.{kind}_mb"
        figures[memory] = max(needed[name], figures[memory])
    figures["time.total"] = sum(ratios.values())
    figures["memory.peak_mb"] = min(each.peak_mb for each in passes)
    if kept := [max(after.held_mb - before.held_mb, 0.0) for child in children for before, after in pairwise(child)]:
        figures["memory.kept_mb"] = min(kept)
    return dict(figures)


def keeps_most(children: Sequence[Sequence[Pass]]) -> str | None:
    """The kind of step after which memory grew most in all passes but the first; None without such passes."""
    kept: dict[str, float] = defaultdict(float)
    for child in children:
        for later in child[1:]:
            for cost in later.steps.values():
                kept[cost.kind] += cost.kept_mb
    return max(kept, key=lambda kind: kept[kind], default=None)


def unsteady(children: Sequence[Sequence[Pass]], results: dict[str, str]) -> list[str]:
    """Steps whose result in a pass differs from `results`, those with the cache."""
    passes = [each for child in children for each in child]
    return [
        name for name, digest in results.items() if any(each.results.get(name, digest) != digest for each in passes)
    ]

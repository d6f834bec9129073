"""Time and memory of a scan as figures: of several passes the least of each."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

from pipelines.regression.figures.timed import Pass


def cost_figures(children: Sequence[Sequence[Pass]]) -> dict[str, float]:
    """The figures of the passes of one process or more.

    `time.KIND` is the time of all steps of a kind, `time.total` of all, both in times of the reference computation;
    `memory.peak_mb` the most that the process held, `memory.KIND_mb` the most that a step needed beyond what was held
    before it, `memory.kept_mb` what a further pass left behind that the pass before it had not.
    """
    passes = [one for of_child in children for one in of_child]
    ratios: dict[str, float] = {}
    needed: dict[str, float] = {}
    kinds: dict[str, str] = {}
    for one in passes:
        for name, cost in one.steps.items():
            kinds[name] = cost.kind
            ratios[name] = min(cost.ratio, ratios.get(name, cost.ratio))
            needed[name] = min(cost.needed_mb, needed.get(name, cost.needed_mb))
    figures: dict[str, float] = defaultdict(float)
    for name, kind in kinds.items():
        figures[f"time.{kind}"] += ratios[name]
        memory = f"memory.{kind}_mb"
        figures[memory] = max(needed[name], figures[memory])
    figures["time.total"] = sum(ratios.values())
    figures["memory.peak_mb"] = min(one.peak_mb for one in passes)
    if kept := [
        max(after.held_mb - before.held_mb, 0.0) for of_child in children for before, after in pairwise(of_child)
    ]:
        figures["memory.kept_mb"] = min(kept)
    return dict(figures)


def keeps_most(children: Sequence[Sequence[Pass]]) -> str | None:
    """The kind of step after which memory has grown most in the passes behind the first."""
    kept: dict[str, float] = defaultdict(float)
    for of_child in children:
        for one in of_child[1:]:
            for cost in one.steps.values():
                kept[cost.kind] += cost.kept_mb
    return max(kept, key=lambda kind: kept[kind], default=None)


def unsteady(children: Sequence[Sequence[Pass]], results: dict[str, str]) -> list[str]:
    """Steps that came out otherwise in a pass than they did with the cache."""
    passes = [one for of_child in children for one in of_child]
    return [name for name, digest in results.items() if any(one.results.get(name, digest) != digest for one in passes)]

"""Steps as the engine runs them: their inputs and outcomes."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, NamedTuple

from pydantic import BaseModel

from pipelines.engine.files.digest import FileState, sha256


@dataclass(frozen=True)
class Output:
    """An input that is the result of another step."""

    step: str
    """Name of that step, see `Step.name`."""
    source: ClassVar[str] = "result"


@dataclass(frozen=True)
class Value:
    """A small input that is known when the graph is built; its content is passed to the step."""

    content: bytes
    path: Path | None = None
    """The file that it was read from, if any; not part of the key."""
    source: ClassVar[str] = "value"

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return sha256(self.content)


@dataclass(frozen=True)
class SourceFile:
    """An input in files of the archive; the step reads these files itself."""

    path: Path
    digest: str
    states: tuple[tuple[Path, FileState], ...]
    """State of each file when its digest was computed; it shows a later change."""
    source: ClassVar[str] = "file"


Input = Output | Value | SourceFile


class Step(NamedTuple):
    """A pure function with parameters and named inputs.

    A named tuple is cheap to make: the plan of an archive makes tens of thousands.
    """

    scan: str
    """The scan it belongs to, as `patient/scan`."""
    kind: str
    """Kind of step, e.g. `extract`."""
    module: str
    """Name of the module with `run(inputs, parameters, places) -> bytes`; imported when the step runs."""
    parameters: BaseModel | None = None
    inputs: Mapping[str, Input] = {}
    camera: int | None = None
    places: Mapping[str, Path] = {}
    """Folders and files outside the store that the step reads or writes; not part of the key."""
    writes: Path | None = None
    """A file outside the store that the step writes; if it is missing, the step must run again."""

    @property
    def name(self) -> str:
        """Unique within a graph, and the same in every run: `patient/scan/extract-3`."""
        return f"{self.scan}/{self.kind}" + (f"-{self.camera}" if self.camera is not None else "")


def is_named(step: Step, name: str) -> bool:
    """Return True if `name` is a step's kind, such as `extract`, or its kind and camera, such as `extract-3`."""
    return name in (step.kind, step.name.rpartition("/")[2])


def steps_to(steps: Sequence[Step], names: Collection[str]) -> list[Step]:
    """Select those of `steps`, in topological order, that have one of the `names`, and all that they need.

    Of several of one name, the last one counts.
    """
    needed = set(names)
    seen: set[str] = set()
    kept = []
    for step in reversed(steps):
        if step.name in needed and step.name not in seen:
            kept.append(step)
            needed |= {source.step for source in step.inputs.values() if isinstance(source, Output)}
        seen.add(step.name)
    return kept[::-1]


@dataclass(frozen=True)
class Success:
    """The digest of a result in the content store."""

    digest: str


@dataclass(frozen=True)
class Failure:
    """The reason why a step has no result."""

    problem: str
    """One line."""
    kind: str
    """`refused` input, a `finding`, a `fault` of the machine, or a `damaged` result in the store."""
    cause: str
    """Name of the step that failed; the steps that depend on it fail with the same cause."""
    is_defect: bool = False
    """True if the program is at fault, not the machine."""


Outcome = Success | Failure

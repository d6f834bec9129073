"""What the engine runs: steps, and the actions that they become once their inputs are known."""

from collections.abc import Mapping
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
    """An input that is known when the graph is drawn, small enough to be handed over as it is."""

    content: bytes
    path: Path | None = None
    """The file that it was read from, where there is one; no part of the key."""
    source: ClassVar[str] = "value"

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return sha256(self.content)


@dataclass(frozen=True)
class SourceFile:
    """An input that lies in files of the archive; the step reads them where they are."""

    path: Path
    digest: str
    states: tuple[tuple[Path, FileState], ...]
    """The state of each file when its digest was taken: a file that changes meanwhile is noticed."""
    source: ClassVar[str] = "file"


Input = Output | Value | SourceFile


class Step(NamedTuple):
    """A pure function with parameters and named inputs. A tuple, for an archive's plan makes tens of thousands."""

    scan: str
    """The scan it belongs to, as `patient/scan`."""
    kind: str
    """What it does, e.g. `extract`."""
    module: str
    """Name of the one that holds `run(inputs, parameters, places) -> bytes`; imported when the step runs."""
    parameters: BaseModel | None = None
    inputs: Mapping[str, Input] = {}
    camera: int | None = None
    places: Mapping[str, Path] = {}
    """Folders and files that the step reads or writes beside the store; no part of the key."""
    writes: Path | None = None
    """A file outside the store that the step leaves behind and without which it must run again."""

    @property
    def name(self) -> str:
        """Unique within a graph, and the same in every run: `patient/scan/extract-3`."""
        return f"{self.scan}/{self.kind}" + (f"-{self.camera}" if self.camera is not None else "")


@dataclass(frozen=True)
class Success:
    """A result, by its digest in the content store."""

    digest: str


@dataclass(frozen=True)
class Failure:
    """Why a step has no result."""

    problem: str
    """One line."""
    kind: str
    """`refused` input, a `finding`, or a `fault` of the machine."""
    cause: str
    """Name of the step that failed; others that wait for it fail with it."""


Outcome = Success | Failure

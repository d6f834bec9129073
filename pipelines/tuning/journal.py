"""The journal of a search, a file beside its results, from which an interrupted search continues."""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from schemas.base.errors import Fault
from schemas.base.model import canonical_json
from schemas.tuning import TriedPoint, TuneJournal, Tuning


class Journal:
    """A file of JSON lines: first the search, then each point whose steps have all been run.

    Each search has a file of its own. Its data sets and its number of trials may change; tried points remain valid.
    """

    def __init__(self, folder: Path, tuning: Tuning) -> None:
        search = tuning.model_dump(mode="json")["search"]
        head = TuneJournal(search=search, sampler=tuning.sampler, seed=tuning.seed, objectives=tuning.objectives)
        self._names = list(search)
        self._head = canonical_json(head.model_dump(mode="json"))
        self._folder = folder
        self._path = folder / f"trials-{sha256(self._head.encode())[:12]}.jsonl"

    def read(self) -> list[TriedPoint]:
        """Read the tried points in their order; the first damaged line and all lines behind it are removed."""
        text = _text(self._path)
        lines = text.splitlines()
        tried = [self._in_order(point) for point in _points(lines)] if lines[:1] == [self._head] else []
        valid = "".join(f"{line}\n" for line in [self._head, *lines[1 : len(tried) + 1]])
        if text != valid:
            write_atomically(self._path, valid.encode())
        return tried

    def _in_order(self, tried: TriedPoint) -> TriedPoint:
        """Restore the order of the values, since JSON lines are sorted by name."""
        point = tried.point and {name: tried.point[name] for name in self._names}
        return tried.model_copy(update={"point": point})

    def append(self, tried: TriedPoint) -> None:
        """Append a tried point; Fault if the disk refuses."""
        try:
            with self._path.open("ab", buffering=0) as file:  # one write per line: another search may append, too
                file.write(canonical_json(tried.model_dump(mode="json")).encode() + b"\n")
        except OSError as error:
            raise Fault(f"{self._path}: cannot be written ({error.strerror or error})") from None

    def seconds(self) -> dict[str, float]:
        """Times of the steps that any search in this folder has run, by the key of their action."""
        seconds: dict[str, float] = {}
        for path in sorted(self._folder.glob("trials-*.jsonl")):
            for tried in _points(_text(path).splitlines()):
                seconds |= tried.seconds
        return seconds


def _text(path: Path) -> str:
    with contextlib.suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8")
    return ""


def _points(lines: list[str]) -> Iterator[TriedPoint]:
    for line in lines[1:]:
        try:
            yield TriedPoint.model_validate(json.loads(line))
        except (ValueError, ValidationError):
            return

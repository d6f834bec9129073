"""The errors of the project, each kind with the exit status of the command.

A message is one line and names the file, the field or value, and what was expected.
"""

from functools import partial
from pathlib import Path
from typing import Any


class FootscanError(Exception):
    """Base of all errors that are reported to a user in one line."""

    exit_status = 3


class RefusedInput(FootscanError):
    """An input that breaks its format, or a wrong use of the command. Nothing was changed."""

    exit_status = 2

    def __init__(self, source: Path | str, problem: str, *, field: str | None = None) -> None:
        self.source = str(source)
        self.field = field
        self.problem = problem
        self.others: tuple[RefusedInput, ...] = ()
        """Further mistakes in the same document, if all are reported at once."""
        super().__init__(": ".join(one_line(part) for part in (self.source, field, problem) if part))

    def __reduce__(self) -> tuple[Any, ...]:
        """The parts from which another process rebuilds the error."""
        return partial(RefusedInput, field=self.field), (self.source, self.problem), {"others": self.others}


class Finding(FootscanError):
    """A scan that cannot be measured ("no stripe in camera 3"). Cached and reported; other scans go on."""

    exit_status = 1

    def __init__(self, problem: str) -> None:
        super().__init__(one_line(problem))


class Fault(FootscanError):
    """A fault of the machine: a full disk, a damaged store. Never cached."""

    exit_status = 3

    def __init__(self, problem: str) -> None:
        super().__init__(one_line(problem))


class DamagedError(Fault):
    """A stored file has changed since it was written. It has been set aside: another run computes it again."""


def one_line(text: str) -> str:
    """`text` without line breaks and control characters, for names that come from outside."""
    return printable(" ".join(text.split()))


def printable(text: str, keep: str = "") -> str:
    """`text` with a replacement character for each one that a terminal would obey instead of showing.

    These are control characters, escape sequences, line breaks and marks that turn the direction of writing. The
    characters in `keep` stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else "\N{REPLACEMENT CHARACTER}" for c in text)

"""A profile: options of a run under one name."""

import datetime
import re
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field

from schemas.base.model import Document
from schemas.parameters.scan import ScanParameters


def _since(text: str) -> str:
    first_day(text, datetime.date.max)
    return text


def _as_text(day: object) -> object:
    return day.isoformat() if isinstance(day, datetime.date) else day  # YAML reads a date as one


def first_day(text: str, today: datetime.date) -> datetime.date:
    """The day that `since` means: a date, or a number of days before today.

    Raises
    ------
    ValueError
        It is neither.

    >>> print(first_day("2026-11-02", datetime.date(2026, 11, 20)), first_day("7d", datetime.date(2026, 11, 20)))
    2026-11-02 2026-11-13
    """
    if (days := re.fullmatch(r"([0-9]{1,5})d", text)) is not None:
        return today - datetime.timedelta(days=int(days[1]))
    try:
        return datetime.date.fromisoformat(text)
    except ValueError:
        raise ValueError("expected a date such as 2026-11-02, or days such as 7d") from None


Name = Annotated[str, Field(min_length=1, max_length=200)]
Since = Annotated[str, BeforeValidator(_as_text), AfterValidator(_since)]
ProfileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class Profile(Document):
    """Options of `run`, `plan` and `why` under one name; the command line's own win over them."""

    only: list[Name] = Field(default_factory=list)
    """Patterns of `patient/scan`; without any, all scans."""
    since: Since | None = None
    """First day of the scans, as a date or as days before today (`7d`)."""
    until: Name | None = None
    """Step after which the run ends."""
    force: list[Name] = Field(default_factory=list)
    """Steps that run even if their results are known."""
    fail_fast: bool = False
    """Whether the first failed scan ends the run."""
    workers: Annotated[int, Field(ge=1, le=256)] | None = None
    """Number of steps that run at once; default: the workflow's."""
    parameters: ScanParameters = ScanParameters()
    """Parameters in place of the workflow's; those that are left out stay as they are there."""

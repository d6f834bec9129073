"""The check that the last night ran at all, made in the morning by a job that does not depend on the night."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.regression.history import read_history
from pipelines.regression.night import PAGE
from pipelines.regression.report.page import with_notice
from schemas.base.errors import RefusedInput

_UNITS = {"m": timedelta(minutes=1), "h": timedelta(hours=1), "d": timedelta(days=1)}


def age_of(text: str) -> timedelta:
    """Parse an age such as `26h`, `90m` or `2d`; RefusedInput for any other text."""
    match = re.fullmatch(r"([0-9]{1,6}(?:\.[0-9]{1,3})?)([mhd])", text)
    if match is None:
        raise RefusedInput("--check-last", f"expected an age such as 26h, 90m or 2d, found {text[:80]!r}")
    return float(match[1]) * _UNITS[match[2]]


def check_last(out: Path, age: timedelta) -> tuple[bool, str]:
    """Return True if a night has ended within `age`, and one line about it.

    If not, the page shows that line, too, until the next night writes the page again.
    """
    history, now = read_history(out), datetime.now(UTC)
    last = max((night.time for night in history.ended), default=None)
    if last is not None and now - last <= age:
        status = max(history.ended, key=lambda night: night.time).status
        return True, f"the last night ended {_hours(now - last)} ago, with status {status}"
    problem = f"no night has ended in {out}" if last is None else f"the last night ended {_hours(now - last)} ago"
    problem += f", expected one within {_hours(age)}"
    begun = max((night.time for night in history.unfinished), default=None)
    if begun is not None and (last is None or begun > last):
        problem += f"; one began {_hours(now - begun)} ago and did not end"
    page = out / PAGE
    if page.is_file():
        notice = f"Checked at {now:%Y-%m-%d %H:%M} UTC: {problem}."
        write_atomically(page, with_notice(page.read_text(encoding="utf-8"), notice).encode())
    return False, problem


def _hours(span: timedelta) -> str:
    return f"{span / timedelta(hours=1):.1f} h"

"""What each command has in common: `--version`, `--quiet`, and the exit status in its help."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from pipelines.cli.terminal.output import be_quiet, print_line

SERVERS = ("console", "edit")
"""Commands that serve a page until Ctrl-C, which is no interruption."""


def print_version(is_asked: bool) -> None:
    """Print name and version, and end."""
    if is_asked:
        from pipelines.version import SOFTWARE

        print_line(SOFTWARE)
        raise typer.Exit


def with_norms(command: Any, status_1: Mapping[str, str], path: tuple[str, ...] = ()) -> Any:
    """`command`, with `--quiet` and the exit status in the help of each command below it.

    `status_1` : the meaning of exit status 1, by the names of a command.
    """
    if isinstance(command, TyperGroup):
        for name, below in command.commands.items():
            with_norms(below, status_1, (*path, name))
    elif isinstance(command, TyperCommand):
        command.params.append(_quiet_option())
        failed = status_1.get(" ".join(path))
        done, ended = ("0 ended by Ctrl-C", "") if path[-1] in SERVERS else ("0 done", "; 130 ended by Ctrl-C")
        command.epilog = (
            f"Exit status: {done}; {f'1 {failed}; ' if failed else ''}2 wrong use or refused input; "
            f"3 fault of the machine{ended}."
        )
    return command


@lru_cache(maxsize=1)
def _quiet_option() -> Any:
    """The option `--quiet` as Typer makes it."""
    made = typer.Typer(add_completion=False)
    made.command()(_with_quiet)
    [option] = [one for one in typer.main.get_command(made).params if one.name == "quiet"]
    return option


def _be_quiet(is_asked: bool) -> None:
    if is_asked:
        be_quiet()


def _with_quiet(
    quiet: Annotated[
        bool,
        typer.Option(
            "--quiet",
            "-q",
            help="Print results and problems only, without progress and notes.",
            callback=_be_quiet,
            is_eager=True,
            expose_value=False,
        ),
    ] = False,
) -> None:
    del quiet

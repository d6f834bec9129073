"""Shared options of the live commands: the rig, or the virtual world in its place."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.terminal.compiling import compile_loops
from pipelines.cli.terminal.output import note
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.live.state import ScannerState
    from pipelines.live.virtual.process import WorldProcess
    from pipelines.live.virtual.world import World
    from schemas.rig import Rig

RIG = Path("rig.yaml")

RigFile = Annotated[Path | None, typer.Option("--rig", help="Description of the scanner; default: rig.yaml.")]
OF_VIRTUAL = "Virtual scanner"
"""Group of the options that only a virtual scanner has."""
Virtual = Annotated[
    bool, typer.Option("--virtual", rich_help_panel=OF_VIRTUAL, help="Use a virtual scanner instead of hardware.")
]
VirtualFolder = Annotated[
    Path,
    typer.Option("--virtual-folder", rich_help_panel=OF_VIRTUAL, help="Folder for its rig, calibration and pictures."),
]
GridMm = Annotated[
    float,
    typer.Option(
        "--grid-mm", min=0.05, max=10, rich_help_panel=OF_VIRTUAL, help="Distance between its rendered pictures, mm."
    ),
]
VIRTUAL_FOLDER = Path("virtual")
CAPTURES = Path("captures")


@dataclass(frozen=True)
class OpenRig:
    """A rig that is ready for use."""

    rig: "Rig"
    file: Path
    world: "WorldProcess | None" = None
    """World of a virtual rig."""


@contextmanager
def opened_rig(rig: Path | None, folder: Path, world: "World | None", *, calibrated: bool = False) -> Iterator[OpenRig]:
    """The rig of a file, or the virtual one of `folder` in a `world`; `calibrated` as in `virtual_rig`.

    While it is open, a signal that ends the program stops heads and lasers first.
    """
    from footscan.capture.board.termination import signals_end_the_program
    from pipelines.live.rig_file import read_rig

    with signals_end_the_program():
        if world is None:
            file = rig or RIG
            yield OpenRig(read_rig(file), file)
            return
        if rig is not None:
            raise RefusedInput("--rig", "goes without --virtual, which has a rig of its own")
        from footscan.ahead_of_time import VIRTUAL
        from pipelines.live.virtual.rig import virtual_rig

        compile_loops(VIRTUAL)
        with virtual_rig(folder, world, _Told(), calibrated=calibrated) as one:
            yield OpenRig(one.rig, one.file, one.world)


def plain_world(virtual: bool, folder: Path, subject: Literal["block", "nothing"] = "nothing") -> "World | None":
    """The virtual world of commands that need no foot; None for a real scanner."""
    if not virtual:
        return None
    from pipelines.live.virtual.world import World

    return World(pictures=str(folder / "pictures"), subject=subject)


class StateTeller:
    """Print a line for each state of the scanner, and now and then one of an activity that takes long."""

    def __init__(self) -> None:
        self._told = ("", "", 0)

    def __call__(self, state: "ScannerState") -> None:
        """Print the line of a new state."""
        tenth = 0 if state.left_s is None or state.progress is None else int(10 * state.progress)
        told, self._told = self._told, (state.name, state.words, tenth)
        if tenth and tenth != told[2]:
            note(str(state))
        elif (state.name, state.words) != told[:2]:
            note(f"{state.name}: {state.words}" if state.words else state.name)


class _Told:
    """Print the progress of the preparation now and then."""

    def __init__(self) -> None:
        self._told = ("", -1)

    def __call__(self, what: str, done: int, total: int) -> None:
        share = 10 * done // max(total, 1)
        if (what, share) != self._told:
            self._told = (what, share)
            note(f"preparing the virtual scanner: {what} {done} of {total}")

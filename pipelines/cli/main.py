"""Entry point of the command: its sub-commands, and every error as one line with its own exit status."""

import atexit
import errno
import logging
import os
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from footscan.capture.board.termination import EndedBySignal
from pipelines.cli import compare, demo, export, extract, films, regress, thesis, tune, verify
from pipelines.cli.archive import cache, config, edit, forget, init, plan, results, run, trace, upgrade, why
from pipelines.cli.calibrate import app as calibration
from pipelines.cli.foot import lasts, measure, pairs, sizes
from pipelines.cli.live import console, devices, scan
from pipelines.cli.terminal.norms import print_version, with_norms
from pipelines.cli.terminal.output import LogFormatter, be_quiet, drop_unwritten, message
from pipelines.engine.files.access import keep_private
from schemas.base.errors import Fault, FootscanError, RefusedInput, one_line
from schemas.base.limits import check_limits

# Steps run side by side, and their matrices are small: threads of OpenBLAS would wait for each other, and on a busy
# machine a step takes 25 times as long. It reads this when NumPy is imported, later; processes inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

INTERRUPTED = 130
MOST_OTHERS = 19
"""Mistakes printed after the first one. Bound: what a terminal shows at once."""

app = typer.Typer(
    name="footscan",
    help="Turn the films of a laser-stripe foot scanner into a measured 3D foot.",
    epilog="Exit status: 0 done; 1 done, with scans that failed, a calibration beyond its tolerance or a damaged "
    "cache; 2 wrong use or refused input; 3 fault of the machine; 128 and the signal's number when ended by one "
    "(130 Ctrl-C, 143 SIGTERM, 129 SIGHUP, 131 SIGQUIT).",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.callback()
def _of_all(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=print_version)
    ] = False,
) -> None:
    del version


cache.cache.command("upgrade")(upgrade.upgrade)
COMMANDS: dict[str, dict[str, typer.Typer | Callable[..., object]]] = {
    "Scan": {
        "devices": devices.devices,
        "home": scan.home,
        "jog": scan.jog,
        "scan": scan.scan,
        "console": console.console,
        "simulate": films.simulate,
    },
    "Results": {
        "results": results.results,
        "edit": edit.edit,
        "measure": measure.measure,
        "sizes": sizes.sizes,
        "pair": pairs.pair,
        "change": pairs.change,
        "lasts": lasts.lasts,
        "export": export.export,
    },
    "Calibration": {"calibrate": calibration.calibrate, "map": calibration.map_pixels},
    "Archive": {
        "init": init.init,
        "run": run.run,
        "plan": plan.plan,
        "why": why.why,
        "trace": trace.trace,
        "config": config.config,
        "tune": tune.tune,
        "cache": cache.cache,
        "ingest": films.ingest,
        "extract": extract.extract,
        "forget": forget.forget,
    },
    "Verification": {
        "demo": demo.demo,
        "verify": verify.verify,
        "compare": compare.compare,
        "regress": regress.regress,
        "thesis": thesis.thesis,
    },
}
"""The commands and groups of commands, as the help shows them."""
for panel, commands in COMMANDS.items():
    for name, command in commands.items():
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, rich_help_panel=panel)
        else:
            app.command(name, rich_help_panel=panel)(command)

STATUS_1 = {
    "calibrate check": "a camera has drifted",
    "calibrate compare": "calibrations differ by more than the tolerance",
    "calibrate film": "a placement is wrong",
    "calibrate latency": "a camera's latency is not known",
    "calibrate morning": "a camera has moved",
    "cache gc": "another command uses the store",
    "cache upgrade": "a result differs",
    "cache verify": "something is damaged",
    "forget": "something remains",
    "init": "a scan cannot be read",
    "ingest": "a film was refused",
    "plan": "a scan was refused",
    "regress": "a figure is beyond its tolerance",
    "run": "a scan failed",
    "scan": "the foot could not be measured",
    "trace": "no step made the file",
    "tune": "a scan was refused",
}
"""Meaning of exit status 1, by command."""


def main() -> None:
    """Run the command line and exit with its status."""
    statuses: list[int] = []
    atexit.register(_leave, statuses)
    keep_private()
    handler = logging.StreamHandler()
    handler.setFormatter(LogFormatter("footscan: %(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    if os.environ.get("FOOTSCAN_DEBUG"):
        logging.getLogger("footscan").setLevel(logging.DEBUG)
    statuses.append(run_command(sys.argv[1:]))
    drop_unwritten()
    sys.exit(statuses[0])


def _leave(statuses: list[int]) -> None:
    """End the process at once: after a scan Python takes half a second to take its objects and libraries apart.

    Registered first, it is called last, when threads have ended and what else is to be done at the end is done.
    `statuses` : the exit status; empty after a defect, whose end is Python's.
    """
    if statuses:
        logging.shutdown()  # registered when it was imported, and so to be called later
        drop_unwritten()
        os._exit(statuses[0])


def run_command(arguments: list[str]) -> int:
    """Run `footscan ARGUMENTS` and return the exit status. Each mistake is one line on standard error."""
    try:
        be_quiet(is_asked=False)
        check_limits()
        _check_arguments(arguments)
        whole = with_norms(typer.main.get_command(app), STATUS_1)
        status = int(whole(arguments, standalone_mode=False, prog_name="footscan") or 0)
        if status == INTERRUPTED:  # which is what Typer makes of it
            raise KeyboardInterrupt
        return status
    except (FootscanError, typer.TyperException, typer.Abort, KeyboardInterrupt, OSError, MemoryError) as error:
        problem, status = _explain(error)
        if problem:
            message(f"footscan: {problem}")
        others = error.others if isinstance(error, RefusedInput) else ()
        for other in others[:MOST_OTHERS]:
            message(f"footscan: {other}")
        if others[MOST_OTHERS:]:
            message(f"footscan: and {len(others) - MOST_OTHERS} more mistakes")
        return status
    except EndedBySignal as end:
        message(f"footscan: {end}")
        return 128 + end.number


def _check_arguments(arguments: list[str]) -> None:
    """Refuse arguments with a NUL byte, which no shell can pass and no file name can hold."""
    for argument in arguments:
        if "\0" in argument:
            raise RefusedInput(one_line(argument)[:80], "holds a character of value 0, expected none")


def _explain(error: BaseException) -> tuple[str, int]:
    """The message of an error, and the exit status."""
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        name = str(error.filename)
        error = RefusedInput(f"{name[:60]}...", f"is a name of {len(name)} characters, expected a shorter one")
    match error:
        case FootscanError():
            return str(error), error.exit_status
        case typer.TyperException() if not error.format_message():
            return "", RefusedInput.exit_status  # its help was printed
        case typer.TyperException():
            context = getattr(error, "ctx", None)  # of a wrong use; typer does not export its class
            command = context.command_path if context else "footscan"
            problem = one_line(error.format_message()).replace("Value error, ", "")
            return f"{problem} (see '{command} --help')", RefusedInput.exit_status
        case OSError():
            return one_line(str(error)), Fault.exit_status
        case MemoryError():
            return "out of memory", Fault.exit_status
        case _:
            return "interrupted; what is complete is kept", INTERRUPTED

"""Entry point of the command: its sub-commands, and every error as one line with its own exit status."""

import errno
import logging
import os
import sys

import typer

from footscan.capture.board.termination import EndedBySignal
from pipelines.cli import compare, demo, export, extract, films, regress, thesis, tune, verify
from pipelines.cli.archive import cache, config, forget, plan, run, trace, upgrade, why
from pipelines.cli.calibrate import app as calibration
from pipelines.cli.foot import lasts, measure, pairs, sizes
from pipelines.cli.live import console, devices, scan
from pipelines.cli.terminal.output import LogFormatter, drop_unwritten, message
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
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("demo")(demo.demo)
app.add_typer(films.simulate, name="simulate")
app.command("ingest")(films.ingest)
app.command("extract")(extract.extract)
app.add_typer(calibration.calibrate, name="calibrate")
app.command("map")(calibration.map_pixels)
app.command("run")(run.run)
app.command("plan")(plan.plan)
app.add_typer(config.config, name="config")
app.command("tune")(tune.tune)
app.command("why")(why.why)
app.command("trace")(trace.trace)
cache.cache.command("upgrade")(upgrade.upgrade)
app.add_typer(cache.cache, name="cache")
app.command("forget")(forget.forget)
app.command("regress")(regress.regress)
app.command("measure")(measure.measure)
app.command("sizes")(sizes.sizes)
app.command("pair")(pairs.pair)
app.command("change")(pairs.change)
app.command("lasts")(lasts.lasts)
app.command("compare")(compare.compare)
app.command("export")(export.export)
app.command("thesis")(thesis.thesis)
app.add_typer(verify.verify, name="verify")
app.command("devices")(devices.devices)
app.command("home")(scan.home)
app.command("jog")(scan.jog)
app.command("scan")(scan.scan)
app.command("console")(console.console)


def main() -> None:
    """Run the command line and exit with its status."""
    keep_private()
    handler = logging.StreamHandler()
    handler.setFormatter(LogFormatter("footscan: %(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    if os.environ.get("FOOTSCAN_DEBUG"):
        logging.getLogger("footscan").setLevel(logging.DEBUG)
    status = run_command(sys.argv[1:])
    drop_unwritten()
    sys.exit(status)


def run_command(arguments: list[str]) -> int:
    """Run `footscan ARGUMENTS` and return the exit status. Each mistake is one line on standard error."""
    try:
        check_limits()
        _check_arguments(arguments)
        status = int(app(arguments, standalone_mode=False, prog_name="footscan") or 0)
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

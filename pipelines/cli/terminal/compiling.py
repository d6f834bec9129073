"""Compiling, with a message, before a command that measures."""

from pipelines.cli.terminal.output import note


def compile_loops() -> None:
    """Compile the loops of a scan on all cores, where that was not done yet."""
    from footscan.ahead_of_time import compile_ahead, is_compiled

    if not is_compiled():
        note("compiling for this machine, once; on two cores that takes some 40 s")
        compile_ahead()

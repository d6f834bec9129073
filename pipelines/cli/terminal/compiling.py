"""Compiling, with a message, before a command that measures or films virtually."""

from pipelines.cli.terminal.output import note


def compile_loops(*lists: str) -> None:
    """Compile the loops of lists of `footscan.ahead_of_time` on all cores, where that was not done yet."""
    from footscan.ahead_of_time import SECONDS, Compilation, is_compiled

    if seconds := sum(SECONDS[name] for name in lists if not is_compiled(name)):
        note(f"compiling for this machine, once; on two cores that takes some {seconds} s")
        with Compilation(*lists) as compilation:
            compilation.wait()

"""Loops of a list are compiled by processes, and what they compiled is loaded by others."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from waiting import wait_until

COMPILE = """
import logging, sys
from footscan.ahead_of_time import Compilation, is_compiled
logging.basicConfig(format="%(message)s")
before = is_compiled(sys.argv[1])
with Compilation(sys.argv[1]) as compilation:
    compilation.wait()
print(before, is_compiled(sys.argv[1]))
"""
LEAVE = """
import sys
from footscan.ahead_of_time import Compilation
with Compilation(sys.argv[1]) as compilation:
    sys.stdin.readline()
print(compilation.is_done)
"""
STOP = """
import sys
from footscan.ahead_of_time import Compilation

def stop():
    raise InterruptedError("enough")

with Compilation(sys.argv[1]) as compilation:
    compilation.wait(stop)
"""
ALL_LOOPS = Path(__file__).parents[2] / "footscan/loops.json"


def start(loops: Path, cache: Path, program: str = COMPILE) -> subprocess.Popen[str]:
    line, environment = [sys.executable, "-c", program, str(loops)], os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    pipe = subprocess.PIPE
    return subprocess.Popen(
        line, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=environment, start_new_session=True
    )


def compile_list(loops: Path, cache: Path) -> tuple[str, str]:
    """What it prints, and what it reports."""
    with start(loops, cache) as compiling:
        said = compiling.communicate()
    assert compiling.returncode == 0, said
    return said


def has_processes(group: int) -> bool:
    with suppress(ProcessLookupError):
        os.killpg(group, 0)
        return True
    return False


def test_the_listed_loops_are_compiled_once(tmp_path: Path) -> None:
    listed = json.loads(ALL_LOOPS.read_text())
    names = {"_moved", "_median_noise"}
    loops = tmp_path / "loops.json"
    loops.write_text(json.dumps([loop for loop in listed if loop[1] in names]))
    assert compile_list(loops, tmp_path / "cache") == ("False True\n", "")
    made = {file.name.partition("-")[0].partition(".")[2] for file in (tmp_path / "cache").rglob("*.nbi")}
    assert made >= names
    assert compile_list(loops, tmp_path / "cache")[0] == "True True\n"


def test_a_loop_that_is_not_compiled_is_reported(tmp_path: Path) -> None:
    loops = tmp_path / "loops.json"
    loops.write_text(json.dumps([["footscan.measure.outline", "no_such_loop", []]]))
    printed, reported = compile_list(loops, tmp_path / "cache")
    assert printed == "False False\n"
    assert reported.startswith("1 of 1 loops were not compiled ahead: AttributeError(")


def test_an_interrupt_ends_it_while_loops_wait(tmp_path: Path) -> None:
    with start(ALL_LOOPS, tmp_path / "cache") as compiling:
        wait_until(lambda: list(tmp_path.glob("cache/**/*.nbi")))
        os.killpg(compiling.pid, signal.SIGINT)
        said = compiling.communicate(timeout=20)[1]
    assert compiling.returncode == -signal.SIGINT
    assert said.count("Traceback") == 1, said
    assert not list(tmp_path.glob("cache/ahead-*"))


def test_a_program_that_needs_them_no_longer_ends_at_once(tmp_path: Path) -> None:
    with start(ALL_LOOPS, tmp_path / "cache", LEAVE) as compiling:
        wait_until(lambda: list(tmp_path.glob("cache/**/*.nbi")))
        printed, reported = compiling.communicate("\n", timeout=20)
    assert (compiling.returncode, printed, reported) == (0, "False\n", "")
    wait_until(lambda: not has_processes(compiling.pid))


def test_a_wait_can_be_ended(tmp_path: Path) -> None:
    with start(ALL_LOOPS, tmp_path / "cache", STOP) as compiling:
        reported = compiling.communicate(timeout=60)[1]
    assert compiling.returncode == 1
    assert reported.endswith("InterruptedError: enough\n")

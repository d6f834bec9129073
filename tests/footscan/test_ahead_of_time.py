"""Loops of a list are compiled by processes, and what they compiled is loaded by others."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

COMPILE = """
import logging, sys
from footscan import ahead_of_time
logging.basicConfig(format="%(message)s")
ahead_of_time.LIST = sys.argv[1]
before = ahead_of_time.is_compiled()
ahead_of_time.compile_ahead()
print(before, ahead_of_time.is_compiled())
"""


def compile_list(loops: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    line = [sys.executable, "-c", COMPILE, str(loops)]
    return subprocess.run(line, check=True, capture_output=True, text=True, env=environment)


def test_the_listed_loops_are_compiled_once(tmp_path: Path) -> None:
    listed = json.loads((Path(__file__).parents[2] / "footscan/loops.json").read_text())
    names = {"_moved", "_median_noise"}
    loops = tmp_path / "loops.json"
    loops.write_text(json.dumps([loop for loop in listed if loop[1] in names]))
    done = compile_list(loops, tmp_path / "cache")
    assert (done.stdout, done.stderr) == ("False True\n", "")
    made = {file.name.partition("-")[0].partition(".")[2] for file in (tmp_path / "cache").rglob("*.nbi")}
    assert made >= names
    assert compile_list(loops, tmp_path / "cache").stdout == "True True\n"


def test_a_loop_that_is_not_compiled_is_reported(tmp_path: Path) -> None:
    loops = tmp_path / "loops.json"
    loops.write_text(json.dumps([["footscan.measure.outline", "no_such_loop", []]]))
    done = compile_list(loops, tmp_path / "cache")
    assert done.stdout == "False False\n"
    assert done.stderr.startswith("1 of 1 loops were not compiled ahead: AttributeError(")


def test_an_interrupt_ends_it_while_loops_wait(tmp_path: Path) -> None:
    listed = Path(__file__).parents[2] / "footscan/loops.json"
    line = [sys.executable, "-c", COMPILE, str(listed)]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    with subprocess.Popen(line, stderr=subprocess.PIPE, env=environment, start_new_session=True) as compiling:
        while not list(tmp_path.glob("cache/**/*.nbi")):
            time.sleep(0.1)
        os.killpg(compiling.pid, signal.SIGINT)
        said = compiling.communicate(timeout=20)[1].decode()
    assert compiling.returncode == -signal.SIGINT
    assert said.count("Traceback") == 1, said
    assert not list(tmp_path.glob("cache/ahead-*"))

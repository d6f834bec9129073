"""The end of the command."""

import subprocess
import sys
from pathlib import Path

LEFT = """
import sys, tempfile, threading, time
from pipelines.cli import main

def run_command(arguments):
    global folder
    folder = tempfile.TemporaryDirectory()
    threading.Thread(target=lambda: (time.sleep(0.3), print("thread", flush=True))).start()
    print(folder.name)
    {end}

main.run_command = run_command
main.main()
"""


def ended(end: str) -> subprocess.CompletedProcess[str]:
    """What a command prints that ends with a line of code, while a thread runs and a temporary folder is there."""
    return subprocess.run([sys.executable, "-c", LEFT.format(end=end)], capture_output=True, text=True, check=False)


def test_what_is_to_be_done_at_the_end_is_done() -> None:
    done = ended("return 3")
    folder, thread = done.stdout.splitlines()
    assert done.returncode == 3
    assert thread == "thread"
    assert not Path(folder).exists()


def test_a_defect_ends_with_its_traceback() -> None:
    done = ended("raise ArithmeticError('a defect')")
    assert done.returncode == 1
    assert done.stderr.endswith("ArithmeticError: a defect\n")
    assert not Path(done.stdout.splitlines()[0]).exists()

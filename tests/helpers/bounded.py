"""The command within bounds: a process runs one argument line after the other, and tells time and memory of each."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SECONDS = 10.0
"""Of processor: this machine may do other things, too."""
BYTES = 10**9
ADDRESSES = 8 * 10**9
"""What the process may ask for; beyond it, it is told that there is no more."""

WORKER = """
import json, os, resource, sys, time, traceback, warnings
resource.setrlimit(resource.RLIMIT_AS, ({addresses}, {addresses}))
answers = os.fdopen(os.dup(1), "w")
from pipelines.cli.main import run_command
def used():
    return resource.getrusage(resource.RUSAGE_SELF)
for line in sys.stdin:
    asked = json.loads(line)
    os.chdir(asked["folder"])
    os.environ.update(asked["environment"])
    for number, name in ((1, asked["out"]), (2, asked["err"])):
        file = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    with open("/proc/self/clear_refs", "w") as peak:
        peak.write("5")
    before, ended = used(), None
    with warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        warnings.simplefilter("always", UserWarning)
        try:
            ended = run_command(asked["arguments"])
        except BaseException:
            traceback.print_exc()
    after = used()
    sys.stdout.flush(); sys.stderr.flush()
    with open("/proc/self/status") as status:
        peak = next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    for name in asked["environment"]:
        del os.environ[name]
    print(json.dumps({{"status": ended, "seconds": seconds, "peak": peak}}), file=answers, flush=True)
"""


@dataclass(frozen=True)
class Ended:
    """How an argument line ended."""

    status: int | None
    """None where it ended in a traceback, or with its process."""
    seconds: float
    peak: int
    """Bytes of memory."""
    out: str
    err: str

    def broken(self) -> str | None:
        """What is wrong with the end of a command, whatever it was given; None where nothing is."""
        if self.status not in (0, 1, 2, 3):
            return f"ended with {self.status}"
        for word in ("Traceback", "Warning:", "out of memory"):
            if word in self.err:
                return f"said {word}"
        if self.status in (2, 3) and "footscan: " not in self.err and '"problem"' not in self.out + self.err:
            return "was refused without a word" if not self.out else None
        if self.seconds > SECONDS:
            return f"took {self.seconds:.1f} s"
        return f"took {self.peak / 1e6:.0f} MB" if self.peak > BYTES else None


class BoundedCommand:
    """Runs argument lines in a process of its own; another one takes its place where it dies or hangs."""

    def __init__(self, place: Path, longest_s: float = 120.0) -> None:
        self._place, self._longest_s = place, longest_s
        self._process: subprocess.Popen[str] | None = None

    def run(self, arguments: list[str], folder: Path, **environment: str) -> Ended:
        """`footscan ARGUMENTS` as it is called within `folder`."""
        process = self._process = self._process or self._started()
        out, err = self._place / "out", self._place / "err"
        asked: dict[str, Any] = {"arguments": arguments, "folder": str(folder), "environment": environment}
        assert process.stdin
        assert process.stdout
        process.stdin.write(json.dumps(asked | {"out": str(out), "err": str(err)}) + "\n")
        process.stdin.flush()
        line = process.stdout.readline() if self._answers() else ""
        told = [file.read_text(errors="replace") for file in (out, err)]
        if not line:
            self.close()
            return Ended(None, self._longest_s, 0, *told)
        answer = json.loads(line)
        return Ended(answer["status"], answer["seconds"], answer["peak"], *told)

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _answers(self) -> bool:
        import select

        assert self._process
        assert self._process.stdout
        return bool(select.select([self._process.stdout], [], [], self._longest_s)[0])

    def _started(self) -> "subprocess.Popen[str]":
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
        return subprocess.Popen(
            [sys.executable, "-c", WORKER.format(addresses=ADDRESSES)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **threads},
        )

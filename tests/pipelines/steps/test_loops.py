"""`footscan/loops.json` lists the argument types with which a scan calls its compiled loops.

After an intended change, `FOOTSCAN_WRITE_LOOPS=WORKFLOW pytest tests/pipelines/steps/test_loops.py` writes the list
anew: of a small scan, and of what the workflow runs, such as the demo's scan. Its results must be gone before.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

RUN = """
import json, sys, time
from pathlib import Path
from numba.core import event
from numba.core.registry import CPUDispatcher
from footscan.ahead_of_time import spec_of
from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.engine.pool import Threads

class Timer(event.Listener):
    def on_start(self, started):
        started.data["dispatcher"].footscan_started = time.process_time()
    def on_end(self, ended):
        loop = ended.data["dispatcher"]
        loop.footscan_seconds = time.process_time() - loop.footscan_started

event.register("numba:compile", Timer())
for workflow in sys.argv[1:]:
    for end in run_job(plan_job(job_of_workflow(Path(workflow))), Threads(1), lambda _: None):
        assert end.problem is None, end.problem
loops = []
for name, module in sorted(sys.modules.items()):
    for value in list(vars(module).values()) if name.startswith("footscan.") else []:
        if isinstance(value, CPUDispatcher) and value.py_func.__module__ == name:
            for types in value.signatures:
                loop = [name, value.__name__, [spec_of(part) for part in types]]
                loops.append((getattr(value, "footscan_seconds", 0.0), loop))
print(json.dumps([loop for _, loop in sorted(loops, key=lambda each: -each[0])]))
"""


def called(workflows: list[Path], cache: Path | None) -> list[Any]:
    """The loops that runs load or compile; with an empty `cache` those that take longest to compile come first."""
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    command = [sys.executable, "-c", RUN, *map(str, workflows)]
    loops: list[Any] = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment).stdout)
    return loops


def test_all_loops_of_a_scan_are_listed(archive: Any, tmp_path: Path) -> None:
    place = Path(str(files("footscan").joinpath("loops.json")))
    if further := os.environ.get("FOOTSCAN_WRITE_LOOPS"):
        workflows = [Path(further).resolve(), archive.workflow]
        slowest_first = called(workflows, tmp_path / "cache")  # and the loops that others call
        for workflow in workflows:
            shutil.rmtree(workflow.parent / "results")
        from_python = called(workflows, tmp_path / "cache")
        lines = ",\n".join(json.dumps(loop) for loop in slowest_first if loop in from_python)
        place.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    listed = json.loads(place.read_text("utf-8"))
    assert [loop for loop in called([archive.workflow], None) if loop not in listed] == [], __doc__

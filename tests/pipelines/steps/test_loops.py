"""`footscan/loops.json` and `footscan/virtual/loops.json` list the argument types of compiled loops.

They are the loops that Python calls in a scan, and in the virtual scanner. After an intended change,
`FOOTSCAN_WRITE_LOOPS=WORKFLOW pytest tests/pipelines/steps/test_loops.py` writes both lists anew: of a small scan and
of what the workflow runs, such as the demo's scan, whose results must be gone before; and of pictures of a foot.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

MEASURE = """
from pathlib import Path
from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.engine.pool import Threads

for workflow in sys.argv[2:]:
    for end in run_job(plan_job(job_of_workflow(Path(workflow))), Threads(1), lambda _: None):
        assert end.problem is None, end.problem
"""
FILM = """
from footscan.virtual.filming.render import CameraRenderer
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import SKIN, Mesh, Scene
from footscan.virtual.optics.texture import random_texture
from pipelines.live.virtual.world import World, virtual_foot
from schemas.parameters.simulation import SimulationSettings

foot = virtual_foot(World(pictures=""), "right")
scene, settings = Scene(Mesh(foot.vertices, foot.faces.astype("int64")), SKIN), SimulationSettings()
for camera in range(1, 9):
    renderer = CameraRenderer(standard_scanner(1), camera, settings, random_texture(1, 0.1))
    renderer.jpeg(scene, 100.0, 0)
"""
COLLECT = """
import json, sys, time
from numba.core import event
from numba.core.registry import CPUDispatcher
from footscan.ahead_of_time import spec_of

class Timer(event.Listener):
    def on_start(self, started):
        started.data["dispatcher"].footscan_started = time.process_time()
    def on_end(self, ended):
        loop = ended.data["dispatcher"]
        loop.footscan_seconds = time.process_time() - loop.footscan_started

event.register("numba:compile", Timer())
exec(sys.argv[1])
loops = []
for name, module in sorted(sys.modules.items()):
    for value in list(vars(module).values()) if name.startswith("footscan.") else []:
        if isinstance(value, CPUDispatcher) and value.py_func.__module__ == name:
            for types in value.signatures:
                loop = [name, value.__name__, [spec_of(part) for part in types]]
                loops.append((getattr(value, "footscan_seconds", 0.0), loop))
print(json.dumps([loop for _, loop in sorted(loops, key=lambda each: -each[0])]))
"""


def called(work: str, workflows: list[Path], cache: Path | None) -> list[Any]:
    """The loops that work loads or compiles; with an empty `cache` those that take longest to compile come first."""
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    command = [sys.executable, "-c", COLLECT, work, *map(str, workflows)]
    loops: list[Any] = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment).stdout)
    return loops


def check(name: str, work: str, workflows: list[Path], tmp_path: Path) -> None:
    """Check that a list has the loops of some work; workflows in front of the last are run to write it anew."""
    place = Path(str(files("footscan").joinpath(name)))
    if "FOOTSCAN_WRITE_LOOPS" in os.environ:
        slowest_first = called(work, workflows, tmp_path / "cache")  # and the loops that others call
        for workflow in workflows:
            shutil.rmtree(workflow.parent / "results")
        from_python = called(work, workflows, tmp_path / "cache")
        lines = ",\n".join(json.dumps(loop) for loop in slowest_first if loop in from_python)
        place.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    listed = json.loads(place.read_text("utf-8"))
    assert [loop for loop in called(work, workflows[-1:], None) if loop not in listed] == [], __doc__


def test_all_loops_of_a_scan_are_listed(archive: Any, tmp_path: Path) -> None:
    further = os.environ.get("FOOTSCAN_WRITE_LOOPS")
    workflows = [archive.workflow] if further is None else [Path(further).resolve(), archive.workflow]
    check("loops.json", MEASURE, workflows, tmp_path)


def test_all_loops_of_the_virtual_scanner_are_listed(tmp_path: Path) -> None:
    check("virtual/loops.json", FILM, [], tmp_path)

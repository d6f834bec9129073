"""Archives as the command runs them: when all is done, as they arrive, how much memory they take, on how many workers.

    .venv/bin/python -m benchmarks.archive [SCAN] [warm | watch | memory | workers]

SCAN is the scan of a folder that `footscan demo` made; of its films every fifth frame makes small scans, and all frames
those of `workers`.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import psutil

from benchmarks.compare import interleave, print_ratios, python, ratio_text, spread
from footscan.frames.film import open_film
from footscan.recordings.scans import read_scan
from footscan.virtual.filming.film import write_film

DEFAULT = Path("demo/archive/P0001/demo-R")
EVERY = 5
"""Of the frames of a small scan."""
ROUNDS = 5
COLD_SCANS, COLD_ROUNDS = 8, 2
QUIET_S = 60.0
"""For so long the processor time of a watch is counted."""

WORKFLOW = "format: footscan.workflow/1\narchive: archive\ncalibration: calibration.json\nresults: results\n"
COMMAND = "from pipelines.cli.main import main; main()"
BLANK_REPORTS = "from pipelines.steps import report; report.run = lambda *_: b'<!doctype html>'; "
PLANNING = """
import sys, time
start = time.perf_counter()
from pathlib import Path
from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import plan_job
imported = time.perf_counter()
planned = plan_job(job_of_workflow(Path(sys.argv[1])))
print(imported - start, time.perf_counter() - imported, planned.steps, planned.to_run)
"""


def main() -> None:
    given = [argument for argument in sys.argv[1:] if argument not in PARTS]
    scan = Path(given[0] if given else DEFAULT).resolve()
    for part in [argument for argument in sys.argv[1:] if argument in PARTS] or list(PARTS):
        PARTS[part](scan)


def time_warm(scan: Path) -> None:
    """Archives that are done: the whole command beside an empty process of Python."""
    for cameras, scans in ((8, 1), (2, 1000), (8, 1000)):
        with tempfile.TemporaryDirectory() as place:
            _time_warm(scan, Path(place), cameras, scans)


def measure_watch(scan: Path) -> None:
    """`footscan run --watch` over 1000 scans that are done: processor time while nothing arrives."""
    with tempfile.TemporaryDirectory() as place:
        workflow = _done_archive(scan, Path(place), 8, 1000)
        line = [sys.executable, "-c", COMMAND, "run", str(workflow), "--watch"]
        with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            watching = psutil.Process(process.pid)
            while _processor_s(watching, QUIET_S / 6) > QUIET_S / 60:
                pass
            used = _processor_s(watching, QUIET_S)
            process.terminate()
    print(f"\nWatching 1000 scans: {used / QUIET_S:.2%} of a core over {QUIET_S:.0f} s")


def measure_memory(scan: Path) -> None:
    """Peak memory of cold archives of 10 and of 300 scans of two cameras, no two films alike, in turn."""
    peaks: dict[int, list[float]] = {10: [], 300: []}
    for _ in range(2):
        for scans, found in peaks.items():
            with tempfile.TemporaryDirectory() as place:
                workflow = _draw_archive(scan, Path(place), 2, scans)
                found.append(_peak_mb("-c", COMMAND, "run", str(workflow), "--threads", "2"))
    few, many = (np.array(found) for found in peaks.values())
    print("\nPeak memory of a cold archive on two threads, MB: median (range)")
    print(f"  {'10 scans':<44}{spread(list(few), 0)}   baseline")
    print(f"  {'300 scans':<44}{spread(list(many), 0)}   {ratio_text(many / few)}")


def time_workers(scan: Path) -> None:
    """A cold archive of whole scans of eight cameras: one worker, two, and two threads, in turn; and how much of both
    cores they use."""
    with tempfile.TemporaryDirectory() as place:
        workflow = _draw_archive(scan, Path(place), 8, COLD_SCANS, every=1)
        runs = {
            text: partial(_run_cold, workflow, *text.split()) for text in ("--workers 1", "--workers 2", "--threads 2")
        }
        used: dict[str, list[float]] = {name: [] for name in runs}

        def counted(name: str) -> None:
            before, start = _children_s(), time.perf_counter()
            runs[name]()
            used[name].append((_children_s() - before) / (time.perf_counter() - start))

        seconds = interleave({name: partial(counted, name) for name in runs}, COLD_ROUNDS)
    print_ratios(f"A cold archive of {COLD_SCANS} scans of 8 cameras", seconds, COLD_SCANS, "scan")
    for name, cores in used.items():
        print(f"  {name:<44}{spread(cores, 2)} cores used")


PARTS = {"warm": time_warm, "watch": measure_watch, "memory": measure_memory, "workers": time_workers}


def _time_warm(scan: Path, place: Path, cameras: int, scans: int) -> None:
    workflow = _done_archive(scan, place, cameras, scans)
    runs = {"python -c pass": lambda: python("-c", "pass")}
    for task in ("plan", "run"):
        runs[f"footscan {task}"] = partial(python, "-c", COMMAND, task, str(workflow))
    seconds = interleave(runs, ROUNDS)
    rows = np.array([python("-c", PLANNING, str(workflow)).split() for _ in range(ROUNDS)], float)
    steps, to_run = int(rows[0, 2]), int(rows[0, 3])
    if to_run:
        raise RuntimeError(f"{to_run} of {steps} steps to run, expected none")
    print(f"\nA warm archive, {scans} x {cameras} cameras, {steps} steps: seconds, median (range)")
    nothing = seconds.pop("python -c pass")
    times = {"python -c pass": nothing}
    times |= {f"{name}, beyond that": list(np.subtract(each, nothing)) for name, each in seconds.items()}
    times |= {"of this, imports": list(rows[:, 0]), "planning": list(rows[:, 1])}
    for name, each in times.items():
        print(f"  {name:<44}{spread(each, 2)}", flush=True)


def _done_archive(scan: Path, place: Path, cameras: int, scans: int) -> Path:
    """Copies of one small scan, all of which is done; returns their workflow."""
    workflow, first = _workflow(scan, place), place / "archive/P0001/S0001"
    _thin_out(scan, first, cameras)
    python("-c", COMMAND, "run", str(workflow))
    for number in range(2, scans + 1):
        _link_scan(first, number)
    # A thousand reports take minutes to draw, and what is in them makes no difference to a warm run.
    python("-c", BLANK_REPORTS + COMMAND, "run", str(workflow))
    time.sleep(2)  # what is younger than that is read again
    return workflow


def _draw_archive(scan: Path, place: Path, cameras: int, scans: int, every: int = EVERY) -> Path:
    """An archive of scans no two of which share a film; returns its workflow."""
    for number in range(1, scans + 1):
        folder = place / f"archive/P0001/S{number:04d}"
        _thin_out(scan, folder, cameras, f"scan {number}".encode(), number / 100, every)
    return _workflow(scan, place)


def _workflow(scan: Path, place: Path) -> Path:
    workflow = place / "workflow.yaml"
    workflow.write_text(WORKFLOW)
    shutil.copy(scan.parents[2] / "calibration.json", place)
    return workflow


def _thin_out(
    scan: Path, folder: Path, cameras: int, mark: bytes = b"", shift_mm: float = 0.0, every: int = EVERY
) -> None:
    """A scan of some of the frames and cameras of another, with a comment in each JPEG, and moved in X."""
    recorded = read_scan(scan)
    folder.mkdir(parents=True)
    travel = recorded.document.travel
    assert travel is not None, "the demo has it"
    lines = [
        "format: footscan.scan/1", "patient: P0001", f"scan: {folder.name}", f"side: {recorded.document.side}",
        f"travel: {{start_mm: {travel.start_mm + shift_mm}, step_mm: {every * travel.step_mm}}}", "cameras:",
    ]  # fmt: skip
    for camera in recorded.document.cameras[:: 8 // cameras]:
        film = open_film(recorded.film(camera))
        kept = film.stored(range(0, film.count, every))
        frames = [_commented(frame, mark) for frame in kept if isinstance(frame, bytes)]
        write_film(folder / f"cam{camera.id}.avi", frames, *film.size.px, 18)
        lines.append(f"- {{id: {camera.id}, file: cam{camera.id}.avi}}")
    (folder / "scan.yaml").write_text("\n".join(lines) + "\n")


def _commented(jpeg: bytes, text: bytes) -> bytes:
    """A JPEG with a comment (marker COM, ITU T.81, B.2.4.5) after its start."""
    return jpeg[:2] + b"\xff\xfe" + (len(text) + 2).to_bytes(2, "big") + text + jpeg[2:] if text else jpeg


def _link_scan(first: Path, number: int) -> None:
    """The same scan under another name; its frames are links, for a thousand copies would fill the disk."""
    folder = first.with_name(f"S{number:04d}")
    shutil.copytree(first, folder, copy_function=os.link)
    (folder / "scan.yaml").unlink()
    (folder / "scan.yaml").write_text((first / "scan.yaml").read_text().replace(first.name, folder.name))


def _run_cold(workflow: Path, *options: str) -> None:
    shutil.rmtree(workflow.parent / "results", ignore_errors=True)
    for frames in (workflow.parent / "archive").rglob("*.zarr"):
        shutil.rmtree(frames)
    python("-c", COMMAND, "run", str(workflow), *options)


def _children_s() -> float:
    """Seconds of processor time that the processes took that this one started, and that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _processor_s(process: psutil.Process, over_s: float) -> float:
    """Seconds of processor time that a process and its children take in so many seconds from now."""

    def taken_s() -> float:
        times = [each.cpu_times() for each in [process, *process.children(recursive=True)]]
        return sum(each.user + each.system for each in times)

    before = taken_s()
    time.sleep(over_s)
    return taken_s() - before


def _peak_mb(*arguments: str) -> float:
    """The most memory that a process of Python held."""
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"exit status {process.returncode}")
    return usage.ru_maxrss / 1e3


if __name__ == "__main__":
    main()

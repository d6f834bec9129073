"""How much memory this process holds, and held at most."""

import resource
import sys
from pathlib import Path

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def held_mb() -> float:
    """What it holds now, MB; its most so far where the system does not tell."""
    return _of_status("VmRSS") or peak_mb()


def peak_mb() -> float:
    """The most that it held since `forget_peak`, MB."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1e-6 if sys.platform == "darwin" else 1.024e-3)
    # The kernel's other figure, for it counts what the parent held before it started this program.
    return _of_status("VmHWM") or most


def forget_peak() -> None:
    """Begin anew to look for the most; where the system cannot, the most is that since the start."""
    try:
        _RESET.write_text("5")  # man 5 proc
    except OSError:
        return


def _of_status(name: str) -> float | None:
    try:
        lines = _STATUS.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return None
    return next((float(line.split()[1]) * 1.024e-3 for line in lines if line.startswith(f"{name}:")), None)

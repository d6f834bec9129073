"""Memory of this process: held now, and peak."""

import resource
import sys
from pathlib import Path

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def held_mb() -> float:
    """Memory held now, MB; the peak if the system does not report it."""
    return _of_status("VmRSS") or peak_mb()


def peak_mb() -> float:
    """Peak of the memory since `forget_peak`, MB."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1e-6 if sys.platform == "darwin" else 1.024e-3)
    # VmHWM is preferred: ru_maxrss includes the memory of the parent before it started this program.
    return _of_status("VmHWM") or most


def forget_peak() -> None:
    """Reset the peak; if the system cannot, it remains the peak since the start."""
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

"""Mechanics that are faster than those of a real scanner, for tests that wait for them."""

from footscan.capture.grbl.settings import required_settings
from schemas.rig import RigBoard

QUICK = RigBoard(
    mm_per_s2=(4000.0, 4000.0, 4000.0),
    max_mm_per_s=(200.0, 200.0, 200.0),
    homing_mm_per_s=100.0,
    homing_slow_mm_per_s=40.0,
)
SETTINGS = {**required_settings(QUICK), 26: 5}
"""Of a virtual board: those of the rig, and a short debounce of its switches."""
YAML = f"board: {QUICK.model_dump_json(exclude_defaults=True)}"
"""The line in `rig.yaml`."""

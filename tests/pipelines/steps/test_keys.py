"""The key of each step covers the libraries and modules listed in `keys.txt` beside this file.

After an intended change, `FOOTSCAN_WRITE_KEYS=1 pytest tests/pipelines/steps/test_keys.py` writes the file anew. Its
diff shows the cost of the change: a step whose lines change loses all hits once.
"""

import difflib
import os
from pathlib import Path

import pytest

from pipelines.engine.actions.code import code_identity

LIST = Path(__file__).with_name("keys.txt")
STEPS = sorted(
    path.stem for path in (Path(__file__).parents[3] / "pipelines/steps").glob("*.py") if path.stem != "__init__"
)
MAY_REACH = {"pipelines", "pipelines.arrays", "pipelines.scan_evidence", "pipelines.steps"}


def lines_of(step: str) -> list[str]:
    """The libraries of a step in one line, and the modules that it reaches, room by room."""
    identity = code_identity(f"pipelines.steps.{step}")
    rooms: dict[str, list[str]] = {}
    for module in identity.modules:
        room, _, name = module.rpartition(".")
        rooms.setdefault(room, []).append(name)
    libraries = " ".join(sorted(set(identity.libraries) - {"python"}))
    modules = [f"  {room}: {' '.join(sorted(names))}" for room, names in sorted(rooms.items()) if room]
    return [f"{step}: {libraries}", *modules]


def test_keys_stand_for_what_the_list_says() -> None:
    actual = [line for step in STEPS for line in lines_of(step)]
    if os.environ.get("FOOTSCAN_WRITE_KEYS"):
        LIST.write_text("\n".join(actual) + "\n", encoding="utf-8")
    expected = LIST.read_text(encoding="utf-8").splitlines()
    difference = list(difflib.unified_diff(expected, actual, "keys.txt", "the code", lineterm="", n=1))
    assert not difference, "\n".join(
        ["the keys of steps stand for other code or libraries:", *difference, __doc__ or ""]
    )


@pytest.mark.parametrize("step", STEPS)
def test_a_step_reaches_the_packing_of_arrays_and_nothing_else_of_the_dataflow(step: str) -> None:
    modules = code_identity(f"pipelines.steps.{step}").modules
    assert {name for name in modules if name.startswith("pipelines")} <= MAY_REACH | {f"pipelines.steps.{step}"}

"""The loops of a scan are loaded before they are called."""

import importlib
import json
import subprocess
import sys
from importlib.resources import files

COUNT = """
import importlib, json
from footscan.ahead_of_time import load_all

load_all()
listed = json.loads('''{listed}''')
print(json.dumps([len(getattr(importlib.import_module(module), name).signatures) for module, name, _ in listed]))
"""


def test_all_listed_loops_are_loaded_into_the_process() -> None:
    listed = json.loads(files("footscan").joinpath("loops.json").read_text("utf-8"))
    assert all(hasattr(importlib.import_module(module), name) for module, name, _ in listed)
    command = [sys.executable, "-c", COUNT.format(listed=json.dumps(listed))]
    loaded = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    assert len(loaded) == len(listed)
    assert min(loaded) >= 1

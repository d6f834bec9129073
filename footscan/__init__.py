"""The science: arrays in, arrays out. Knows nothing of Dask, of the cache or of the command line.

`footscan.open_scan`, `footscan.measure` and `footscan.results` are for notebooks and scripts, see docs/python.md.
"""

from importlib import import_module
from typing import Any

PUBLIC = {"open_scan": "scan", "results": "results_table"}
"""Functions, and the modules that they are in."""


def __getattr__(name: str) -> Any:
    """Imported when first asked for: a step, which uses one module, neither loads the others nor depends on them."""
    if name in PUBLIC:
        return getattr(import_module(f"footscan.{PUBLIC[name]}"), name)
    raise AttributeError(f"module 'footscan' has no attribute {name!r}")

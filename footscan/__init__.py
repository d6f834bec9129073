"""The science: arrays in, arrays out. Knows nothing of Dask, of the cache or of the command line.

`footscan.open_scan`, `footscan.measure` and `footscan.results` are for notebooks and scripts, see docs/python.md.
"""

from importlib import import_module
from typing import Any

__all__ = ["open_scan", "results"]


def __getattr__(name: str) -> Any:
    """Imported when first asked for: a step, which uses one module, neither loads the others nor depends on them."""
    if name in __all__:
        return getattr(import_module("footscan.public"), name)
    raise AttributeError(f"module 'footscan' has no attribute {name!r}")

"""Open3D without Dash, Plotly and IPython, which draw its plots and take as long to load as Open3D itself.

>>> len(o3d.geometry.TriangleMesh.create_box().triangles)
12
"""

import importlib
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

PLOTS = "open3d.visualization.draw_plotly"


class _LoadedWhenCalled(ModuleType):
    """Stands for the module of the plots until one of its functions is called."""

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("__"):
            raise AttributeError(name)

        def call(*arguments: Any, **named: Any) -> Any:
            if sys.modules.get(PLOTS) is self:
                del sys.modules[PLOTS]
            return getattr(importlib.import_module(PLOTS), name)(*arguments, **named)

        return call


if "open3d" not in sys.modules:
    sys.modules[PLOTS] = _LoadedWhenCalled(PLOTS)

import open3d as o3d  # noqa: E402 (what stands for its plots must be there first)

__all__ = ["o3d"]

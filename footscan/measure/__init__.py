"""Landmarks, lengths, girths, footprint, volume. `footscan.measure(mesh)` calls `any_mesh.measure`."""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Package(ModuleType):
    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return import_module("footscan.measure.any_mesh").measure(*arguments, **options)


sys.modules[__name__].__class__ = _Package

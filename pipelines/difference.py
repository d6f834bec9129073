"""The difference of two results of a step in words."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipelines.arrays import unpack
from schemas.base.errors import DamagedError, RefusedInput
from schemas.base.json_files import parse_json

SHOWN = 3
"""Most arrays or fields that are named; chosen by hand."""


def difference_in_words(old: bytes, new: bytes) -> str:
    """Describe the arrays or document fields in which two results differ, with the largest difference of numbers.

    Examples
    --------
    >>> difference_in_words(b'{"length": 250.0, "side": "left"}', b'{"length": 250.5, "side": "left"}')
    'length 250.0 -> 250.5'
    """
    for differences in (_of_arrays, _of_documents):
        try:
            changes = list(differences(old, new))
        except (DamagedError, RefusedInput, UnicodeDecodeError):
            continue
        more = f" and {len(changes) - SHOWN} more" if len(changes) > SHOWN else ""
        return ", ".join(changes[:SHOWN]) + more if changes else "the same values, written differently"
    return f"{len(old)} bytes -> {len(new)} bytes"


def _of_arrays(old: bytes, new: bytes) -> Iterator[str]:
    before, after = _fields(unpack(old)), _fields(unpack(new))
    for name in sorted(before.keys() | after.keys()):
        if name not in before or name not in after:
            yield f"{name} {'is missing' if name in before else 'is new'}"
            continue
        a, b = before[name], after[name]
        if a.shape != b.shape or a.dtype != b.dtype:
            yield f"{name} {a.dtype}{list(a.shape)} -> {b.dtype}{list(b.shape)}"
            continue
        differs = a != b
        if a.dtype.kind == "f":
            differs &= ~(np.isnan(a) & np.isnan(b))
        if differs.any():
            yield f"{name}: {int(differs.sum())} of {a.size} values{_at_most(a[differs], b[differs])}"


def _fields(arrays: dict[str, np.ndarray[Any, Any]]) -> dict[str, np.ndarray[Any, Any]]:
    """Arrays by name; a field of a structured array has the name `array.field`."""
    plain: dict[str, np.ndarray[Any, Any]] = {}
    for name, array in arrays.items():
        fields = array.dtype.names
        plain |= {name: array} if fields is None else {f"{name}.{field}": array[field] for field in fields}
    return plain


def _at_most(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> str:
    if a.dtype.kind not in "fiu":
        return ""
    distance = np.abs(a.astype(np.float64) - b.astype(np.float64))
    return f" by at most {float(np.max(distance)):.3g}"


def _of_documents(old: bytes, new: bytes) -> Iterator[str]:
    before, after = dict(_leaves(parse_json("old", old.decode()))), dict(_leaves(parse_json("new", new.decode())))
    for name in before | after:
        if name not in before or name not in after:
            yield f"{name} {'is missing' if name in before else 'is new'}"
        elif before[name] != after[name]:
            yield f"{name} {before[name]} -> {after[name]}"


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Scalar values of a document, by their dotted names."""
    if not isinstance(value, dict | list):
        yield name, value
        return
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield from _leaves(inner, f"{name}.{key}" if name else str(key))

"""Differences of arrays, of documents and of other files in words."""

import numpy as np
import pytest

from pipelines.arrays import pack
from pipelines.difference import difference_in_words


def test_arrays_are_named_with_their_largest_difference() -> None:
    points = np.array([[1.0, 2.0, np.nan], [4.0, 5.0, 6.0]])
    moved = points + np.array([[0, 0.25, 0], [0, 0, -0.5]])
    old, new = pack(points=points, camera=np.array([1, 2])), pack(points=moved, camera=np.array([1, 2]))
    assert difference_in_words(old, new) == "points: 2 of 6 values by at most 0.5"
    assert difference_in_words(old, old) == "the same values, written differently"


def test_fields_of_structured_arrays() -> None:
    points = np.zeros(3, [("xyz", float, 3), ("camera", np.uint8)])
    moved = points.copy()
    moved["xyz"][1, 2] = 1e-9
    assert difference_in_words(pack(points=points), pack(points=moved)) == "points.xyz: 1 of 9 values by at most 1e-09"


def test_arrays_of_another_shape_or_name() -> None:
    old, new = pack(points=np.zeros((4, 3)), x=np.zeros(1)), pack(points=np.zeros((5, 3)), y=np.zeros(1))
    assert difference_in_words(old, new) == "points float64[4, 3] -> float64[5, 3], x is missing, y is new"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b'{"a": {"b": [1, 2]}}', b'{"a": {"b": [1, 3]}}', "a.b.1 2 -> 3"),
        (b'{"a": 1}', b'{"b": 1}', "a is missing, b is new"),
        (b"[1, 2, 3, 4, 5]", b"[2, 3, 4, 5, 6]", "0 1 -> 2, 1 2 -> 3, 2 3 -> 4 and 2 more"),
        (b"ply\xff", b"ply\xff\xfe", "4 bytes -> 5 bytes"),
    ],
)
def test_documents_and_other_files(old: bytes, new: bytes, words: str) -> None:
    assert difference_in_words(old, new) == words

"""Equal rows of a table."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footscan.rows import distinct_rows


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(1, 60), columns=st.integers(1, 4), values=st.integers(1, 5))
@pytest.mark.parametrize("kind", [np.int64, np.int32, np.float64])
def test_as_numpy_finds_them(kind: type, seed: int, rows: int, columns: int, values: int) -> None:
    table = np.random.default_rng(seed).integers(-values, values, (rows, columns)).astype(kind) / kind(1)
    found = distinct_rows(table)
    expected = np.unique(table, axis=0, return_index=True, return_inverse=True, return_counts=True)
    for of_ours, of_numpy in zip(found, expected, strict=True):
        assert np.array_equal(of_ours, of_numpy.reshape(of_ours.shape))
    assert np.array_equal(found.rows[found.number], table)


def test_an_empty_table() -> None:
    found = distinct_rows(np.zeros((0, 3)))
    assert [len(part) for part in found] == [0, 0, 0, 0]

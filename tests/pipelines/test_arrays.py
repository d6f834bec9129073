"""Arrays as bytes and back."""

import io
import pickle
import subprocess
import sys

import numpy as np
import pytest

from footscan.cloud.points import POINT_DTYPE
from pipelines.arrays import pack, unpack
from schemas.base.errors import DamagedError


def test_arrays_come_back() -> None:
    given = {
        "points": np.zeros(3, POINT_DTYPE),
        "empty": np.empty((0, 3)),
        "turned": np.arange(6, dtype=np.int32).reshape(2, 3).T,
    }
    found = unpack(pack(**given))
    assert list(found) == list(given)
    for name, array in given.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)


def test_bytes_are_the_same_in_another_process() -> None:
    program = (
        "import sys, numpy as np; from pipelines.arrays import pack\n"
        "sys.stdout.buffer.write(pack(a=np.arange(5.0), b=np.eye(2, dtype='u1')))"
    )
    there = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True).stdout
    assert pack(a=np.arange(5.0), b=np.eye(2, dtype="u1")) == there


def test_nothing_that_could_run_is_packed_or_unpacked() -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        pack(thing=np.array([object()]))
    out = io.BytesIO()
    np.savez(out, thing=np.array([print], dtype=object))
    for data in (out.getvalue(), pickle.dumps([1])):
        with pytest.raises(DamagedError, match="expected packed arrays"):
            unpack(data)


def test_torn_archives_are_damaged() -> None:
    whole = pack(a=np.arange(100.0))
    for length in (4, 50, len(whole) // 2, len(whole) - 1):
        with pytest.raises(DamagedError, match="expected packed arrays"):
            unpack(whole[:length])

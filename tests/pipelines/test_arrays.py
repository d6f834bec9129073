"""Arrays as bytes and back."""

import gc
import io
import pickle
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

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


def test_the_bytes_are_those_of_numpy() -> None:
    given = {"points": np.ones(3, POINT_DTYPE), "text": np.array(["foot"]), "one": np.float64([2.5])}
    out = io.BytesIO()
    np.savez(out, allow_pickle=False, **given)
    assert pack(**given) == out.getvalue()


def test_bytes_are_the_same_in_another_process() -> None:
    program = (
        "import sys, numpy as np; from pipelines.arrays import pack\n"
        "sys.stdout.buffer.write(pack(a=np.arange(5.0), b=np.eye(2, dtype='u1')))"
    )
    there = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True).stdout
    assert pack(a=np.arange(5.0), b=np.eye(2, dtype="u1")) == there


def test_nothing_that_could_run_is_packed_or_unpacked() -> None:
    with pytest.raises(ValueError, match="thing is an array of objects"):
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


@pytest.fixture
def busy_collector() -> Iterator[None]:
    """Garbage is collected after every few objects, and other threads run meanwhile."""
    interval, thresholds = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(30, 1, 1)
    gc.callbacks.append(run_for_a_while)
    yield
    gc.callbacks.remove(run_for_a_while)
    gc.set_threshold(*thresholds)
    sys.setswitchinterval(interval)


def run_for_a_while(*_: object) -> None:
    sum(range(300))


@pytest.mark.usefixtures("busy_collector")
def test_threads_unpack_at_the_same_time() -> None:
    """Python 3.11 counts the depth of syntax trees, such as `numpy.load` builds, once for all threads."""
    data = pack(points=np.zeros(3, POINT_DTYPE), vertices=np.zeros((3, 3)))
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda _: list(unpack(data)), range(500)))
    assert found == [["points", "vertices"]] * 500

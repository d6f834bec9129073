"""Machine code lies in one place of the user's own, whoever imports what at once; what others can write is not loaded.

Each test starts processes: what is imported once is not imported again.
"""

import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

LOOPS = """
from footscan.compiled import compiled
from room.constant import FACTOR

@compiled
def scaled(value):
    return FACTOR * value
"""
CALL = """
import logging
logging.basicConfig(format="%(message)s")
from room.loops import scaled
result = scaled(3)
hits = sum(scaled.stats.cache_hits.values())
print(result, hits)
"""
SIDE_BY_SIDE = """
import importlib, sys, threading
sys.setswitchinterval(1e-6)
ROOMS = {
    "footscan.stripe.centre", "footscan.stripe.ridge", "footscan.mesh.voxels", "footscan.cloud.normals",
    "footscan.measure.hull", "footscan.measure.outline", "footscan.surface.poisson", "footscan.surface.texture",
    "footscan.virtual.optics.scene", "footscan.virtual.optics.texture", "footscan.calibration.models.fit",
    "footscan.report.render",
}
import numba, scipy.spatial, scipy.ndimage, scipy.optimize, scipy.sparse.linalg, PIL.Image
from numba.core.dispatcher import Dispatcher
together = threading.Barrier(len(ROOMS))
def load(name):
    together.wait()
    importlib.import_module(name)
threads = [threading.Thread(target=load, args=[name]) for name in ROOMS]
for thread in threads: thread.start()
for thread in threads: thread.join()
for name, module in sorted(sys.modules.items()):
    for value in list(vars(module).values()) if name.startswith("footscan.") else []:
        if isinstance(value, Dispatcher) and value.py_func.__module__ == name:
            print(name, value.stats.cache_path)
print("config", numba.config.CACHE_DIR)
"""


class Bomb:
    """Runs code when it is read as a pickle."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self._mark,)


class Checkout:
    """A folder with a room `room`, and processes that use it."""

    def __init__(self, root: Path, cache: Path) -> None:
        self.root, self.cache = root, cache
        (root / "room").mkdir(parents=True)
        (root / "elsewhere").mkdir()
        (root / "room/__init__.py").touch()
        (root / "room/loops.py").write_text(LOOPS)
        self.set_factor(2)

    def set_factor(self, factor: int) -> None:
        (self.root / "room/constant.py").write_text(f"FACTOR = {factor}\n")

    def run(self, script: str = CALL, **environment: str) -> tuple[list[str], str]:
        """Lines that a process prints, and what it says, in a folder of its own."""
        kept = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
        known = {**kept, "PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1", **environment}
        if not environment:
            known["XDG_CACHE_HOME"] = str(self.cache)
        ended = subprocess.run(
            [sys.executable, "-c", script],
            check=False,
            cwd=self.root / "elsewhere",
            env=known,
            capture_output=True,
            text=True,
        )
        assert ended.returncode == 0, ended.stderr
        return ended.stdout.splitlines(), ended.stderr


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path / "one", tmp_path / "cache")


def kept_in(folder: Path) -> set[Path]:
    return {path.parent for path in folder.rglob("*.nbi")}


def test_it_is_kept_in_the_users_cache_and_nowhere_else(checkout: Checkout, tmp_path: Path) -> None:
    assert checkout.run() == (["6 0"], "")
    assert checkout.run() == (["6 1"], "")
    [folder] = kept_in(tmp_path)
    place = checkout.cache / "footscan/compiled"
    assert folder.parent == place
    for one in (checkout.cache, checkout.cache / "footscan", place, folder):
        assert one.stat().st_mode & 0o777 == 0o700
    assert list((checkout.root / "elsewhere").iterdir()) == []
    assert list((checkout.root / "room").glob("__pycache__")) == []


def test_another_place_can_be_given(checkout: Checkout, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    assert checkout.run(XDG_CACHE_HOME=".", HOME=str(tmp_path / "home")) == (["6 0"], "")  # XDG ignores relative ones
    assert {path.parent for path in kept_in(tmp_path)} == {tmp_path / "home/.cache/footscan/compiled"}
    assert checkout.run(NUMBA_CACHE_DIR=str(tmp_path / "given")) == (["6 0"], "")
    assert [path.parent for path in kept_in(tmp_path / "given")] == [tmp_path / "given"]
    assert list((checkout.root / "elsewhere").iterdir()) == []


def test_equal_checkouts_share_it_and_others_do_not(checkout: Checkout, tmp_path: Path) -> None:
    assert checkout.run() == (["6 0"], "")
    other = Checkout(tmp_path / "two", checkout.cache)
    os.utime(other.root / "room/loops.py", (1e9, 1e9))
    assert other.run() == (["6 1"], "")
    other.set_factor(5)
    assert other.run() == (["15 0"], "")
    assert checkout.run() == (["6 1"], "")


def test_old_machine_code_goes(checkout: Checkout) -> None:
    assert checkout.run() == (["6 0"], "")
    [old] = kept_in(checkout.cache)
    checkout.set_factor(5)
    assert checkout.run() == (["15 0"], "")
    assert len(kept_in(checkout.cache)) == 2
    os.utime(old, (1e9, 1e9))
    checkout.set_factor(7)
    assert checkout.run() == (["21 0"], "")
    assert len(kept_in(checkout.cache)) == 2
    assert not old.exists()


def test_machine_code_calls_that_of_another_folder_and_follows_its_changes(checkout: Checkout) -> None:
    other = checkout.root / "room/other"
    other.mkdir()
    (other / "__init__.py").touch()
    called = "from footscan.compiled import compiled\n\n@compiled\ndef doubled(value):\n    return 2 * value\n"
    (other / "called.py").write_text(called)
    loops = LOOPS.replace("FACTOR * value", "FACTOR * doubled(value)")
    (checkout.root / "room/loops.py").write_text("from room.other.called import (\n    doubled,\n)\n" + loops)
    assert checkout.run() == (["12 0"], "")
    assert checkout.run() == (["12 1"], "")
    (other / "called.py").write_text(called.replace("2 *", "3 *"))
    assert checkout.run() == (["18 0"], "")


@pytest.mark.parametrize("level", ["compiled", "room"])
def test_what_others_can_write_is_not_loaded(checkout: Checkout, tmp_path: Path, level: str) -> None:
    place = tmp_path / "given"
    assert checkout.run(NUMBA_CACHE_DIR=str(place)) == (["6 0"], "")
    for file in place.rglob("*.nb?"):
        file.write_bytes(pickle.dumps(Bomb(tmp_path / "went off")))
    open_to_others = [place] if level == "compiled" else [path for path in place.rglob("*") if path.is_dir()]
    for folder in open_to_others:
        folder.chmod(0o777)
    printed, said = checkout.run(NUMBA_CACHE_DIR=str(place))
    assert not (tmp_path / "went off").exists()
    assert printed == ["6 0"]
    assert said.count("\n") == 1
    assert "other users can write to it: machine code is not kept, and compiled at every start" in said


@pytest.mark.skipif(os.geteuid() != 0, reason="gives a folder to another user")
def test_what_belongs_to_another_is_not_loaded(checkout: Checkout, tmp_path: Path) -> None:
    assert checkout.run() == (["6 0"], "")
    [folder] = kept_in(tmp_path)
    os.chown(folder, 12345, 12345)
    for file in folder.iterdir():
        file.write_bytes(pickle.dumps(Bomb(tmp_path / "went off")))
    printed, said = checkout.run()
    assert (printed, (tmp_path / "went off").exists()) == (["6 0"], False)
    assert f"{folder}: belongs to another user" in said


def test_without_a_place_it_is_done_without(checkout: Checkout, tmp_path: Path) -> None:
    (tmp_path / "cache").touch()
    printed, said = checkout.run()
    assert (printed, said.count("\n")) == (["6 0"], 1)
    assert "Not a directory: machine code is not kept" in said or "File exists: machine code is not kept" in said


def test_many_threads_import_at_once(checkout: Checkout) -> None:
    """Of real rooms: functions are kept in the folder of their module, and no setting of numba's is touched."""
    printed, said = checkout.run(SIDE_BY_SIDE)
    *functions, setting = (line.split(" ", 1) for line in printed)
    assert (setting, said) == (["config", ""], "")
    assert len(functions) > 60
    for module, folder in functions:
        assert Path(folder).parent == checkout.cache / "footscan/compiled"
        assert Path(folder).name.startswith(f"{module}-")
    assert list((checkout.root / "elsewhere").iterdir()) == []
    shutil.rmtree(checkout.cache)

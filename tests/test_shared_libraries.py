"""Every shared library that the environment loads is on this machine: the next missing one is named with its file."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

SITE = Path(sysconfig.get_path("purelib"))
ELF = b"\x7fELF"
FILES_A_CALL = 24
"""`ldd` starts the loader once for each; several calls run at once."""

NOT_LOADED = {
    "open3d/open3d_torch_ops.so": "operators for PyTorch, which is not installed",
    "open3d/open3d_tf_ops.so": "operators for TensorFlow, which is not installed",
    "numba/np/ufunc/tbbpool.*.so": "numba's threads by TBB, an option; those of its own are taken",
    "numba/np/ufunc/omppool.*.so": "numba's threads by OpenMP, an option; those of its own are taken",
    "pymeshlab/lib/libQt5XcbQpa.so.5": "Qt's windows on a screen; pymeshlab opens none",
}
"""Files that are never loaded here, by a pattern below the packages, each with the reason."""
LOADED_WITH = {
    "libquadmath-*.so*": "scipy.libs: found by the file beside it that loads it",
}
"""Libraries that a wheel brings along and that are there when their users load them, though `ldd` does not see it."""


def test_every_library_that_is_loaded_is_there() -> None:
    if shutil.which("ldd") is None:
        pytest.skip("no ldd here")
    files = [file for file in _elf_files(SITE) if not _is_never_loaded(file)]
    files += [Path(sys.executable).resolve()]
    assert len(files) > 300, "expected the environment with all its extensions"
    for name in ("open3d/", "pymeshlab/lib/plugins/", "playwright/driver/node", "pyarrow/", "av/", "lib3mf/"):
        assert any(name in file.as_posix() for file in files), name
    assert _missing(files) == []


def test_what_is_left_out_is_there_to_be_left_out() -> None:
    """A pattern that fits nothing any more hides nothing, and goes."""
    for pattern in NOT_LOADED:
        assert any(SITE.glob(pattern)), pattern


def test_a_missing_library_is_named_with_its_file(tmp_path: Path) -> None:
    if shutil.which("ldd") is None:
        pytest.skip("no ldd here")
    sound = next(file for file in _elf_files(SITE / "numpy") if b"libm.so.6\0" in file.read_bytes())
    broken = tmp_path / "broken.so"
    broken.write_bytes(sound.read_bytes().replace(b"libm.so.6\0", b"libq.so.6\0"))
    broken.chmod(0o755)
    assert _missing([sound, broken]) == [f"{broken}: libq.so.6"]


def _elf_files(folder: Path) -> list[Path]:
    """Shared objects and executables below `folder`, links left out."""
    found = []
    for path, _, names in os.walk(folder):
        for name in names:
            file = Path(path, name)
            if (".so" in name or os.access(file, os.X_OK)) and not file.is_symlink() and _is_elf(file):
                found.append(file)
    return sorted(found)


def _is_elf(file: Path) -> bool:
    with file.open("rb") as opened:
        return opened.read(4) == ELF


def _is_never_loaded(file: Path) -> bool:
    return any(file.relative_to(SITE).match(pattern) for pattern in NOT_LOADED)


def _missing(files: Iterable[Path]) -> list[str]:
    """`file: library` of each library that the loader does not find."""
    given = list(map(str, files))
    calls = [given[start : start + FILES_A_CALL] for start in range(0, len(given), FILES_A_CALL)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        told = "\n".join(pool.map(_ldd, calls))
    missing, file = [], ""
    for line in told.splitlines():
        if header := re.fullmatch(r"(/.*):", line):
            file = header[1]
        elif (named := re.fullmatch(r"\s+(\S+) => not found", line)) and not _comes_along(named[1]):
            missing.append(f"{file}: {named[1]}")
    return missing


def _comes_along(library: str) -> bool:
    return any(Path(library).match(pattern) for pattern in LOADED_WITH)


def _ldd(files: list[str]) -> str:
    """What `ldd` says of files; two names at least, for only then it says each before its libraries."""
    call = ["ldd", *files, *(files[:1] if len(files) == 1 else [])]
    return subprocess.run(call, capture_output=True, text=True, check=False, timeout=120).stdout

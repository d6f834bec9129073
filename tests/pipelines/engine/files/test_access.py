"""Written files are accessible to their owner only, or also to a group, from the moment they are made."""

import grp
import os
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipelines.cli.main import run_command
from pipelines.engine.files.access import group_number, keep_private, share
from pipelines.engine.files.atomic import write_atomically
from schemas.base.errors import Fault, RefusedInput

FOOTSCAN = Path(sys.executable).with_name("footscan")


@pytest.fixture
def umask() -> Iterator[None]:
    """Umask of the process: 022 during the test, restored after it."""
    before = os.umask(0o022)
    yield
    os.umask(before)


@pytest.fixture
def group() -> grp.struct_group:
    """A group that new files do not have by default."""
    mine = {os.getegid()}
    groups = [group for group in grp.getgrall() if group.gr_gid not in mine]
    if os.geteuid() != 0:
        groups = [group for group in groups if group.gr_gid in os.getgroups()]
    if not groups:
        pytest.skip("this user is in one group only")
    return groups[0]


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def wrong(root: Path, folder_mode: int, file_mode: int) -> dict[str, str]:
    """Paths at or below a folder with other rights."""
    paths = [root, *(path for path in root.rglob("*"))]
    assert len(paths) > 1
    expected = {path: folder_mode if path.is_dir() else file_mode for path in paths}
    return {str(path.relative_to(root)): oct(mode(path)) for path in paths if mode(path) != expected[path]}


def footscan(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command as a separate process, with the usual umask."""
    command = [str(part) for part in (FOOTSCAN, *arguments)]
    return subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=300, preexec_fn=lambda: os.umask(0o022) and None
    )


@pytest.mark.usefixtures("umask")
def test_files_are_never_for_all(tmp_path: Path) -> None:
    """Whoever uses the engine without the command; the umask then says whether they are for the group."""
    write_atomically(tmp_path / "a/b/c", b"data")
    assert [mode(tmp_path / name) for name in ("a", "a/b", "a/b/c")] == [0o750, 0o750, 0o640]
    keep_private()
    write_atomically(tmp_path / "d/e", b"data")
    assert wrong(tmp_path / "d", 0o700, 0o600) == {}


@pytest.mark.usefixtures("umask")
def test_parts_are_private_from_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_private()
    seen: list[int] = []
    replace = Path.replace

    def watched(path: Path, target: Path) -> Path:
        seen.append(mode(path))
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", watched)
    (tmp_path / "file").touch(0o666)
    stale = tmp_path / f".file.{os.getpid()}-{threading.get_ident()}.partial"
    stale.touch()
    stale.chmod(0o666)
    write_atomically(tmp_path / "file", b"data")
    assert (seen, mode(tmp_path / "file")) == ([0o600], 0o600)


@pytest.mark.usefixtures("umask")
def test_a_group_shares_what_is_there_and_what_comes(tmp_path: Path, group: grp.struct_group) -> None:
    (tmp_path / "old/sub").mkdir(parents=True)
    (tmp_path / "old/sub/file").write_text("data")
    (tmp_path / "elsewhere").write_text("data")
    (tmp_path / "old/link").symlink_to(tmp_path / "elsewhere")
    share([tmp_path / "old", tmp_path / "new"], group.gr_gid)
    write_atomically(tmp_path / "old/sub/more", b"data")
    write_atomically(tmp_path / "new/a/b", b"data")
    (tmp_path / "new/c").write_text("of a library")
    (tmp_path / "old/link").unlink()
    for folder in (tmp_path / "old", tmp_path / "new"):
        assert wrong(folder, 0o2770, 0o660) == {}
        assert {path.stat().st_gid for path in (folder, *folder.rglob("*"))} == {group.gr_gid}
    assert mode(tmp_path / "elsewhere") == 0o644
    share([tmp_path / "old"], None)
    assert mode(tmp_path / "old") == 0o2770


def test_groups_that_cannot_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, group: grp.struct_group) -> None:
    with pytest.raises(RefusedInput, match="group: expected a group of this machine, found 'no-such-group'"):
        group_number("no-such-group", tmp_path / "workflow.yaml")
    assert group_number(group.gr_name, tmp_path) == group.gr_gid
    monkeypatch.setattr(os, "geteuid", lambda: 4242)
    monkeypatch.setattr(os, "getgroups", lambda: [])
    with pytest.raises(RefusedInput, match="expected a group that you are in"):
        group_number(group.gr_name, tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(Fault, match="cannot be shared with its group"):
        share([tmp_path / "file/folder"], group.gr_gid)


def test_an_unknown_group_is_one_line(done: object, capsys: pytest.CaptureFixture[str]) -> None:
    workflow: Path = done.workflow  # type: ignore[attr-defined]
    workflow.write_text(workflow.read_text() + "group: no-such-group\n")
    assert run_command(["plan", str(workflow)]) == 2
    output = capsys.readouterr()
    problem = "group: expected a group of this machine, found 'no-such-group'"
    assert (output.out, output.err) == ("", f"footscan: {workflow}: {problem}\n")


@pytest.mark.parametrize("options", [[], ["--workers", 1]], ids=["threads", "workers"])
def test_a_whole_run_is_its_owners_alone(archive: object, tmp_path: Path, options: list[object]) -> None:
    root: Path = archive.root  # type: ignore[attr-defined]
    done = footscan("run", root / "workflow.yaml", "--log-json", tmp_path / "log.json", *options)
    assert done.returncode == 0, done.stderr
    assert wrong(root / "results", 0o700, 0o600) == {}
    assert wrong(root / "archive/P0001/S1/frames.zarr", 0o700, 0o600) == {}
    assert mode(tmp_path / "log.json") == 0o600


def test_a_whole_run_for_a_group(archive: object, group: grp.struct_group) -> None:
    root: Path = archive.root  # type: ignore[attr-defined]
    (root / "workflow.yaml").write_text((root / "workflow.yaml").read_text() + f"group: {group.gr_name}\n")
    done = footscan("run", root / "workflow.yaml")
    assert (done.returncode, "other users" in done.stderr) == (0, False), done.stderr
    for folder in (root / "results", root / "archive/P0001/S1/frames.zarr"):
        assert wrong(folder, 0o2770, 0o660) == {}
        assert {path.stat().st_gid for path in (folder, *folder.rglob("*"))} == {group.gr_gid}

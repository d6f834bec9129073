"""TLS connections to a scheduler, with the commands of docs/archives.md copied word for word."""

import contextlib
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pipelines.cli.main import run_command

BIN = Path(sys.executable).parent
PAGE = (Path(__file__).parents[3] / "docs/archives.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
Refusal = Callable[..., str]


def block_with(word: str) -> str:
    [block] = [block for block in BLOCKS if word in block]
    return block


def line_with(word: str, port: int) -> list[str]:
    """A command of the page, for this machine and a free port."""
    [line] = [line for line in block_with("--tls-key").splitlines() if f".venv/bin/{word}" in line]
    line = line.replace(".venv/bin/", f"{BIN}/").replace("one:8786", f"127.0.0.1:{port}")
    return shlex.split(line.replace("--port 8786", f"--host 127.0.0.1 --port {port}").replace("--nworkers 4", ""))


def free_port() -> int:
    with contextlib.closing(socket.socket()) as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def make_certificates(folder: Path) -> Path:
    folder.mkdir()
    subprocess.run(["sh", "-e", "-c", block_with("openssl")], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_certificates(tmp_path_factory.mktemp("tls") / "own")


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Certificates of another authority."""
    return make_certificates(tmp_path_factory.mktemp("tls") / "others")


@pytest.fixture(scope="module")
def port(certificates: Path) -> Iterator[int]:
    """Port of a scheduler with a worker."""
    number = free_port()
    with contextlib.ExitStack() as stack:
        for word in ("dask scheduler", "dask worker"):
            process = subprocess.Popen(
                line_with(word, number), cwd=certificates, stderr=subprocess.DEVNULL, start_new_session=True
            )
            stack.callback(process.wait, 30)
            stack.callback(os.killpg, process.pid, signal.SIGTERM)
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", number)):
                break
            time.sleep(0.2)
        time.sleep(5)  # for the worker
        yield number


def options(folder: Path, end: str = "client") -> list[str]:
    files = {"--tls-ca": "ca.pem", "--tls-cert": f"{end}.pem", "--tls-key": f"{end}-key.pem"}
    return [part for option, name in files.items() for part in (option, str(folder / name))]


def test_the_page_types_right(archive: object, certificates: Path, port: int) -> None:
    root: Path = archive.root  # type: ignore[attr-defined]
    command = [*line_with("footscan run", port), str(root / "workflow.yaml")]
    done = subprocess.run(command, cwd=certificates, check=False, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert (root / "results/P0001/S1/foot.stl").is_file()
    assert {path.name: oct(path.stat().st_mode & 0o077) for path in certificates.glob("*-key.pem")} == {
        f"{end}-key.pem": "0o0" for end in ("ca", "scheduler", "worker", "client")
    }


@pytest.fixture
def refusal(archive: object, capsys: pytest.CaptureFixture[str]) -> Refusal:
    """The last line of a run."""
    workflow = str(archive.workflow)  # type: ignore[attr-defined]

    def run(address: str, *arguments: str) -> str:
        assert run_command(["run", workflow, "--cluster", address, *arguments]) == 2
        output = capsys.readouterr()
        lines = output.err.splitlines()
        assert (output.out, len(lines)) == ("", 2)
        assert "steps to run" in lines[0]
        return lines[1].removeprefix("footscan: ")

    return run


def test_who_has_no_certificate_of_the_authority_is_not_let_in(refusal: Refusal, others: Path, port: int) -> None:
    for address, given in ((f"tls://127.0.0.1:{port}", options(others)), (f"tcp://127.0.0.1:{port}", [])):
        assert refusal(address, *given).startswith(f"--cluster {address}: no Dask scheduler answers (")


def test_files_that_are_none(refusal: Refusal, certificates: Path, others: Path, tmp_path: Path) -> None:
    """Wrong files are refused before a scheduler is contacted."""
    address = "tls://127.0.0.1:9"
    assert "needs certificates, expected --tls-ca, --tls-cert and --tls-key" in refusal(address)
    good = options(certificates)
    (tmp_path / "words.pem").write_text("no certificate")
    for place, option in ((1, "--tls-ca"), (3, "--tls-cert"), (5, "--tls-key")):
        missing = [*good[:place], str(tmp_path / "none.pem"), *good[place + 1 :]]
        assert refusal(address, *missing) == f"{tmp_path}/none.pem: {option}: no such file"
        words = [*good[:place], str(tmp_path / "words.pem"), *good[place + 1 :]]
        assert "in PEM form" in refusal(address, *words)
    other_key = [*good[:5], str(others / "client-key.pem")]
    assert "--tls-cert, --tls-key: expected a certificate and its own key" in refusal(address, *other_key)
    locked = tmp_path / "locked.pem"
    lock = ["openssl", "pkey", "-aes256", "-passout", "pass:word", "-in", good[5], "-out", str(locked)]
    subprocess.run(lock, check=True, capture_output=True)
    assert "without a password" in refusal(address, *good[:5], str(locked))


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--tls-ca", "ca.pem"], "go with --cluster tls://ADDRESS"),
        (["--cluster", "tcp://one:8786", "--tls-ca", "ca.pem"], "go with --cluster tls://ADDRESS"),
        (["--cluster", "tls://one:8786", "--tls-ca", "ca.pem"], "belong together, expected all three"),
        (["--dashboard"], "goes with --workers"),
        (["--workers", "2", "--threads", "2"], "exclude each other"),
    ],
)
def test_options_that_do_not_go_together(
    arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in ("run", "tune"):
        assert run_command([command, *arguments]) == 2
        output = capsys.readouterr()
        assert (output.out, output.err.count("\n"), problem in output.err) == ("", 1, True)

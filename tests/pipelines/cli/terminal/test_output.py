"""What comes from outside is shown, never obeyed by the terminal."""

import ast
import json
import logging
import os
from pathlib import Path

import pytest

from pipelines.cli.main import run_command
from pipelines.cli.terminal import output
from schemas.base.errors import one_line, printable

HOSTILE = "a\x1b[2J\x1b]0;title\x07b\nfootscan: done\r\x9b1A\u202egnp.exe\u2028c\x7f"
"""Clears the screen, names the window, forges a line, goes back to its begin, turns the direction of writing."""
CLI = Path(output.__file__).parents[1]
MAY_PRINT = {"output.py", "console.py"}
"""The latter prints an address of its own making, at once."""


def is_harmless(text: str) -> bool:
    return all(line.isprintable() for line in text.split("\n"))


def test_what_a_terminal_obeys_is_another_sign() -> None:
    assert printable("häßlich 足 x") == "häßlich 足 x"
    assert printable(HOSTILE).isprintable()
    assert len(printable(HOSTILE)) == len(HOSTILE)
    assert printable("a\nb\tc\x1b", keep="\n\t") == "a\nb\tc\N{REPLACEMENT CHARACTER}"
    assert one_line("a \n b\x1b") == "a b\N{REPLACEMENT CHARACTER}"


def test_messages_lines_and_tables(capsys: pytest.CaptureFixture[str]) -> None:
    output.message(HOSTILE)
    output.print_line(HOSTILE)
    said = capsys.readouterr()
    assert [text.count("\n") for text in said] == [1, 1]
    assert is_harmless(said.out + said.err)
    output.print_table(HOSTILE, [HOSTILE, "n"], [[HOSTILE, "1"], ["two\nlines", "2"]])
    printed = capsys.readouterr().out
    assert is_harmless(printed)
    assert "[2J" in printed


def test_json_means_what_it_meant(capsys: pytest.CaptureFixture[str]) -> None:
    value = {HOSTILE: [HOSTILE, "\udcff undecodable", "\U000e0001", 1.5, "é"]}
    output.print_json(value)
    printed = capsys.readouterr().out
    assert is_harmless(printed)
    assert json.loads(printed) == value
    assert "é" in printed
    assert "\n" not in output.json_text(value)


def test_log_lines() -> None:
    shown = output.LogFormatter("footscan: %(message)s")
    record = logging.makeLogRecord({"msg": "%s: damaged", "args": (HOSTILE,)})
    assert shown.format(record).isprintable()
    try:
        raise ValueError(HOSTILE)
    except ValueError as error:
        record = logging.makeLogRecord({"msg": "failed", "exc_info": (type(error), error, error.__traceback__)})
    assert is_harmless(shown.format(record))


@pytest.mark.parametrize("command", [["plan"], ["run"], ["cache", "stats"], ["config", "check"]], ids=" ".join)
def test_a_hostile_folder(command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Names of folders reach what is printed of a whole command."""
    home = tmp_path / HOSTILE.replace("\x00", "")
    (home / "archive" / HOSTILE / "S1").mkdir(parents=True)
    (home / "archive" / HOSTILE / "S1/scan.yaml").write_text("format: [")
    (home / "results/.footscan").mkdir(parents=True)
    (home / "workflow.yaml").write_text("format: footscan.workflow/1\narchive: archive\nresults: results\n")
    for as_json in ([], ["--json"]):
        run_command([*command, str(home / "workflow.yaml"), *as_json])
        said = capsys.readouterr()
        assert is_harmless(said.out + said.err)
        assert "gnp.exe" in said.out + said.err or said.out == "[]\n"
        assert "\nfootscan: done" not in said.out + said.err


def test_undecodable_names_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = os.fsencode(tmp_path) + b"/\xff\xfe"
    os.makedirs(folder)  # noqa: PTH103 (a name in bytes)
    assert run_command(["plan", os.fsdecode(folder)]) == 2
    assert is_harmless(capsys.readouterr().err)


def bare_prints(path: Path) -> list[int]:
    calls = (node for node in ast.walk(ast.parse(path.read_bytes())) if isinstance(node, ast.Call))
    return [call.lineno for call in calls if isinstance(call.func, ast.Name) and call.func.id == "print"]


def test_no_command_prints_by_itself() -> None:
    """Otherwise the next line that is written would be the next hole."""
    modules = [path for path in sorted(CLI.rglob("*.py")) if path.name not in MAY_PRINT]
    assert {path.name: lines for path in modules if (lines := bare_prints(path))} == {}

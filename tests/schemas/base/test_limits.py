"""Limits of what is read: one place, one way to raise them, one table in the docs."""

import os
import pickle
import re
from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.limits import LIMITS, VARIABLE, BeyondLimitError, check_limits, limit, read_bounded, refuse_beyond
from schemas.base.yaml_files import read_yaml
from schemas.scan import Scan

DOCS = Path(__file__).parents[3] / "docs"


def test_defaults_hold_where_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert {name: limit(name) for name in LIMITS} == {name: one.default for name, one in LIMITS.items()}


def test_a_limit_is_raised_and_lowered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, " mesh_bytes=2G, chart_points = 5k,measures=3 ,")
    assert (limit("mesh_bytes"), limit("chart_points"), limit("measures")) == (2 * 10**9, 5000, 3)
    assert limit("lasts") == LIMITS["lasts"].default


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("mesh=2G", "unknown limit 'mesh', expected one of yaml_bytes, "),
        ("2G", "unknown limit '2G', expected one of"),
        ("lasts", "lasts: expected a whole number such as 20000 or 2G, found ''"),
        ("lasts=0", "lasts: expected a whole number such as 20000 or 2G, found '0'"),
        ("lasts=-1", "lasts: expected a whole number"),
        ("lasts=1e6", "lasts: expected a whole number"),
        ("lasts=2T", "lasts: expected a whole number"),
        ("lasts=\u0662", "lasts: expected a whole number"),
        ("lasts=" + "9" * 5000, "lasts: expected a whole number"),
        ("lasts=999999999999999999G", "lasts: expected a whole number"),
    ],
)
def test_a_limit_that_is_none_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch, text: str, told: str) -> None:
    monkeypatch.setenv(VARIABLE, text)
    with pytest.raises(RefusedInput) as caught:
        check_limits()
    assert str(caught.value).startswith(f"{VARIABLE}: {told}")
    assert len(str(caught.value)) < 400


def test_a_refusal_names_the_limit_and_how_to_raise_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "lasts=3")
    refuse_beyond("lasts", 3, "lasts.csv")
    with pytest.raises(BeyondLimitError) as caught:
        refuse_beyond("lasts", 4, "lasts.csv")
    expected = (
        "lasts.csv: 4 lasts of all tables together are too many, expected at most 3 (FOOTSCAN_LIMITS=lasts=N raises it)"
    )
    assert str(caught.value) == expected
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again)) == (BeyondLimitError, expected)


def test_a_large_scan_yaml_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """6.7 MB of YAML took half a minute, in which no other scan of the archive was looked at."""
    path = tmp_path / "scan.yaml"
    path.write_text("notes: [" + "a, " * 2_233_000 + "a]\n")

    def read(*_: object) -> None:
        raise AssertionError("was opened")

    monkeypatch.setattr(Path, "open", read)
    monkeypatch.setattr(Path, "read_bytes", read)
    with pytest.raises(BeyondLimitError, match=r"expected at most 256000 \(FOOTSCAN_LIMITS=yaml_bytes=N raises it\)"):
        read_yaml(path, Scan)


def test_sparse_files_and_what_is_no_file_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "sparse").touch()
    os.truncate(tmp_path / "sparse", 6 * 10**9)
    os.mkfifo(tmp_path / "pipe")
    for name, told in (("sparse", "6000000000 bytes"), ("pipe", "expected a file"), ("", "expected a file")):
        with pytest.raises(RefusedInput, match=told):
            read_bounded(tmp_path / name, "json_bytes")
    with pytest.raises(RefusedInput, match="expected a file"):
        read_bounded(Path("/dev/zero"), "json_bytes")
    with pytest.raises(RefusedInput, match="cannot be read"):
        read_bounded(tmp_path / "a\0b", "json_bytes")


def test_the_docs_have_every_limit() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([\d,]+) \| (.*) \| (.*) \|$", (DOCS / "limits.md").read_text(), re.MULTILINE)
    assert rows == [(name, f"{one.default:,}", one.of_what, one.reason) for name, one in LIMITS.items()]

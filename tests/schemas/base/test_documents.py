"""Every broken document is refused in one line that names file, field and what was expected."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.base.errors import RefusedInput
from schemas.base.json_files import parse_json, read_json
from schemas.base.model import Document, canonical_json, pseudonym
from schemas.base.paths import inside
from schemas.base.yaml_files import read_yaml
from schemas.base.yaml_text import MAX_DEPTH
from schemas.scan import Scan

SCAN = """\
format: footscan.scan/1
patient: P0001
scan: 2026-11-20-R
side: right
travel: {start_mm: 0.0, step_mm: 2.0}
cameras:
  - {id: 1, file: cam1.avi}
"""


class Words(Document):
    name: str
    count: int = 0
    size: float = 0.0


def refusal(path: Path, content: str | bytes, model: type[Document] = Scan) -> str:
    """What is said of a YAML document, without the path that it must start with."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RefusedInput) as caught:
        read_yaml(path, model)
    return said(caught.value, path)


def said(error: RefusedInput, path: Path) -> str:
    text = str(error)
    assert text.startswith(f"{path}: ")
    assert text.isprintable()
    assert len(text) < 1000 + len(str(path))
    return text.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("side: right\n", "sid: right\n", "sid: unknown field, did you mean 'side'?"),
        ("id: 1, file", "id: 1, fil: x, file", "cameras.0.fil: unknown field, did you mean 'file'?"),
        ("side: right\n", "side: right\nqqqqq: 1\n", "qqqqq: unknown field"),
        ("side: right\n", "", "side: is missing, expected a value"),
        ("side: right", "side: no", "side: input should be 'right', 'left' or 'unknown', found 'no'"),
        ("side: right", "side: [right]", "side: input should be 'right', 'left' or 'unknown'"),
        ("id: 1", "id: one", "cameras.0.id: input should be a valid integer, unable to parse string as an integer, "
         "found 'one'"),
        ("id: 1", "id: 1.5", "cameras.0.id: input should be a valid integer, unable to parse string as an integer, "
         "found '1.5'"),
        ("id: 1", "id: 0", "cameras.0.id: input should be greater than or equal to 1, found '0'"),
        ("id: 1", "id:", "cameras.0.id: input should be a valid integer, found 'None'"),
        ("step_mm: 2.0", "step_mm: .nan", "travel.step_mm: "),
        ("step_mm: 2.0", "step_mm: nan", "travel.step_mm: input should be a finite number, found 'nan'"),
        ("step_mm: 2.0", "step_mm: -inf", "travel.step_mm: input should be a finite number, found '-inf'"),
        ("step_mm: 2.0", "step_mm: 1e999", "travel.step_mm: input should be a finite number, found '1e999'"),
        ("step_mm: 2.0", "step_mm: 0", "travel.step_mm: input should be greater than 0, found '0'"),
        ("step_mm: 2.0", "step_mm: 2,0", "travel.0: unknown field"),
        ("footscan.scan/1", "footscan.scan/9", "format: input should be 'footscan.scan/1', found 'footscan.scan/9'"),
        ("  - {id: 1, file: cam1.avi}\n", "  []\n", "cameras: list should have at least 1 item"),
        ("  - {id: 1, file: cam1.avi}\n", "  id: 1\n", "cameras: input should be a valid list"),
        ("id: 1, file: cam1.avi}", "id: 1, file: a.avi}\n  - {id: 1, file: b.avi}",
         "camera 1 is listed twice, expected each id once"),
        ("travel: {start_mm: 0.0, step_mm: 2.0}\n", "", "camera 1 has no travel, expected travel or positions"),
        ("cam1.avi", "/etc/passwd", "cameras.0.file: expected a path relative to this file, found '/etc/passwd'"),
        ("cam1.avi", "~/cam1.avi", "cameras.0.file: expected a path relative to this file, found '~/cam1.avi'"),
        ("cam1.avi", "'C:\\cam1.avi'", "cameras.0.file: expected a path relative to this file, found 'C:\\\\cam1.avi'"),
        ("cam1.avi", "''", "cameras.0.file: expected a path relative to this file, found ''"),
        ("cam1.avi", '"a\\0b"', "cameras.0.file: expected a path relative to this file, found 'a\\x00b'"),
        ("cam1.avi", '"\\ud800"', "expected YAML ('utf-8' codec can't encode character"),
        ("side: right\n", "side: right\nside: left\n", "line 5, column 1: 'side' is listed twice"),
        ("side: right\n", "side: [right\n", "line 5, column 7: expected ',' or ']'"),
        ("side: right\n", "side: right: left\n", "line 4, column 12: mapping values are not allowed here"),
        ("side: right\n", "\tside: right\n", "line 4, column 1: found character '\\t'"),
        ("side: right\n", "side: &a right\nx: *a\n", "line 5, column 4: alias 'a', expected it written out"),
        ("side: right\n", "side: !!python/object/apply:os.system [ls]\n", "line 4, column 7: tag 'tag:yaml.org,2002:p"),
        ("side: right\n", "side: !!timestamp x\n", "line 4, column 7: tag 'tag:yaml.org,2002:timestamp'"),
        ("side: right\n", "side: !!int ''\n", "line 4, column 7: tag 'tag:yaml.org,2002:int'"),
        ("side: right\n", "? [a]\n: b\n", "line 4, column 3: expected a name before ':'"),
        ("side: right\n", "~: b\n", "line 4, column 1: expected a name before ':'"),
        ("side: right\n", "side: \0\n", "expected YAML (unacceptable character #x0000"),
        ("side: right\n", "---\nside: right\n", "line 4, column 1: expected a single document"),
        ("side: right\n", "side: " + "[" * 5000 + "\n", f"line 4, column 30: expected at most {MAX_DEPTH} levels"),
    ],
)  # fmt: skip
def test_broken_scan_is_refused_by_field(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert SCAN.count(old) == 1
    assert refusal(tmp_path / "scan.yaml", SCAN.replace(old, new)).startswith(expected)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "expected a document with named fields, found nothing"),
        (b"- 1\n- 2\n", "expected a document with named fields, found a list"),
        (b"just words", "expected a document with named fields, found text"),
        (SCAN.encode("utf-16"), "expected UTF-8 text"),
        ("patient: Zoë".encode("latin-1"), "expected UTF-8 text"),
        (
            b"#" * 256_001,
            "256001 bytes of a YAML document are too many, expected at most 256000 "
            "(FOOTSCAN_LIMITS=yaml_bytes=N raises it)",
        ),
    ],
)
def test_what_is_no_document_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    assert refusal(tmp_path / "scan.yaml", content) == expected


def test_laughing_aliases_are_refused_before_they_multiply(tmp_path: Path) -> None:
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 60))
    assert refusal(tmp_path / "scan.yaml", bomb) == "line 2, column 10: alias 'a0', expected it written out"


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "file").touch()
    loop = tmp_path / "loop.yaml"
    loop.symlink_to(loop)
    expected = {
        tmp_path / "missing.yaml": "no such file",
        tmp_path: "expected a file",
        tmp_path / "pipe.yaml": "expected a file",
        tmp_path / "file" / "scan.yaml": "cannot be read (Not a directory)",
        loop: "cannot be read (Too many levels of symbolic links)",
        tmp_path / ("x" * 300): "cannot be read (File name too long)",
        tmp_path / "a\0b": "cannot be read (embedded null byte)",
    }
    for path, problem in expected.items():
        with pytest.raises(RefusedInput) as caught:
            read_yaml(path, Scan)
        assert str(caught.value).endswith(f": {problem}")
        assert str(caught.value).isprintable()


def test_unquoted_values_keep_their_text(tmp_path: Path) -> None:
    path = tmp_path / "scan.yaml"
    path.write_text(SCAN.replace("P0001", "0123").replace("2026-11-20-R", "2026-11-20"))
    scan = read_yaml(path, Scan)
    assert (scan.patient, scan.scan) == ("0123", "2026-11-20")
    for text in ("no", "yes", "0x1F", "1e3", "12:30:45", "1_000", "0o17", ".5", "true"):
        path.write_text(f"name: {text}\n")
        assert read_yaml(path, Words).name == text
    path.write_text("name: x\ncount: 3\nsize: 1e3\n")
    assert read_yaml(path, Words) == Words(name="x", count=3, size=1000.0)


def test_byte_order_mark_and_windows_lines_are_accepted(tmp_path: Path) -> None:
    path = tmp_path / "scan.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + SCAN.replace("\n", "\r\n").encode())
    assert read_yaml(path, Scan).patient == "P0001"


HOSTILE_NAMES = ["../../x", "a/b", "a\\b", "", "x" * 65, "ä", "P1\n", "\nP1", "P 1", ".", "..", "P1\0", "%2e%2e", "P１"]


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_hostile_pseudonyms_are_refused(tmp_path: Path, name: str) -> None:
    for field, value in (("patient", "P0001"), ("scan", "2026-11-20-R")):
        text = SCAN.replace(f"{field}: {value}", f"{field}: {json.dumps(name)}")
        assert refusal(tmp_path / "scan.yaml", text).startswith(f"{field}: ")
    with pytest.raises(RefusedInput, match=r"^--patient: expected 1 to 64 letters, digits, '-' and '_', found "):
        pseudonym(name, "--patient")


@pytest.mark.parametrize("name", ["x", "P-1_b", "x" * 64, "-", "0123"])
def test_pseudonyms_are_accepted(name: str) -> None:
    assert pseudonym(name, "patient") == name


def test_paths_inside_the_archive_are_resolved(tmp_path: Path) -> None:
    document = tmp_path / "archive/P1/S1/scan.yaml"
    document.parent.mkdir(parents=True)
    archive = tmp_path / "archive"
    assert inside(archive, document, "cam1.avi", "file") == document.parent.resolve() / "cam1.avi"
    assert inside(archive, document, "../calibration.json", "file") == (archive / "P1/calibration.json").resolve()
    assert inside(archive, document, "../../../archive/x", "file") == (archive / "x").resolve()


@pytest.mark.parametrize("relative", ["../../../x", "../../../archive2/x", "/etc/passwd", "a/../../../../x", "link/x"])
def test_paths_out_of_the_archive_are_refused(tmp_path: Path, relative: str) -> None:
    document = tmp_path / "archive/P1/S1/scan.yaml"
    document.parent.mkdir(parents=True)
    (document.parent / "link").symlink_to(tmp_path)
    with pytest.raises(RefusedInput) as caught:
        inside(tmp_path / "archive", document, relative, "cameras.1.file")
    assert said(caught.value, document) == (
        f"cameras.1.file: {relative!r} leaves the archive, expected a path inside it"
    )


def test_circle_of_links_is_refused_or_stays_inside(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    try:
        assert inside(tmp_path, tmp_path / "scan.yaml", "a/x", "file").is_relative_to(tmp_path.resolve())
    except RefusedInput as error:
        assert said(error, tmp_path / "scan.yaml") == "file: 'a/x' leads nowhere, expected a path"  # noqa: PT017 (either)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected a JSON document (Expecting value: line 1 column 1 (char 0))"),
        ('{"name": "a",}', "expected a JSON document (Illegal trailing comma"),
        ('{"name": NaN}', "expected a JSON document (NaN is no JSON number)"),
        ('{"name": "a", "size": Infinity}', "expected a JSON document (Infinity is no JSON number)"),
        ('{"name": "a", "size": 1e999}', "size: input should be a finite number, found 'inf'"),
        ('{"name": "a", "name": "b"}', "expected a JSON document ('name' is listed twice, expected each name once)"),
        ('["name"]', "expected a document with named fields, found a list"),
        ("[" * 200_000, "expected a JSON document ("),
        ('{"name": "\\ud800"}', "expected a JSON document ('utf-8' codec can't encode character"),
        ('{"nam": "a"}', "nam: unknown field, did you mean 'name'?"),
        ('{"name": "a", "size": "' + "9" * 5000 + '"}', "size: "),
        ('{"name": "a", "count": ' + "9" * 5000 + "}", "expected a JSON document (Exceeds the limit"),
    ],
)
def test_broken_json_is_refused(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "words.json"
    path.write_text(text)
    with pytest.raises(RefusedInput) as caught:
        read_json(path, Words)
    if "trailing comma" not in expected:  # its words differ between versions of Python
        assert said(caught.value, path).startswith(expected)
    assert said(caught.value, path).startswith(expected[:22])


def test_canonical_json_does_not_depend_on_order() -> None:
    assert canonical_json({"b": 1, "a": [1.5, None, "ö"]}) == '{"a":[1.5,null,"ö"],"b":1}'
    assert canonical_json({"a": 1, "b": 2}) == canonical_json({"b": 2, "a": 1})
    for number in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="not JSON compliant"):
            canonical_json(number)


plain = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=12))
structures = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
)
fields = st.dictionaries(st.sampled_from([*Scan.model_fields, "x"]), structures, max_size=8)
near_misses = st.builds(
    lambda at, cut, put: SCAN[:at] + put + SCAN[at + cut :],
    st.integers(0, len(SCAN)),
    st.integers(0, 8),
    st.text(st.sampled_from("-:{}[],&*!?|>'\"%@`#~ \n\tab01\\\ud800é\0"), max_size=6),
)


@given(st.one_of(st.text(), near_misses, structures.map(repr), fields.map(json.dumps)))
def test_any_text_is_a_scan_or_refused_in_one_line(text: str) -> None:
    assert_scan_or_refusal(text.encode("utf-8", "surrogatepass"))


@given(st.binary(max_size=200))
def test_any_bytes_are_a_scan_or_refused_in_one_line(data: bytes) -> None:
    assert_scan_or_refusal(data)


@given(structures)
def test_any_json_comes_back(value: Any) -> None:
    try:
        text = json.dumps(value, allow_nan=False)
    except ValueError:
        text = json.dumps(value)
        with pytest.raises(RefusedInput):
            parse_json("value", text)
    else:
        assert parse_json("value", text) == value


@pytest.fixture(scope="session", autouse=True)
def _folder_for_examples(tmp_path_factory: pytest.TempPathFactory) -> None:
    Examples.path = tmp_path_factory.mktemp("examples") / "scan.yaml"


class Examples:
    path: Path


def assert_scan_or_refusal(data: bytes) -> None:
    Examples.path.write_bytes(data)
    try:
        assert isinstance(read_yaml(Examples.path, Scan), Scan)
    except RefusedInput as error:
        assert said(error, Examples.path)  # noqa: PT017 (either is right)

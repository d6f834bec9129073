"""Messages are one line, whatever comes from outside."""

import pickle

from schemas.base.errors import DamagedError, Fault, Finding, FootscanError, RefusedInput, one_line


def test_each_kind_has_its_exit_status() -> None:
    assert [kind.exit_status for kind in (Finding, RefusedInput, Fault, DamagedError)] == [1, 2, 3, 3]
    assert all(issubclass(kind, FootscanError) for kind in (Finding, RefusedInput, Fault, DamagedError))


def test_messages_are_one_line() -> None:
    error = RefusedInput("a\nb.yaml", "expected\r\nx\x1b[31m", field="c\td\u2028e")
    assert str(error) == "a b.yaml: c d e: expected x\N{REPLACEMENT CHARACTER}[31m"
    assert str(Finding("no\nstripe")) == "no stripe"
    assert str(Fault("disk\0full")) == "disk\N{REPLACEMENT CHARACTER}full"
    assert one_line("\ud800 ä\u202e") == "\N{REPLACEMENT CHARACTER} ä\N{REPLACEMENT CHARACTER}"


def test_refusal_without_field() -> None:
    assert str(RefusedInput("scan.yaml", "no such file")) == "scan.yaml: no such file"


def test_a_refusal_reaches_another_process_whole() -> None:
    sent = RefusedInput("scan.yaml", "no such side", field="side")
    sent.others = (RefusedInput("scan.yaml", "is missing", field="patient"),)
    error = pickle.loads(pickle.dumps(sent))  # as pools hand it on
    assert [str(other) for other in error.others] == ["scan.yaml: patient: is missing"]
    assert (error.source, error.field, str(error)) == ("scan.yaml", "side", "scan.yaml: side: no such side")

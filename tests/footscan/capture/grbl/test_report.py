"""Lines of Grbl 1.1 as its documentation prints them, and what is made of them."""

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from footscan.capture.grbl.report import (
    Alarm,
    Answer,
    Feedback,
    Garbled,
    Message,
    Report,
    Setting,
    StartUpLine,
    Welcome,
    read_line,
)


@pytest.mark.parametrize(
    ("line", "meaning"),
    [
        ("ok", Answer(0)),
        ("error:9", Answer(9)),
        ("ALARM:1", Alarm(1)),
        ("Grbl 1.1h ['$' for help]", Welcome("1.1h")),
        ("Grbl 0.9j ['$' for help]", Welcome("0.9j")),
        ("GrblHAL 1.1f ['$' or '$HELP' for help]", Welcome("1.1f")),
        ("$10=1", Setting(10, 1.0)),
        ("$110=2500.500", Setting(110, 2500.5)),
        ("[MSG:'$H'|'$X' to unlock]", Feedback("MSG", "'$H'|'$X' to unlock")),
        ("[OPT:V+,15,128]", Feedback("OPT", "V+,15,128")),
        ("[VER:1.1h.20190830:left leg]", Feedback("VER", "1.1h.20190830:left leg")),
        ("[G54:4.000,0.000,0.000]", Feedback("G54", "4.000,0.000,0.000")),
        ("[PRB:0.000,0.000,0.000:0]", Feedback("PRB", "0.000,0.000,0.000:0")),
        (
            "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]",
            Feedback("GC", "G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0"),
        ),
        ("[echo:G1X0.540Y10.4F100]", Feedback("echo", "G1X0.540Y10.4F100")),
        (">G54G20:ok", StartUpLine(">G54G20:ok")),
        (">G54G20:error:20", StartUpLine(">G54G20:error:20")),
        ("$N0=G54", StartUpLine("$N0=G54")),
        ("", None),
    ],
)
def test_lines(line: str, meaning: Message | None) -> None:
    assert read_line(line) == meaning


def test_status_reports() -> None:
    assert read_line("<Idle|MPos:0.000,-10.000,5.000|FS:0,0>") == Report("Idle", None, (0.0, -10.0, 5.0))
    full = read_line(
        "<Run|MPos:1.000,2.000,3.000|Bf:15,128|FS:500,8000|Pn:XPD|WCO:0.000,1.551,5.664|Ov:100,50,90|A:SF>"
    )
    assert full == Report(
        state="Run",
        substate=None,
        machine_mm=(1.0, 2.0, 3.0),
        rate=500.0,
        power=8000.0,
        pins="XPD",
        free=(15, 128),
        overrides=(100, 50, 90),
        offset_mm=(0.0, 1.551, 5.664),
        lit="SF",
    )


@pytest.mark.parametrize("state", ["Hold:0", "Hold:1", "Door:0", "Door:1", "Door:2", "Door:3"])
def test_substates(state: str) -> None:
    report = read_line(f"<{state}|MPos:0.000,0.000,0.000|FS:0,0>")
    assert isinstance(report, Report)
    assert f"{report.state}:{report.substate}" == state


def test_work_positions_become_machine_positions_where_the_offset_is_told() -> None:
    without = read_line("<Idle|WPos:-2.500,0.000,11.000|F:0>")
    assert isinstance(without, Report)
    assert without.machine_mm is None
    told = read_line("<Idle|WPos:-2.500,0.000,11.000|FS:0,0|WCO:0.500,0.000,1.000>")
    assert isinstance(told, Report)
    assert told.machine_mm == (-2.0, 0.0, 12.0)


@pytest.mark.parametrize(
    "line",
    [
        "o",
        "okk",
        "error:",
        "ALARM:x",
        "rbl 1.1h ['$' for help]",
        "<Ide|MPos:0.000,0.000,0.000|FS:0,0>",
        "<Idle|MPos:0.000,0.000|FS:0,0>",
        "<Idle|MPos:0.00,0.000,0.000|FS:0,0>",
        "<Idle|MPos:0.000,0.000,0.000|FS:0>",
        "<Idle|MPos:0.000,0.000,0.000FS:0,0>",
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:Q>",
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100>",
        "<Idle|FS:0,0>",
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0",
        "$10",
        "[MSG:x",
        "\ufffd",
    ],
)
def test_damaged_lines(line: str) -> None:
    assert read_line(line) == Garbled(line)


@given(st.text(alphabet=string.printable, max_size=60))
def test_no_text_is_an_error_of_ours(line: str) -> None:
    read_line(line)


@given(st.data())
def test_a_report_that_lost_a_byte_is_damaged_or_differs_in_a_number_or_a_letter(data: st.DataObject) -> None:
    line = "<Run|MPos:-123.450,-123.450,-123.450|FS:3783,500>"
    at = data.draw(st.integers(0, len(line) - 1))
    read = read_line(line[:at] + line[at + 1 :])
    assert isinstance(read, Garbled | Report)
    if isinstance(read, Report):  # an integer digit or a sign: nothing tells that, but the position before it
        assert line[at] in "-123783500"

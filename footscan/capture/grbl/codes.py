"""The numbers in which Grbl speaks, in words: alarms, errors, settings, what to do.

By the documentation of Grbl 1.1 (github.com/gnea/grbl, doc/csv and the pages "Interface" and "Commands"); alarm 10 is
of boards with two motors on an axis, alarm 11 of later forks.
"""

from typing import NamedTuple


class Meaning(NamedTuple):
    """What a number stands for."""

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}; {self.remedy}"


HOME_AGAIN = "home the heads again"
OURS = "this is a mistake of the program or a damaged line: try again, and report it if it stays"
DISTURBED = "the line was probably damaged on its way: check the USB cable, keep it away from the motors' wires"

ALARMS = {
    1: Meaning(
        "a head ran onto an end switch and all heads were stopped at once; where they stand is not known exactly",
        f"see what drove it there, then {HOME_AGAIN}",
    ),
    2: Meaning(
        "a travel beyond the end of the rails was asked for and not begun; the position is kept",
        f"check the travel's start and length against $130 to $132, then reset and {HOME_AGAIN}",
    ),
    3: Meaning("the board was reset while heads moved; steps may be lost", HOME_AGAIN),
    4: Meaning("the probe's input was not as expected before probing", "the scanner has no probe: check that input"),
    5: Meaning("the probe touched nothing", "the scanner has no probe: no one should ask for probing"),
    6: Meaning("homing was interrupted by a reset", HOME_AGAIN),
    7: Meaning("the lid or door was opened while the heads were homing", f"close it and {HOME_AGAIN}"),
    8: Meaning(
        "a head pulled off its home switch and the switch stayed pressed",
        "check that switch and its wiring, see whether the head is stuck, or make $27 larger",
    ),
    9: Meaning(
        "a head never reached its home switch",
        "see whether the head is stuck or its motor stands still, check the switch and its wiring",
    ),
    10: Meaning(
        "the second motor of an axis never found its home switch", "check that switch and whether the axis is skewed"
    ),
    11: Meaning("the board wants the heads homed before anything else", HOME_AGAIN),
}

ERRORS = {
    1: Meaning("a word of G-code without its letter", DISTURBED),
    2: Meaning("a word of G-code whose number is missing or broken", DISTURBED),
    3: Meaning("a '$' command it does not know", DISTURBED),
    4: Meaning("a negative value where only a positive one has a meaning", "correct the value"),
    5: Meaning("homing is switched off", "switch it on with $22=1"),
    6: Meaning("a step pulse shorter than 3 microseconds", "make $0 at least 3"),
    7: Meaning(
        "its settings could not be read from memory and were replaced by the factory's",
        "write the scanner's settings again, and change the board if this comes back",
    ),
    8: Meaning("a command that it takes only while heads stand", "wait until they stand"),
    9: Meaning("it is locked, by an alarm or because a jog is under way", f"end the jog, or {HOME_AGAIN}"),
    10: Meaning("soft limits need homing", "switch homing on first: $22=1, then $20=1"),
    11: Meaning("a line longer than it can hold; nothing of it was done", OURS),
    12: Meaning("more steps a second than it can make", "lower the maximum rate ($110 to $112) or the steps a mm"),
    13: Meaning("the lid or door is open", "close it"),
    14: Meaning("a line too long to be stored", "shorten it to 80 characters"),
    15: Meaning("a jog beyond the end of the rails; nothing moved", "jog less far"),
    16: Meaning("a jog with other commands in it", OURS),
    17: Meaning(
        "laser mode is not possible: this firmware was built without a variable spindle output",
        "install a build with variable spindle ($I shows V)",
    ),
    20: Meaning("a command it does not support", DISTURBED),
    21: Meaning("two commands of one kind in a line", DISTURBED),
    22: Meaning("a travel without a speed", OURS),
    23: Meaning("a command whose number must be whole", DISTURBED),
    24: Meaning("two commands that both use the axes in one line", DISTURBED),
    25: Meaning("a word that is repeated in a line", DISTURBED),
    26: Meaning("a command that needs an axis and has none", DISTURBED),
    27: Meaning("a line number beyond 9,999,999", OURS),
    28: Meaning("a command without a value it needs", DISTURBED),
    29: Meaning("a work coordinate system beyond G59", OURS),
    30: Meaning("machine coordinates (G53) with a motion other than G0 and G1", OURS),
    31: Meaning("axes in a line that has no use for them", DISTURBED),
    32: Meaning("an arc without an axis in its plane", DISTURBED),
    33: Meaning("a motion whose target makes no sense", DISTURBED),
    34: Meaning("an arc with an impossible radius", DISTURBED),
    35: Meaning("an arc without its centre", DISTURBED),
    36: Meaning("words in a line that nothing uses", DISTURBED),
    37: Meaning("a tool length on another axis than the tool's", OURS),
    38: Meaning("a tool number that is too large", OURS),
}

SETTINGS = {
    0: "step pulse, microseconds",
    1: "delay before motors are switched off, ms (255: never)",
    2: "inverted step outputs, mask",
    3: "inverted directions, mask",
    4: "inverted step enable",
    5: "inverted limit switches",
    6: "inverted probe",
    10: "contents of status reports, mask",
    11: "junction deviation, mm",
    12: "arc tolerance, mm",
    13: "reports in inches",
    20: "soft limits",
    21: "hard limits",
    22: "homing",
    23: "homing direction, mask",
    24: "homing speed near the switch, mm/min",
    25: "homing speed to the switch, mm/min",
    26: "homing switch debounce, ms",
    27: "homing pull-off, mm",
    30: "S of full laser power",
    31: "S of least laser power",
    32: "laser mode",
    **{100 + axis: f"steps/mm of head {axis + 1}" for axis in range(3)},
    **{110 + axis: f"maximum rate of head {axis + 1}, mm/min" for axis in range(3)},
    **{120 + axis: f"acceleration of head {axis + 1}, mm/s^2" for axis in range(3)},
    **{130 + axis: f"maximum travel of head {axis + 1}, mm" for axis in range(3)},
}


def alarm_in_words(number: int) -> str:
    """What happened, and what to do."""
    return f"{_known(ALARMS, number)} (alarm {number})"


def error_in_words(number: int) -> str:
    """What the board did not take, and what to do."""
    return f"{_known(ERRORS, number)} (error {number})"


def _known(meanings: dict[int, Meaning], number: int) -> Meaning:
    unknown = Meaning("something this program does not know", "look it up in the documentation of the board's firmware")
    return meanings.get(number, unknown)

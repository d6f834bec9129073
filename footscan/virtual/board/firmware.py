"""The virtual board's firmware: states, realtime commands and the pump of lines, by the public protocol of Grbl 1.1.

It uses no thread and no port: bytes go in by `receive`, time by `tick`, text comes out by `say`.
"""

from collections.abc import Callable
from dataclasses import dataclass

from footscan.virtual.board.execute import execute_gcode
from footscan.virtual.board.gcode import Modes
from footscan.virtual.board.machine import Counters, Machine, Overrides, State, Work
from footscan.virtual.board.motion import LaserPower
from footscan.virtual.board.report import status_report
from footscan.virtual.board.system import execute_system

RX_BYTES = 128
PLANNED_MOVES = 15
"""Sizes of the receive buffer and of the planner, as Grbl 1.1 reports them (`Bf:15,128`)."""
RESET, QUERY, START, HOLD, DOOR, JOG_CANCEL = 0x18, ord("?"), ord("~"), ord("!"), 0x84, 0x85
FEED_STEPS = {0x91: 10, 0x92: -10, 0x93: 1, 0x94: -1}
RAPIDS = {0x95: 100, 0x96: 50, 0x97: 25}
LIGHT_STEPS = {0x9A: 10, 0x9B: -10, 0x9C: 1, 0x9D: -1}
FEED_RESET, LIGHT_RESET, LIGHT_STOP = 0x90, 0x99, 0x9E
"""Realtime commands of Grbl 1.1; the steps are changes of the overrides in percent."""
CRITICAL = (1, 2)
"""Alarms after which the firmware accepts only a reset."""
ALARM_SECONDS = 0.5
"""Pause of the firmware after an alarm, in which the message is sent."""


@dataclass
class Firmware(Machine):
    """The state machine."""

    _work: Work | None = None
    _waits_for: Callable[[], bool] | None = None
    _report_wanted: bool = False
    _door_seen: bool = False
    _door_resuming: bool = False
    _boots_at: float | None = None

    def power_up(self, boot_seconds: float = 0.0) -> None:
        """Begins as after its power was switched on: motors at 0 wherever they stand, locked until homed.

        Nothing is heard while it boots.
        """
        self._work = self._waits_for = None
        self.motion.steps = (0.0, 0.0, 0.0)
        self.motion.stand_in_light(LaserPower())
        self.state = "Alarm" if self.memory.flag(22) else "Idle"
        if boot_seconds:
            self._boots_at = self.now + boot_seconds
        else:
            self._boot()

    def receive(self, data: bytes) -> None:
        """Bytes from the host. Realtime commands are picked out of them, wherever they stand."""
        for byte in data:
            if byte in (RESET, QUERY, START, HOLD) or byte > 0x7F:
                self._realtime(byte)
            elif len(self.received) < RX_BYTES:
                self.received.append(byte)

    def tick(self, now: float, motion_now: float) -> None:
        """Lets everything happen that is due at `now`; the motors' clock stands at `motion_now`."""
        self.now = now
        self.motion.dark_when_held = self.memory.flag(32)
        if self.state != "Home":
            self.motion.watch = "limits" if self.memory.flag(21) and self.state != "Alarm" else "none"
        self.motion.advance(motion_now)
        if self._boots_at is not None:
            if now >= self._boots_at:
                self._boot()
            return
        if self.motion.tripped:
            self.motion.tripped = False
            self.alarm(1)
        if self.critical:
            return
        self._heed_motion()
        self._heed_door()
        if self.state != "Home":
            self.answer_query()
        self._pump()

    def alarm(self, number: int) -> None:
        """Stops everything. What happened is said; the two worst are followed by a reset of the host's."""
        self.motion.kill()
        self.motion.stand_in_light(LaserPower())
        self.state = "Alarm"
        self.say(f"ALARM:{number}")
        if number in CRITICAL:
            self.say("[MSG:Reset to continue]")
            self.critical = True
            self._report_wanted = False

    def answer_query(self) -> None:
        """Reports, where that was asked for since the last report."""
        if self._report_wanted:
            self._report_wanted = False
            self.say(status_report(self))

    def restart(self, *, after_alarm: bool) -> None:
        """Begins anew with its motors' position kept, as after a reset; the line under way is answered with `ok`."""
        if self._work is not None:
            self.say("ok")
        self._work = self._waits_for = None
        self._boots_at = self.now + (ALARM_SECONDS if after_alarm else 0.0)

    def plan_has_room(self) -> bool:
        """Whether one more move can be queued."""
        return len(self.motion.queue) < PLANNED_MOVES

    def is_still(self) -> bool:
        """Whether all that was queued is done."""
        return not self.motion.queue

    def begin(self, state: State) -> None:
        """A move was queued: the state it is made in, unless something moves already."""
        if self.state == "Idle":
            self.state = state

    @property
    def door_ajar(self) -> bool:
        """Whether the door's input is wired in and open."""
        return self.build.door_pin and self.pins.door_open

    @property
    def substate(self) -> int | None:
        """The number behind Hold and Door."""
        if self.state == "Hold":
            return 0 if self.motion.speed == 0.0 else 1
        if self.state == "Door":
            if self._door_resuming:
                return 3
            return 2 if self.motion.speed > 0.0 else 1 if self.door_ajar else 0
        return None

    def reset(self) -> None:
        """0x18: all stops at once. In motion the position is lost, and that is an alarm."""
        if self._boots_at is not None:
            return
        moving = self.state in ("Run", "Jog", "Home") or self.motion.speed > 0.0
        self.motion.stand_in_light(LaserPower())
        if moving and self.state != "Alarm":
            self.alarm(6 if self.state == "Home" else 3)
        else:
            self.motion.flush()
        self.restart(after_alarm=moving)

    def _boot(self) -> None:
        self._boots_at = None
        self.critical = self._report_wanted = self._door_resuming = False
        self.received.clear()
        self.modes = Modes()
        self.overrides = Overrides()
        self.counters = Counters()
        self.apply_overrides()
        self.motion.locked = [False, False, False]
        self.motion.tripped = False
        self.where = self.motion.steps
        self.say("")
        self.say(f"Grbl {self.build.version} ['$' for help]")
        if self.memory.flag(21) and any(self.motion.pressed()):
            self.state = "Alarm"
            self.say("[MSG:Check Limits]")
        if self.state == "Alarm":
            self.say("[MSG:'$H'|'$X' to unlock]")
            return
        self.state = "Idle"
        self._door_seen = False
        self._heed_door()

    def _heed_motion(self) -> None:
        if self.state in ("Run", "Jog") and not self.motion.queue:
            self.state = "Idle"
        if self.state == "Jog" and self.motion.holding and self.motion.speed == 0.0:
            self.motion.flush()  # a jog that is cancelled is forgotten
            self.where = self.motion.steps
            self.state = "Idle"

    def _heed_door(self) -> None:
        if self.door_ajar and not self._door_seen:
            self._open_door()
        self._door_seen = self.door_ajar
        if self.state == "Door" and self.motion.speed == 0.0:
            self.motion.stand_in_light(LaserPower())

    def _open_door(self) -> None:
        if self.state == "Home":
            self.alarm(7)
            self.restart(after_alarm=True)
        elif self.state != "Alarm":
            self.say("[MSG:Check Door]")
            if self.state == "Jog":
                self.motion.flush()
                self.where = self.motion.steps
            self.motion.holding = True
            self._door_resuming = False
            self.state = "Door"

    def _realtime(self, byte: int) -> None:
        if byte == RESET:
            self.reset()
        elif self.critical or self._boots_at is not None:
            return
        elif byte == QUERY:
            self._report_wanted = True
        elif byte == DOOR:
            self._open_door()
        elif byte in (HOLD, JOG_CANCEL):
            self._hold(byte)
        elif byte == START:
            self._start()
        elif self.state != "Home":
            self._override(byte)

    def _hold(self, byte: int) -> None:
        if self.state == "Jog":
            self.motion.holding = True
        elif byte == HOLD and self.state in ("Run", "Idle"):
            self.motion.holding = True
            if self.memory.flag(32) and self.state == "Idle":
                self.motion.stand_in_light(LaserPower())
            self.state = "Hold"

    def _start(self) -> None:
        ready = self.motion.speed == 0.0 and not (self.state == "Door" and self.door_ajar)
        if self.state in ("Hold", "Door") and ready:
            self.motion.holding = False
            self.motion.plan()
            self.state = "Run" if self.motion.queue else "Idle"

    def _override(self, byte: int) -> None:
        was = Overrides(self.overrides.feed, self.overrides.rapid, self.overrides.light)
        now = self.overrides
        if byte == FEED_RESET:
            now.feed = 100
        elif byte in FEED_STEPS:
            now.feed = min(max(now.feed + FEED_STEPS[byte], 10), 200)
        elif byte in RAPIDS:
            now.rapid = RAPIDS[byte]
        elif byte == LIGHT_RESET:
            now.light = 100
        elif byte in LIGHT_STEPS:
            now.light = min(max(now.light + LIGHT_STEPS[byte], 10), 200)
        elif byte == LIGHT_STOP and self.state == "Hold" and not self.memory.flag(32):
            self.motion.stand_in_light(LaserPower())
        if now != was:
            self.counters.overrides = 0
            self.apply_overrides()

    def apply_overrides(self) -> None:
        """Hands what is overridden to the motion."""
        self.motion.feed_override = self.overrides.feed / 100.0
        self.motion.rapid_override = self.overrides.rapid / 100.0
        self.motion.light_override = self.overrides.light / 100.0
        self.motion.plan()

    def _pump(self) -> None:
        """Goes on with the line under way, then with the next ones, as far as nothing is waited for."""
        while self.state not in ("Hold", "Door") and not self.critical and self._boots_at is None:
            if self._work is None:
                end = next((at for at, byte in enumerate(self.received) if byte in b"\r\n"), None)
                if end is None:
                    return
                line = bytes(self.received[:end]).decode("ascii")
                del self.received[: end + 1]
                self._work = self._execute(line)
            if self._waits_for is not None and not self._waits_for():
                return
            self._step()

    def _step(self) -> None:
        work, self._waits_for = self._work, None
        assert work is not None
        try:
            waits_for = next(work)
        except StopIteration as done:
            if self._work is work:  # a line that restarts the board is answered by that
                self._work = None
                self.say(f"error:{done.value}" if done.value else "ok")
        else:
            if self._work is work:
                self._waits_for = waits_for

    def _execute(self, raw: str) -> Work:
        line = _bare(raw)
        if len(line) >= self.build.line_length:
            return 11
        if not line:
            return 0
        if line.startswith("$"):
            return (yield from execute_system(self, line))
        if self.state in ("Alarm", "Jog"):
            return 9
        return (yield from execute_gcode(self, line))


def _bare(raw: str) -> str:
    """A line without spaces, control characters, slashes and comments, in capitals."""
    kept: list[str] = []
    in_brackets = False
    for character in raw:
        if character == ";":
            break
        if in_brackets or character == "(":
            in_brackets = character != ")"
        elif character > " " and character != "/":
            kept.append(character.upper())
    return "".join(kept)

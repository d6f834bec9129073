"""The range-sensor heads and their lasers in world coordinates: homing, travels, light, and a log of positions.

Light is tied to motion. `lasers` sets the power of the next travels; the board emits it only while the heads move
(M4 in laser mode), so that standing heads are dark, even if the host has failed. `shine` lights heads that stand, by
letting them creep.
"""

import math
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

from footscan import clock
from footscan.capture.board.carriages import AXIS_LETTERS, Carriages
from footscan.capture.board.controller import Controller
from footscan.capture.board.head import Head, Travel
from footscan.capture.board.position_log import HeadPosition, PositionLog
from footscan.capture.board.state import BoardState
from footscan.capture.grbl.report import Report
from footscan.capture.grbl.status_poll import TimedReport
from schemas.base.errors import Fault, RefusedInput
from schemas.rig import AXES, RigBoard

SLACK_MM = 0.05
"""Largest distance of a reported position from its target: rounding to steps and to the decimals of the report."""
STEPS_LOST_MM = 0.3
"""Displacement of a home switch from which on steps count as lost: a few times the repeatability of a cheap switch.
Chosen by hand."""
FEELER_STEP_MM = 0.1
SOFT_LIMITS, HARD_LIMITS = 20, 21
"""Numbers of these settings."""
FEELER_MM = 1.5
"""A switch is searched for this far before and beyond its nominal position. Chosen by hand."""
WELL_TIMED_SECONDS = 0.1
"""Reports whose time is less certain are not logged. Chosen by hand."""
LONGEST_SHINE_SECONDS = 5.0
CREEP_MM_PER_S = 0.5
"""Speed of heads that `shine` lights: 0.01 mm within an exposure of 20 ms."""
DWELL = "G4P0.01"
"""A dwell; the board answers it when all motion before it has ended."""


class Heads:
    """All heads of a scanner, which move together. Leaving the `with` block always ends motion and light."""

    def __init__(
        self,
        port: str,
        setup: RigBoard | None = None,
        heads: Sequence[Head] = (Head(axis=0), Head(axis=1), Head(axis=2)),
        *,
        patience_seconds: float = 2.0,
    ) -> None:
        """Connect to the board at `port`, which must be set up as `setup`; raises the errors of `Controller`."""
        self.setup = setup or RigBoard()
        self.carriages = Carriages(heads)
        self.log = PositionLog()
        """Positions of the heads from all reports while they are homed."""
        self._power = 0.0
        self._brightest = 0.0
        self._suspect: HeadPosition | None = None
        self.board = Controller(port, patience_seconds=patience_seconds)
        try:
            self._restore_limits()
            self.board.check(self.setup)
        except BaseException:
            self.board.close()
            raise
        self.board.on_report(self._log)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End motion and light and close the port."""
        self.board.close()

    @property
    def state(self) -> BoardState:
        """The state of the board."""
        return self.board.state

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Lowest and highest world X that all carriages can reach, mm."""
        return self.carriages.reach_mm(self.setup)

    def position_mm(self) -> tuple[float, ...]:
        """Return the present world X of heads 1, 2, ... as the firmware counts it, mm; Fault if they are not homed."""
        self._need_home()
        return self.carriages.world(self._machine(self.board.status().report))

    def home(self) -> None:
        """Find the home switches, then align all heads at one X next to them; Fault if a head fails."""
        self._suspect = None
        self.board.home(self._homing_limit())
        self._restore_limits()
        low, high = self.reach_mm
        at = self.carriages.leading(self._machine(self.board.status().report))
        self.travel_to(low if abs(at[0] - low) < abs(at[0] - high) else high)

    def lasers(self, power: float) -> None:
        """Set the laser power of the next travels, 0 to 1. The lasers stay off until the heads travel."""
        if not 0.0 <= power <= 1.0:
            raise RefusedInput("lasers", f"expected a power from 0 to 1, found {power:g}", field="power")
        self._power = power

    def travel(self, start_mm: float, end_mm: float, mm_per_s: float, head: int | None = None) -> Travel:
        """Move all heads, or the carriage of one, to `start_mm` in the dark, then to `end_mm` with light, and wait.

        The run begins before the start and ends behind the end by the distance that the heads need to accelerate, as
        far as the rails allow: between start and end, speed and brightness are constant.

        Raises
        ------
        RefusedInput
            A position is out of reach, or the speed is not positive or too high. Nothing has moved.
        Fault
            The heads are not homed; or something ended the travel, and heads and lasers are stopped.
        """
        self._check_travel(start_mm, end_mm, mm_per_s)
        way = 1.0 if end_mm >= start_mm else -1.0
        run_up = mm_per_s**2 / (2.0 * min(self.setup.mm_per_s2))
        low, high = self.reach_mm
        begin, end = (min(max(x, low), high) for x in (start_mm - way * run_up, end_mm + way * run_up))
        self.travel_to(begin, head=head)
        return self._run(begin, end, mm_per_s, self._power, head)

    def travel_to(self, x_mm: float, mm_per_s: float | None = None, head: int | None = None) -> Travel:
        """Move all heads, or the carriage of one, to `x_mm` in the dark, and wait; default speed: full speed."""
        speed = mm_per_s or min(self.setup.max_mm_per_s)
        self._check_travel(x_mm, x_mm, speed)
        at = self._machine(self.board.status().report)
        moved = self.carriages.moved(head).items()
        farthest = max((leader.world(at[axis]) for axis, leader in moved), key=lambda x: abs(x - x_mm))
        if abs(farthest - x_mm) < SLACK_MM / 2.0:
            now = clock.seconds()
            return Travel(now, now)
        return self._run(farthest, x_mm, speed, 0.0, head)

    def shine(self, power: float, seconds: float) -> Travel:
        """Light the standing heads for `seconds`, and wait until they are dark again.

        Meanwhile they creep at 0.5 mm/s, and then return in the dark: the light ends with the motion, even if the host
        fails or the line that switches the light off is lost.
        """
        if not (0.0 < power <= 1.0 and 0.0 < seconds <= LONGEST_SHINE_SECONDS):
            expected = f"expected a power up to 1 and up to {LONGEST_SHINE_SECONDS:g} s"
            raise RefusedInput("lasers", f"{expected}, found {power:g} and {seconds:g} s", field="shine")
        self._need_home()
        at = self._machine(self.board.status().report)
        x = self.carriages.leading(at)
        by = CREEP_MM_PER_S * seconds
        way = by if max(x) + by <= self.reach_mm[1] else -by
        target = {axis: at[axis] + head.direction * way for axis, head in self.carriages.leaders.items()}
        feed = CREEP_MM_PER_S * math.sqrt(len(target))
        begin = clock.seconds()
        self._go_machine(target, feed, power, seconds)
        end = clock.seconds()
        self._go_machine({axis: at[axis] for axis in target}, 10.0 * feed, 0.0)
        return Travel(begin, end)

    def jog(self, by_mm: float, mm_per_s: float, head: int | None = None) -> None:
        """Begin to move all heads, or one, by `by_mm` along X in the dark, as with a hand-held controller.

        Heads of one carriage move together. A jog of homed heads beyond their reach is refused. `stop_jog` ends a jog.
        """
        self._check_speed(mm_per_s)
        if head is not None and not 1 <= head <= len(self.carriages.heads):
            raise RefusedInput("jog", f"expected 1 to {len(self.carriages.heads)}, found {head}", field="head")
        by = [0.0] * AXES
        present = self.position_mm() if self.board.homed else None
        low, high = self.reach_mm
        moved = self.carriages.carried(head)
        for number, leader in enumerate(self.carriages.heads, start=1):
            if self.carriages.leaders[leader.axis] is not leader or not moved[number - 1]:
                continue
            target = low if present is None else present[number - 1] + by_mm
            if not low - SLACK_MM <= target <= high + SLACK_MM:
                raise RefusedInput("jog", _out_of_reach(target, low, high), field=f"head {number}")
            by[leader.axis] = leader.direction * by_mm
        self.board.jog((by[0], by[1], by[2]), mm_per_s)

    def stop_jog(self) -> None:
        """End all jogs."""
        self.board.cancel_jog()

    def hold(self) -> None:
        """Halt a travel; it continues with light after `resume`."""
        self.board.hold()

    def resume(self) -> None:
        """Continue after `hold`, or after the lid was closed."""
        self.board.resume()

    def stop(self) -> None:
        """End a travel, with the light off and the position kept; the call that made the travel raises Fault."""
        self.board.stop()

    def lost_steps_mm(self) -> tuple[float, ...]:
        """Measure how far each head is off by its home switch since homing, mm along X; Fault beyond the tolerance.

        The firmware counts the steps that it gives, and does not notice steps that a motor loses. The heads return to
        their home switches, search for them in steps of 0.1 mm, and the positions are compared. A head that never
        meets its switch is a Fault, too. The limits are off meanwhile ($20=0, $21=0), because the switches must be
        touched: four writes into the EEPROM. If the search is interrupted, the heads must be homed again, which
        switches the limits on.
        """
        low, high = self.reach_mm
        tripped_at = self.carriages.heads[0].world(0.0)
        home = low if abs(tripped_at - low) < abs(tripped_at - high) else high
        slow = self.setup.homing_slow_mm_per_s
        try:
            self.travel_to(home)
            self._go_machine(dict.fromkeys(self.carriages.leaders, -FEELER_MM), slow, 0.0)
            self.board.change(SOFT_LIMITS, 0)
            self.board.change(HARD_LIMITS, 0)
            tripped = self._feel_switches()
            self.board.change(SOFT_LIMITS, 1)  # before the way back, hard ones behind it: leaving a switch trips them
            self._go_machine(dict.fromkeys(self.carriages.leaders, -self.setup.pull_off_mm), slow, 0.0)
            self.board.change(HARD_LIMITS, 1)
            self.travel_to(home)
        except BaseException:
            self.board.doubt_home()
            raise
        lost = tuple(head.direction * tripped[head.axis] for head in self.carriages.heads)
        wrong = [f"head {number} {_off(by)}" for number, by in enumerate(lost, start=1) if abs(by) > STEPS_LOST_MM]
        if wrong:
            self.board.doubt_home()
            remedy = "see what holds them, then home the heads again"
            raise Fault(f"heads are not where their steps say: {', '.join(wrong)}; {remedy}")
        return lost

    def _restore_limits(self) -> None:
        """Switch the limits on that an interrupted search for the switches left off."""
        present = self.board.settings()
        for number in (SOFT_LIMITS, HARD_LIMITS):
            if present.get(number) == 0:
                self.board.change(number, 1)

    def _run(self, begin_mm: float, end_mm: float, mm_per_s: float, power: float, moved: int | None = None) -> Travel:
        """Move all heads, or one, straight to `end_mm`; `mm_per_s` is the speed of a head that starts at `begin_mm`."""
        self._need_home()
        at = self._machine(self.board.status().report)
        target = {axis: leader.machine(end_mm) for axis, leader in self.carriages.moved(moved).items()}
        along = [abs(end - at[axis]) for axis, end in target.items()]
        # The feed is the speed in the space of the axes that move: for three equal ones, sqrt(3) times their speed.
        feed = mm_per_s * math.hypot(*along) / max(*along, 1e-9)
        seconds = abs(end_mm - begin_mm) / mm_per_s + 2.0 * mm_per_s / min(self.setup.mm_per_s2)
        began = clock.seconds()
        self._brightest = 0.0
        self._go_machine(target, feed, power, seconds)
        ended = clock.seconds()
        self._check_light(power, seconds)
        return Travel(began, ended)

    def _go_machine(
        self, target: Mapping[int, float], feed_mm_per_s: float, power: float, seconds: float = 5.0
    ) -> None:
        """Move axes to machine positions, by index of the axis, and check that the heads arrived.

        The line that ends the light is in the buffer of the board before the motion begins. It waits for the end of
        the motion only if there is light; the dwell behind it always does: its answer says that the heads stand.
        """
        self.board.overrides_away()
        words = "".join(f"{AXIS_LETTERS[axis]}{at:.3f}" for axis, at in sorted(target.items()))
        light = [f"M4{self._s_word(power)}"] if power else []
        lines = ["G21G90G94M5", *light, f"G53G1{words}F{60.0 * feed_mm_per_s:.1f}", "M5", DWELL]
        self.board.stream(lines, limit_seconds=seconds)
        report = self.board.status().report
        arrived = report.machine_mm is not None and all(
            abs(report.machine_mm[axis] - at) <= SLACK_MM for axis, at in target.items()
        )
        if report.state != "Idle" or not arrived:
            self.board.stop()
            stand = "nowhere known"
            if report.machine_mm is not None:
                stand = ", ".join(f"{report.machine_mm[axis]:.2f}" for axis in sorted(target))
            wanted = ", ".join(f"{at:.2f}" for _, at in sorted(target.items()))
            raise Fault(f"the heads did not go where they were sent ({wanted}), they stand at {stand}; try again")

    def _check_light(self, power: float, seconds: float) -> None:
        """Check that a travel of some length had the power that was sent, and a dark one none; Fault if not."""
        wanted = round(power * self.setup.full_power)
        if self._brightest > wanted + 1 or (seconds > 1.0 and self._brightest < wanted - 1):
            powers = f"sent S{wanted}, put out S{self._brightest:g}"
            raise Fault(f"the lasers were not as bright as they should be on this travel ({powers}); try again")

    def _feel_switches(self) -> dict[int, float]:
        """Search for the machine position at which the home switch of each axis trips, mm; infinite if it does not.

        No limit stops a head here, so each step is a short line of its own: a byte that is lost or doubled turns it
        into a step of a millimetre at most.
        """
        tripped = dict.fromkeys(sorted(self.carriages.leaders), math.inf)
        feed = 60.0 * self.setup.homing_slow_mm_per_s * math.sqrt(len(tripped))
        step = "".join(f"{AXIS_LETTERS[axis]}{FEELER_STEP_MM:g}".replace("0.", ".") for axis in tripped)
        for _ in range(round(2.0 * FEELER_MM / FEELER_STEP_MM)):
            self.board.send(f"G91G1{step}F{feed:.0f}")
            self.board.send(DWELL, limit_seconds=1.0)
            report = self.board.status().report
            for axis, at in tripped.items():
                if AXIS_LETTERS[axis] in report.pins and math.isinf(at) and report.machine_mm is not None:
                    tripped[axis] = report.machine_mm[axis] - FEELER_STEP_MM / 2.0
            if not any(map(math.isinf, tripped.values())):
                break
        return tripped

    def _check_travel(self, start_mm: float, end_mm: float, mm_per_s: float) -> None:
        self._need_home()
        self._check_speed(mm_per_s)
        low, high = self.reach_mm
        for name, x in (("start", start_mm), ("end", end_mm)):
            if not low - 1e-6 <= x <= high + 1e-6:
                raise RefusedInput("travel", _out_of_reach(x, low, high), field=name)

    def _check_speed(self, mm_per_s: float) -> None:
        most = min(self.setup.max_mm_per_s)
        if not 0.0 < mm_per_s <= most:
            raise RefusedInput("travel", f"expected up to {most:g} mm/s, found {mm_per_s:g}", field="speed")

    def _need_home(self) -> None:
        if not self.board.homed:
            raise Fault(f"the heads are not homed: {self.state}")

    def _homing_limit(self) -> float:
        """Longest time of a homing cycle, s: heads home one after the other from the far end, and the last one fails.

        Grbl searches for a switch over 1.5 times the travel, and again over 5 times the pull-off.
        """
        s = self.setup
        search = (AXES - 1 + 1.5) * max(s.travel_mm) / s.homing_mm_per_s
        return search + AXES * (5.0 * s.pull_off_mm / s.homing_slow_mm_per_s + 2.0)

    def _s_word(self, power: float) -> str:
        return f"S{round(power * self.setup.full_power)}"

    @staticmethod
    def _machine(report: Report) -> Sequence[float]:
        """Machine positions of the axes, mm."""
        if report.machine_mm is None:
            raise Fault("the board does not report machine positions, expected $10=1")
        return report.machine_mm

    def _log(self, timed: TimedReport) -> None:
        """Log a report, in the thread that reads the line."""
        if timed.report.state in ("Run", "Jog"):
            self._brightest = max(self._brightest, timed.report.power)
        if not self.board.homed or timed.report.machine_mm is None or timed.uncertain_seconds > WELL_TIMED_SECONDS:
            return
        moving = timed.report.state in ("Run", "Jog") or (timed.report.state, timed.report.substate) == ("Hold", 1)
        entry = HeadPosition(
            timed.seconds, self.carriages.world(timed.report.machine_mm), timed.uncertain_seconds, moving
        )
        # A lost byte can leave a report that looks whole: a jump that no head can make counts only if it is repeated.
        if self._suspect is None or self._can_follow(self._suspect, entry):
            self.log.add(entry)
        self._suspect = entry

    def _can_follow(self, before: HeadPosition, entry: HeadPosition) -> bool:
        passed = entry.seconds - before.seconds + entry.uncertain_seconds + before.uncertain_seconds
        reach = 2.0 * max(self.setup.max_mm_per_s) * passed + SLACK_MM
        return all(abs(b - a) <= reach for a, b in zip(before.x_mm, entry.x_mm, strict=True))


def _off(by_mm: float) -> str:
    return "never met its home switch" if math.isinf(by_mm) else f"by {by_mm:+.2f} mm"


def _out_of_reach(x_mm: float, low: float, high: float) -> str:
    return f"{x_mm:g} mm is out of reach, expected {low:g} to {high:g}"

"""Faults on the serial line, at random: afterwards it is dark, the state told is the true one, and the next try works.

    FOOTSCAN_FUZZ=200 pytest tests/footscan/capture/test_controller_faults.py       200 cases instead of a few
    FOOTSCAN_FUZZ_FIRST=17 FOOTSCAN_FUZZ=1 pytest ...                               case 17 again
    FOOTSCAN_FUZZ_RECORD=cases.jsonl                                                one line a case

What happens in a case follows from its number; when, only as nearly as threads are woken.
"""

import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from random import Random

import pytest
from waiting import wait_until

from footscan.capture.board.heads import Heads
from footscan.capture.grbl.settings import required_settings
from footscan.virtual.board.board import Board
from schemas.base.errors import FootscanError
from schemas.rig import RigBoard

pytestmark = pytest.mark.real_time  # the board answers on a terminal of the system

CASES = int(os.environ.get("FOOTSCAN_FUZZ", "25"))
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
RECORD = os.environ.get("FOOTSCAN_FUZZ_RECORD")
AT_A_TIME = 5
PATIENCE_SECONDS = 0.5
SETTINGS = RigBoard(
    max_mm_per_s=(400.0, 400.0, 400.0),
    mm_per_s2=(8000.0, 8000.0, 8000.0),
    homing_mm_per_s=400.0,
    homing_slow_mm_per_s=80.0,
)
STATES = {
    "ready": {"Idle"},
    "not homed": {"Idle", "Alarm"},
    "alarm": {"Alarm"},
    "moving": {"Run"},
    "jogging": {"Jog"},
    "held": {"Hold"},
    "door": {"Door"},
}

Fault = Callable[[Random, Board], str]


@pytest.fixture(scope="module")
def cases() -> Iterator[dict[int, "Future[None]"]]:
    """All cases, several at a time: most of their time is waiting."""
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(AT_A_TIME) as pool:
        patch.setattr("footscan.virtual.board.firmware.ALARM_SECONDS", 0.05)
        yield {number: pool.submit(try_case, number) for number in range(FIRST, FIRST + CASES)}


@pytest.mark.parametrize("number", range(FIRST, FIRST + CASES))
def test_fault(number: int, cases: dict[int, "Future[None]"]) -> None:
    cases[number].result()


def try_case(number: int) -> None:
    random = Random(f"serial {number}")
    with Board(settings={**required_settings(SETTINGS), 26: 2}, heads_at=(-6.0, -4.0, -8.0)) as board:
        heads = Heads(board.port, SETTINGS, patience_seconds=PATIENCE_SECONDS)
        try:
            heads.home()
            heads.lasers(0.6)
            what, told = one_mishap(random, board, heads)
            case = f"serial {number}: {what}; told: {told}"
            wait_until(lambda: dark_and_still(board), case)
            wait_until(lambda: is_true(heads, board), case, lambda: f"{heads.state}, truly {truth(board)}")
            state = heads.state.name
            heads = recovered(heads, board)
            check_travel(heads, board, case)
        finally:
            heads.close()
        wait_until(lambda: dark_and_still(board), case)
    if RECORD:
        with Path(RECORD).open("a") as file:
            file.write(json.dumps({"case": number, "fault": what, "told": told, "state": state}) + "\n")


def one_mishap(random: Random, board: Board, heads: Heads) -> tuple[str, str]:
    """Something is done while something goes wrong: what, and what the one who did it was told."""
    doing, do = random.choice(ACTIONS)
    fault = random.choice(FAULTS)
    if fault in AT_ONCE:
        what = fault(random, board)
        told = outcome(lambda: do(heads))
    else:
        after, words = random.uniform(0.0, 0.4), [""]
        timer = threading.Timer(after, lambda: words.insert(0, fault(random, board)))
        timer.start()
        told = outcome(lambda: do(heads))
        timer.join()
        what = f"{words[0]} after {after:.2f} s"
    time.sleep(random.choice((0.0, 0.0, 0.1)))
    return f"{doing}, {what}", told


def travel(heads: Heads) -> None:
    heads.travel(0.0, 60.0, 200.0)


def shine(heads: Heads) -> None:
    heads.shine(0.5, 0.2)


def home(heads: Heads) -> None:
    heads.home()


def jog(heads: Heads) -> None:
    for _ in range(3):
        heads.jog(10.0, 100.0)


def ask(heads: Heads) -> None:
    heads.board.check(SETTINGS)
    heads.position_mm()


ACTIONS = (
    ("travel", travel),
    ("travel", travel),
    ("travel", travel),
    ("shine", shine),
    ("home", home),
    ("jog", jog),
    ("ask", ask),
)


def bytes_harmed(random: Random, board: Board) -> str:
    direction = random.choice(("to board", "to host"))
    harm = random.choice(("lose", "lose", "double", "garbage", "delay"))
    after, count = random.randrange(120), random.choice((1, 1, 2, 5, 20))
    seconds = random.choice((0.05, 0.3, 0.8)) if harm == "delay" else 0.0
    board.disturb(direction, harm, after=after, count=count, seconds=seconds)
    return f"{harm} {count} bytes {direction} behind {after}" + (f", {seconds} s" if seconds else "")


def many_bytes_harmed(random: Random, board: Board) -> str:
    return "; ".join(bytes_harmed(random, board) for _ in range(random.randrange(2, 6)))


def restarted(_: Random, board: Board) -> str:
    board.restart()
    return "board restarts"


def unplugged(_: Random, board: Board) -> str:
    board.pull_cable()
    return "cable pulled"


def unplugged_for_a_moment(random: Random, board: Board) -> str:
    board.pull_cable()
    time.sleep(random.uniform(0.0, 0.2))
    board.plug_cable()
    return "cable pulled and put back"


def hung(_: Random, board: Board) -> str:
    board.frozen = True
    return "board hangs"


def hung_for_a_moment(random: Random, board: Board) -> str:
    board.frozen = True
    lasting = random.uniform(0.05, 1.2)
    time.sleep(lasting)
    board.frozen = False
    return f"board hangs for {lasting:.2f} s"


def lid_opened(random: Random, board: Board) -> str:
    board.open_door()
    time.sleep(random.uniform(0.0, 0.2))
    board.close_door()
    board.firmware.receive(b"~")
    return "lid opened and closed, resumed"


def paused(_: Random, board: Board) -> str:
    board.pause(0.5)
    return "motors pause"


AT_ONCE: tuple[Fault, ...] = (bytes_harmed, many_bytes_harmed)
FAULTS: tuple[Fault, ...] = (
    *(bytes_harmed,) * 7,
    *(many_bytes_harmed,) * 3,
    restarted,
    unplugged,
    unplugged_for_a_moment,
    hung,
    hung_for_a_moment,
    lid_opened,
    paused,
)


def outcome(do: Callable[[], object]) -> str:
    """What the one who did it was told; only the project's own errors may be."""
    try:
        do()
    except FootscanError as error:
        return f"{type(error).__name__}: {error}"
    return "done"


def dark_and_still(board: Board) -> bool:
    """Whether light and motion have ended."""
    return board.laser_at(time.monotonic()) == 0.0 and not board.motion.is_moving


def is_true(heads: Heads, board: Board) -> bool:
    """Whether the state told is that of the board, and positions are where the heads stand."""
    state = heads.state
    if state.name == "lost":
        return True
    if board.frozen or state.name not in STATES:
        return False
    if board.firmware.state not in STATES[state.name]:
        return False
    if state.name == "ready":
        try:
            told = heads.position_mm()
        except FootscanError:
            return False  # a fault that came late: the state after it is looked at again
        where = board.position_at(time.monotonic())
        return all(abs(a - b) < 0.05 for a, b in zip(told, where, strict=True))
    return True


def truth(board: Board) -> str:
    return f"{board.firmware.state}, heads at {board.position_at(time.monotonic())}"


def recovered(heads: Heads, board: Board) -> Heads:
    """After a person has put the cable back and switched the board off and on, where it was lost."""
    board.line.mishaps.clear()
    board.close_door()
    if heads.state.name != "lost":
        return heads
    heads.close()
    board.frozen = False
    board.plug_cable()
    return Heads(board.port, SETTINGS, patience_seconds=PATIENCE_SECONDS)


def check_travel(heads: Heads, board: Board, case: str) -> None:
    """The next homing and travel work, lit on the way and dark behind it."""
    heads.home()
    heads.lasers(0.4)
    made = heads.travel(0.0, 40.0, 200.0)
    where = board.position_at(time.monotonic())
    assert where == pytest.approx((42.5,) * 3, abs=0.02), case  # 2.5 mm to slow down
    times = [made.begin_seconds + k / 200.0 * (made.end_seconds - made.begin_seconds) for k in range(200)]
    assert max(board.laser_at(seconds) for seconds in times) == pytest.approx(0.4, abs=1e-6), case
    assert board.laser_at(time.monotonic()) == 0.0, case

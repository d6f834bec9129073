"""Faults at random while a scan is filmed: lasers end off, the state told is true, no scan looks whole that is not, and
the next one works.

    FOOTSCAN_FUZZ=500 pytest tests/fuzz/test_fuzz_scanner.py -s          500 cases instead of a few
    FOOTSCAN_FUZZ_FIRST=17 FOOTSCAN_FUZZ=1 pytest ...                    case 17 again
    FOOTSCAN_FUZZ_RECORD=cases.jsonl                                     one line a case

What happens in a case follows from its number; when, only as nearly as threads are woken.
"""

import json
import os
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from random import Random

import pytest
from scanner_bench import SETTINGS, Bench, HostWatch, open_bench
from scanner_troubles import Coming, Trouble, lift, random_trouble
from waiting import LONG_SECONDS, wait_until

from footscan.capture.board.heads import Heads
from pipelines.live.scan_order import LiveResult
from pipelines.live.scanner import STOPPED
from schemas.base.errors import Fault, Finding, FootscanError

pytestmark = [pytest.mark.real_time, pytest.mark.slow]  # cameras stream while heads move

CASES = int(os.environ.get("FOOTSCAN_FUZZ", "6"))
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
RECORD = os.environ.get("FOOTSCAN_FUZZ_RECORD")
AT_A_TIME = 3
SCAN_SECONDS = 6.0
"""What a scan takes with its homing, and with feeling for the switches at the end."""
LARGEST_SD_MM = 5.0
HOST_STALLS_S = 0.1
"""A case that fails while this computer stands still for so long says nothing of the scanner, and is tried again."""
TRIES = 5
STAYS_SECONDS = 0.3
"""How long it is watched whether it stays dark."""

Tally = Counter[tuple[str, str]]


@pytest.fixture(scope="module")
def tally() -> Iterator[Tally]:
    """How often a kind of trouble ended how; printed at the end."""
    counted: Tally = Counter()
    yield counted
    print(*(f"{count:4d}  {kind:24s}  {end}" for (kind, end), count in sorted(counted.items())), sep="\n")


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory, tally: Tally) -> Iterator[dict[int, "Future[None]"]]:
    """All cases, several at a time: most of their time is waiting."""
    home = tmp_path_factory.mktemp("scanner")
    quick = partial(Heads, settings=SETTINGS)
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(AT_A_TIME) as pool:
        patch.setattr("pipelines.live.scanner.Heads", quick)
        # A busy host times frames badly and says so; places are compared with the true ones below.
        patch.setattr("pipelines.live.storing.LARGEST_SD_MM", LARGEST_SD_MM)
        patch.setattr("footscan.capture.frame_positions.LARGEST_SD_MM", LARGEST_SD_MM)
        yield {number: pool.submit(try_again, number, home, tally) for number in range(FIRST, FIRST + CASES)}
        pool.shutdown(cancel_futures=True)  # whoever ends the tests waits for no more than what is under way


@pytest.mark.parametrize("number", range(FIRST, FIRST + CASES))
def test_trouble(number: int, cases: dict[int, "Future[None]"]) -> None:
    cases[number].result()


def try_again(number: int, home: Path, tally: Tally) -> None:
    """One case, anew where it fails while the host stands still."""
    for attempt in range(1, TRIES + 1):
        with HostWatch() as host:
            try:
                try_case(number, home / f"{number}-{attempt}", tally)
            except AssertionError as error:
                told = f"{error}; the host stood still for {host.longest_s:.3f} s at most"
                record({"case": number, "attempt": attempt, "failed": told})
                if attempt == TRIES or host.longest_s < HOST_STALLS_S:
                    raise AssertionError(told) from error
                tally["host: stood still", "tried again"] += 1
            else:
                return


def try_case(number: int, home: Path, tally: Tally) -> None:
    random = Random(f"scanner {number}")
    with open_bench(home) as bench:
        trouble = random_trouble(random, bench)
        after = random.uniform(0.0, SCAN_SECONDS)
        case = f"case {number}: {trouble.kind} {trouble.words} after {after:.2f} s"
        began = time.monotonic()
        coming = Coming(trouble, after)
        end = scan_in_trouble(bench, random)
        coming.join()
        case += f"; ended: {end if isinstance(end, FootscanError) else 'scan stored'}"
        wait_until(bench.is_dark_and_still, case)
        dark = time.monotonic()
        wait_until(lambda: is_true(bench, end, trouble), case, lambda: told_and_true(bench))
        told = str(bench.scanner.state)
        time.sleep(STAYS_SECONDS)
        assert bench.brightest_since(dark) == 0.0, case
        try:
            lost = check_archive(bench, end, began)
            lift(bench)
            if end_of_lid(bench, random):
                case += ", then the lid"
            if trouble.held:
                find_lost_steps(bench)
            again = time.monotonic()
            following = bench.scanner.scan(bench.order())
            assert bench.scanner.state.name == "done"
            bench.check_scan(following, again)
        except (FootscanError, AssertionError) as error:
            raise AssertionError(f"{case}; told: {told}; {type(error).__name__}: {error}") from error
        wait_until(bench.is_dark_and_still, case)
    tally[trouble.kind, in_short(end, lost)] += 1
    what = {"case": number, "kind": trouble.kind, "words": trouble.words, "after": round(after, 2)}
    record({**what, "end": in_short(end, lost), "told": told})


def scan_in_trouble(bench: Bench, random: Random) -> LiveResult | FootscanError:
    """A scan, with a person beside it who goes on or stops where the lid was open; how it ended."""
    with ThreadPoolExecutor(1) as pool:
        scan = pool.submit(bench.scanner.scan, bench.order())
        deadline = time.monotonic() + LONG_SECONDS
        while not scan.done() and time.monotonic() < deadline:
            time.sleep(0.05)
            end_of_lid(bench, random)
        if not scan.done():
            bench.scanner.stop()
    try:
        return scan.result()
    except FootscanError as error:
        return error


def end_of_lid(bench: Bench, random: Random) -> bool:
    """Goes on, or stops, where the lid was open and is closed again; whether that was so."""
    if bench.scanner.state.name != "door open" or bench.board.firmware.pins.door_open:
        return False
    try:
        random.choice((bench.scanner.heads.resume, bench.scanner.stop))()
    except Fault:
        return False  # the line is lost besides
    return True


def check_archive(bench: Bench, end: LiveResult | FootscanError, began: float) -> int | None:
    """The scan is there and whole, or there is nothing at all; how many frames are told to be lost."""
    if isinstance(end, FootscanError):
        assert bench.in_archive() == set()
        return None
    assert bench.in_archive() == {end.stored.place.name}
    return bench.check_scan(end, began)


def find_lost_steps(bench: Bench) -> None:
    """Whoever doubts where the heads are asks."""
    try:
        bench.scanner.heads.lost_steps_mm()
    except Fault:
        bench.scanner.home()


def is_true(bench: Bench, end: LiveResult | FootscanError, trouble: Trouble) -> bool:
    """Whether the state told is that of the world."""
    board, state = bench.board, bench.scanner.state
    truly = board.firmware.state
    if state.name == "disconnected":
        return trouble.is_unheard or trouble.kind.startswith("bytes")
    if state.name in ("door open", "alarm"):
        return truly == {"door open": "Door", "alarm": "Alarm"}[state.name]
    if state.name != ("failed" if isinstance(end, FootscanError) else "done"):
        return False
    try:
        heads = bench.scanner.heads
    except Fault:
        return isinstance(end, FootscanError)  # it could not connect, and has said so
    if board.frozen or not Path(board.port).exists() or truly not in ("Idle", "Alarm"):
        return False
    return not heads.board.homed or (truly == "Idle" and stand_as_told(bench, trouble))


def stand_as_told(bench: Bench, trouble: Trouble) -> bool:
    """Whether heads that count as homed are where they are told to be."""
    try:
        told = bench.scanner.heads.position_mm()
    except FootscanError:
        return False  # a fault that came late: the state after it is looked at again
    where = bench.board.position_at(time.monotonic())
    return all(abs(a - b) < 0.05 or head in trouble.held for head, a, b in zip((1, 2, 3), told, where, strict=True))


def told_and_true(bench: Bench) -> str:
    where = bench.board.position_at(time.monotonic())
    return f"told {bench.scanner.state}, truly {bench.board.firmware.state}, heads at {where}"


def record(case: dict[str, object]) -> None:
    if RECORD:
        with Path(RECORD).open("a") as file:
            file.write(json.dumps(case) + "\n")


def in_short(end: LiveResult | FootscanError, lost: int | None) -> str:
    """How it ended, for the tally."""
    if not isinstance(end, FootscanError):
        return "scan stored, lost frames told" if lost else "scan stored"
    if str(end) == STOPPED:
        return "nothing stored: stopped"
    return "nothing stored: films not whole" if isinstance(end, Finding) else f"nothing stored: {type(end).__name__}"

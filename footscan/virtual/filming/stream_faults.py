"""Faults of a camera on a cable: exposures that are dropped, repeated, torn, held back or cut off."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

FaultKind = Literal["drop", "repeat", "tear", "stall", "cut"]
KINDS: tuple[FaultKind, ...] = get_args(FaultKind)


@dataclass(frozen=True)
class StreamFault:
    """A fault of the exposures `first` to `first + count - 1` of a camera."""

    kind: FaultKind
    """`drop`: never sent; `repeat`: the picture before is sent again, as by a camera that freezes; `tear`: cut short;
    `stall`: held back, then sent in a burst; `cut`: the connection is closed, and refused until they are over."""
    first: int
    count: int = 1

    def holds(self, number: int) -> bool:
        """Returns True if the fault affects exposure `number`."""
        return self.first <= number < self.first + self.count


def fault_of(faults: Sequence[StreamFault], number: int) -> StreamFault | None:
    """Returns the first fault that affects exposure `number`; None if there is none."""
    return next((fault for fault in faults if fault.holds(number)), None)


def random_faults(seed: int, exposures: int, kinds: Sequence[FaultKind] = KINDS) -> list[StreamFault]:
    """One fault of each of `kinds`, of one to six exposures, apart from each other and from both ends."""
    random = np.random.default_rng(seed)
    room = exposures // (len(kinds) + 1)
    if room < 8:
        raise ValueError(
            f"expected at least {8 * (len(kinds) + 1)} exposures for {len(kinds)} faults, found {exposures}"
        )
    order = random.permutation(len(kinds))
    return [
        StreamFault(kinds[kind], room * (place + 1) + int(random.integers(0, room - 7)), int(random.integers(1, 7)))
        for place, kind in enumerate(order)
    ]


def torn(jpeg: bytes, number: int) -> bytes:
    """`jpeg` as a camera tears it, in one of three ways by its number: end lost, half lost, a piece lost inside."""
    third = len(jpeg) // 3
    return (jpeg[:-2], jpeg[: 2 * third], jpeg[:third] + jpeg[2 * third :])[number % 3]

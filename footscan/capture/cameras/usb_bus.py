"""Plans the passes of a scan: the cameras that a USB bus carries at the same time.

An isochronous camera reserves time on its bus for the largest packet it may send, in every microframe, whatever it
then sends. Many webcams ask for their largest setting at any size and rate: two of those do not go together on a USB 2
bus, though the films of eight would fill a tenth of it. The host refuses the camera that is one too many.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from schemas.base.errors import RefusedInput

HIGH_SPEED_MBIT, SUPER_SPEED_MBIT = 480, 5000
MICROFRAME_US = 125.0
HIGH_SPEED_US = 0.8 * MICROFRAME_US
"""USB 2.0, 5.6.4: at most 80 % of a microframe for periodic transfers, 6000 of its 7500 bytes with all overhead."""
SUPER_SPEED_US = 0.9 * MICROFRAME_US
"""Linux keeps 10 % for other transfers (`SS_BW_RESERVED` of its xHCI driver)."""
MOST_CAMERAS = 16
"""Largest number of cameras on one bus; the exact search takes a second for it."""


@dataclass(frozen=True)
class UsbCamera:
    """A camera's place on the bus, as far as known."""

    camera: int
    bus: str | None = None
    """Root hub, `usb1`. All below one root hub share its bandwidth: a USB 2 camera behind a USB 3 hub is on the USB 2
    root hub beside it. None: no USB camera."""
    port: str | None = None
    """`1-1.4`: bus 1, port 1, port 4 of the hub there."""
    speed_mbit: float | None = None
    """12, 480 or 5000; None: unknown."""
    payloads: tuple[int, ...] = ()
    """Bytes per microframe of each isochronous setting, increasing. Empty: a bulk camera, or unknown."""
    is_bulk: bool = False
    """A bulk camera reserves nothing, and takes the remaining bandwidth."""
    reserved: int | None = None
    """Bytes per microframe that it reserved while it filmed; None: not yet tried, so its largest setting counts."""

    @property
    def payload(self) -> int | None:
        """Bytes per microframe to plan with; None: unknown."""
        if self.is_bulk:
            return 0
        return self.reserved or (self.payloads[-1] if self.payloads else None)


@dataclass(frozen=True)
class Pass:
    """Cameras that film at the same time, during one travel of the heads."""

    cameras: tuple[int, ...]
    reason: str
    """Reason for this choice, in a sentence."""


def plan_passes(cameras: Sequence[UsbCamera]) -> list[Pass]:
    """Find the fewest passes in which every camera films once; exact.

    A camera of which nothing is known counts as taking nothing, and the reason says so: the host will tell.

    Raises
    ------
    RefusedInput
        A camera twice, more than 16 on a bus, or one whose reservation is beyond its bus.
    """
    numbers = [camera.camera for camera in cameras]
    if len(set(numbers)) < len(numbers):
        raise RefusedInput("cameras", f"expected each camera once, found {sorted(numbers)}", field="camera")
    by_bus = {
        bus: _passes_of_bus(list(sharing), bus)
        for bus, sharing in groupby(sorted(cameras, key=lambda c: (c.bus or "", c.camera)), lambda c: c.bus or "")
    }
    count = max((len(groups) for groups in by_bus.values()), default=0)
    narrow = [(bus, groups) for bus, groups in by_bus.items() if len(groups) == count]
    passes = []
    for place in range(count):
        groups_now = (group for groups in by_bus.values() for group in groups[place : place + 1])
        filming = sorted((camera for group in groups_now for camera in group), key=_number)
        passes.append(Pass(tuple(map(_number, filming)), _reason(filming, cameras, place, count, narrow)))
    return passes


def microframe_us(payload: int, speed_mbit: float) -> float:
    """Return the time on the bus of an isochronous packet, with its overhead.

    High speed by USB 2.0, 5.11.3, with the worst bit stuffing, as the hosts reckon: 38 bytes of protocol and 7 bits for
    6. SuperSpeed: 10 bits a byte, and 128 bytes of overhead for each packet of 1024, as Linux allows for.
    """
    if payload == 0:
        return 0.0
    if speed_mbit >= SUPER_SPEED_MBIT:
        return (payload + 128 * -(-payload // 1024)) * 10 / speed_mbit
    stuffed_bits = 7 * 8 * payload // 6
    return (38 * 8 + 3 + stuffed_bits) / HIGH_SPEED_MBIT


def _number(camera: UsbCamera) -> int:
    return camera.camera


def _cost_us(camera: UsbCamera) -> float:
    if camera.speed_mbit is not None and camera.speed_mbit < HIGH_SPEED_MBIT:
        return _capacity_us(camera)  # at 12 Mbit/s it keeps the hub's translator busy: by itself
    return microframe_us(camera.payload or 0, camera.speed_mbit or HIGH_SPEED_MBIT)


def _capacity_us(camera: UsbCamera) -> float:
    return SUPER_SPEED_US if (camera.speed_mbit or 0) >= SUPER_SPEED_MBIT else HIGH_SPEED_US


def _passes_of_bus(cameras: list[UsbCamera], bus: str) -> list[list[UsbCamera]]:
    """Bin packing, exact: the fewest groups, and of those the one that fills its last group least, for every subset."""
    if not bus:
        return [cameras]
    if len(cameras) > MOST_CAMERAS:
        raise RefusedInput(
            bus, f"expected at most {MOST_CAMERAS} cameras on a bus, found {len(cameras)}", field="cameras"
        )
    capacity = max(map(_capacity_us, cameras))
    costs = [_cost_us(camera) for camera in cameras]
    for camera, cost in zip(cameras, costs, strict=True):
        if cost > capacity:
            problem = f"camera {camera.camera} reserves {cost:.0f} us of {capacity:.0f} us a microframe"
            raise RefusedInput(bus, problem, field="reservation")
    best: list[tuple[int, float]] = [(1, 0.0)] + [(len(cameras) + 1, 0.0)] * (2 ** len(cameras) - 1)
    added = [0] * len(best)
    for subset in range(1, len(best)):
        for item, cost in enumerate(costs):
            if not subset >> item & 1:
                continue
            groups, filled = best[subset ^ 1 << item]
            candidate = (groups, filled + cost) if filled + cost <= capacity + 1e-9 else (groups + 1, cost)
            if candidate < best[subset]:
                best[subset], added[subset] = candidate, item
    return _groups(cameras, best, added)


def _groups(cameras: list[UsbCamera], best: list[tuple[int, float]], added: list[int]) -> list[list[UsbCamera]]:
    groups: list[list[UsbCamera]] = [[] for _ in range(best[-1][0])]
    subset = len(best) - 1
    while subset:
        groups[best[subset][0] - 1].append(cameras[added[subset]])
        subset ^= 1 << added[subset]
    return sorted((sorted(group, key=_number) for group in groups), key=lambda group: _number(group[0]))


def _reason(
    filming: list[UsbCamera],
    cameras: Sequence[UsbCamera],
    place: int,
    count: int,
    narrow: list[tuple[str, list[list[UsbCamera]]]],
) -> str:
    unknown = [c.camera for c in filming if c.bus and c.payload is None]
    slow = [c.camera for c in filming if c.speed_mbit is not None and c.speed_mbit < HIGH_SPEED_MBIT]
    notes = "".join(
        [
            f"; what {_cameras(unknown)} will reserve is not known, so the host may still refuse" if unknown else "",
            f"; {_cameras(slow)} got no more than 12 Mbit/s: try another cable or port" if slow else "",
        ]
    )
    if count == 1:
        return f"All {len(cameras)} cameras in one pass: {_loads(filming)}{notes}."
    bus, groups = narrow[0]
    sharing = [camera for group in groups for camera in group]
    most = max(sharing, key=_cost_us)
    why = (
        f"bus {bus} grants {_capacity_us(most):.0f} us of a microframe and has {len(sharing)} cameras of up to "
        f"{_cost_us(most):.1f} us ({most.payload or 0} bytes)"
    )
    return f"Pass {place + 1} of {count}, {_cameras(map(_number, filming))}: {why}{notes}."


def _loads(filming: list[UsbCamera]) -> str:
    """Load of each bus."""
    loads = []
    for bus, sharing in groupby(sorted(filming, key=lambda c: (c.bus or "", c.camera)), lambda c: c.bus):
        group = list(sharing)
        if bus is None:
            loads.append(f"{_cameras(map(_number, group))} on no USB bus of this computer")
        else:
            loads.append(f"bus {bus} carries {sum(map(_cost_us, group)):.0f} of {_capacity_us(group[0]):.0f} us")
    return ", ".join(loads)


def _cameras(numbers: "Sequence[int] | map[int]") -> str:
    listed = list(numbers)
    return f"camera{'s' * (len(listed) > 1)} {', '.join(map(str, listed))}"

"""Exposure, gain, white balance, focus and mains frequency, fixed before a scan and read back.

A camera that adjusts itself while the heads travel changes the stripe's width and the time of exposure with it. What it
lacks, or sets to something else than it was asked, is told.
"""

import json
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, Protocol

from footscan.capture.cameras.source import CameraSource
from footscan.capture.cameras.v4l2 import ControlRange, control_range, get_control, open_device, set_control
from schemas.base.errors import Fault, RefusedInput

ANSWER_SECONDS = 5.0
LONGEST_ANSWER = 65536
HTTP_NAMES = {"exposure_ms": "exposure", "gain": "gain"}

AUTO_EXPOSURE, EXPOSURE, EXPOSURE_BEFORE_RATE = 0x9A0901, 0x9A0902, 0x9A0903
AUTO_GAIN, GAIN = 0x980912, 0x980913
AUTO_WHITE_BALANCE, WHITE_BALANCE = 0x98090C, 0x98091A
AUTO_FOCUS, FOCUS = 0x9A090C, 0x9A090A
MAINS = 0x980918
"""`V4L2_CID_...` of linux/v4l2-controls.h."""
MANUAL_EXPOSURE = 1
EXPOSURE_UNIT_MS = 0.1


@dataclass(frozen=True)
class ControlValues:
    """Values to fix; None: unchanged."""

    exposure_ms: float | None = None
    """Exposure, no longer than a frame: a longer one reduces the frame rate."""
    gain: float | None = None
    """Share of the camera's range, 0 to 1: its unit is the maker's own."""
    white_balance_k: float | None = None
    focus: float | None = None
    """Share of the camera's range, 0 to 1."""
    mains_hz: Literal[0, 50, 60] | None = None
    """Mains frequency of the lamps, against flicker; 0: no correction."""


@dataclass(frozen=True)
class FixedControl:
    """A control after it was set."""

    name: str
    """As in `ControlValues`."""
    asked: float
    found: float | None
    """Value that the camera reports; None if it reports none."""
    problem: str | None
    """Reason why it differs from the request; None if it agrees to the step of the camera."""


class CameraControls(Protocol):
    """Sets the controls of a camera."""

    def fix(self, values: ControlValues) -> list[FixedControl]:
        """Set the controls named in `values`, with all automatics off; Fault if the camera does not answer."""


def controls_of(source: CameraSource, control_url: str | None = None) -> CameraControls:
    """Return the controls of a camera: those of its driver, those of its web page, or none."""
    if source.is_device:
        return V4l2Controls(Path(source.address))
    return NoControls() if control_url is None else HttpControls(control_url)


def asked_of(values: ControlValues) -> dict[str, float]:
    """Yield name and value of each control to fix; RefusedInput for an impossible value."""
    asked = {name: float(value) for name, value in asdict(values).items() if value is not None}
    for name, value in asked.items():
        if name in {"gain", "focus"} and not 0 <= value <= 1:
            raise RefusedInput("camera controls", f"expected 0 to 1, found {value:g}", field=name)
        if name in {"exposure_ms", "white_balance_k"} and not 0 < value < 1e6:
            raise RefusedInput("camera controls", f"expected more than 0, found {value:g}", field=name)
        if name == "mains_hz" and value not in {0, 50, 60}:
            raise RefusedInput("camera controls", f"expected 0, 50 or 60, found {value:g}", field=name)
    return asked


class NoControls:
    """A camera that cannot be set by footscan: a network camera is set on its own web page."""

    def fix(self, values: ControlValues) -> list[FixedControl]:
        """Set nothing, and report this for each control."""
        problem = "this camera cannot be set from here: set it on its own page"
        return [FixedControl(name, value, None, problem) for name, value in asked_of(values).items()]


class HttpControls:
    """A camera that accepts `GET URL?exposure=MS&gain=SHARE` and answers with the values that it has set, as JSON."""

    def __init__(self, url: str) -> None:
        if urllib.parse.urlsplit(url).scheme not in {"http", "https"}:
            raise RefusedInput(url, "expected an address of http or https", field="control_url")
        self._url = url

    def fix(self, values: ControlValues) -> list[FixedControl]:
        """As `CameraControls.fix`."""
        asked = asked_of(values)
        query = {HTTP_NAMES[name]: f"{value:g}" for name, value in asked.items() if name in HTTP_NAMES}
        found = self._answer(query) if query else {}
        return [self._outcome(name, value, found) for name, value in asked.items()]

    def _answer(self, query: dict[str, str]) -> dict[str, object]:
        address = f"{self._url}?{urllib.parse.urlencode(query)}"
        try:
            with urllib.request.urlopen(address, timeout=ANSWER_SECONDS) as reply:
                answer = json.loads(reply.read(LONGEST_ANSWER))
        except (OSError, ValueError) as error:
            raise Fault(f"{self._url}: the camera cannot be set ({error})") from None
        return answer if isinstance(answer, dict) else {}

    def _outcome(self, name: str, asked: float, answer: dict[str, object]) -> FixedControl:
        if name not in HTTP_NAMES:
            return FixedControl(name, asked, None, "this camera has no such control")
        found = answer.get(HTTP_NAMES[name])
        if not isinstance(found, int | float):
            return FixedControl(name, asked, None, "the camera does not say what it has set")
        return FixedControl(name, asked, float(found), _difference(asked, float(found), 1e-3 * abs(asked)))


class V4l2Controls:
    """A camera of this computer, set by its driver."""

    def __init__(self, node: Path) -> None:
        self._node = node

    def fix(self, values: ControlValues) -> list[FixedControl]:
        """As `CameraControls.fix`."""
        asked = asked_of(values)
        with open_device(self._node) as device:
            return [_fixed(device, name, value) for name, value in asked.items()]


@dataclass(frozen=True)
class _Control:
    """A control of V4L2 and the automatics that must be switched off first."""

    control: int
    automatics: tuple[tuple[int, int], ...] = ()
    unit: float | None = None
    """Of the driver's number; None: a share of its range."""


_CONTROLS = {
    "exposure_ms": _Control(
        EXPOSURE, ((AUTO_EXPOSURE, MANUAL_EXPOSURE), (EXPOSURE_BEFORE_RATE, 0)), unit=EXPOSURE_UNIT_MS
    ),
    "gain": _Control(GAIN, ((AUTO_GAIN, 0),)),
    "white_balance_k": _Control(WHITE_BALANCE, ((AUTO_WHITE_BALANCE, 0),), unit=1.0),
    "focus": _Control(FOCUS, ((AUTO_FOCUS, 0),)),
    "mains_hz": _Control(MAINS, unit=1.0),
}
MAINS_HZ = (0, 50, 60)
"""Mains frequencies by the numbers of `enum v4l2_power_line_frequency`, without 3, automatic."""


def _fixed(device: int, name: str, asked: float) -> FixedControl:
    known = _CONTROLS[name]
    problems = list(_switched_off(device, known))
    limits = control_range(device, known.control)
    if limits is None:
        return FixedControl(name, asked, None, "; ".join([*problems, "this camera has no such control"]))
    if limits.is_inactive:
        problems.append(f"{limits.name} is overruled by an automatic")
    wanted = _number_of(name, asked, limits)
    if not set_control(device, known.control, wanted):
        problems.append(f"the camera refuses {limits.name} = {wanted}")
    number = get_control(device, known.control)
    if number is None:
        return FixedControl(name, asked, None, "; ".join([*problems, "the camera does not say what it has set"]))
    found = _value_of(name, number, limits)
    step = 0.0 if name == "mains_hz" else _unit(known, limits) * limits.step
    if found is None:
        problems.append(f"set to {number}, which is none of ours")
    elif difference := _difference(asked, found, step):
        problems.append(difference)
    return FixedControl(name, asked, found, "; ".join(problems) or None)


def _switched_off(device: int, known: _Control) -> Iterator[str]:
    """Switch off the automatics of a control, and yield those that stay on; a camera may have none."""
    for control, value in known.automatics:
        limits = control_range(device, control)
        if limits is None:
            continue
        set_control(device, control, value)
        if get_control(device, control) != value:
            yield f"{limits.name} stays on"


def _number_of(name: str, asked: float, limits: ControlRange) -> int:
    """Convert `asked` to the nearest number that the driver accepts."""
    if name == "mains_hz":
        return MAINS_HZ.index(int(asked))
    known = _CONTROLS[name]
    above = asked / _unit(known, limits) - (limits.least if known.unit else 0)
    number = limits.least + round(above / limits.step) * limits.step
    return min(max(number, limits.least), limits.most)


def _value_of(name: str, number: int, limits: ControlRange) -> float | None:
    """Invert `_number_of`; None for a number without a value."""
    if name == "mains_hz":
        return float(MAINS_HZ[number]) if 0 <= number < len(MAINS_HZ) else None
    known = _CONTROLS[name]
    return (number - (0 if known.unit else limits.least)) * _unit(known, limits)


def _unit(known: _Control, limits: ControlRange) -> float:
    return known.unit or 1 / max(limits.most - limits.least, 1)


def _difference(asked: float, found: float, step: float) -> str | None:
    return None if abs(found - asked) <= step + 1e-9 else f"set to {found:g} instead of {asked:g}"

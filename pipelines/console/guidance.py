"""What an operator is told to do, state by state."""

from pipelines.console.scanner import Health
from pipelines.live.state import ScannerState

_DO = {
    "disconnected": "The lasers are off. Check the controller’s USB cable and its power, then press “Connect”.",
    "alarm": "The lasers are off and the heads stand. See that nothing is in their way, then press “Home heads”.",
    "homing": "Keep hands off the rails.",
    "filming": "The foot stands still; nobody looks into the light.",
    "storing": "The foot may leave the glass.",
    "reconstructing": "The foot may leave the glass. The result will be shown here.",
    "failed": "The lasers are off, and nothing half done was kept. Put right what is named, then try again.",
}
_CLOSE = "Lasers and heads are stopped. Close the lid, then press “Go on”; or “Stop” gives this scan up."
_CLOSE_THEN_HOME = "Lasers and heads are stopped. Close the lid, then press “Home heads”."


def guidance(state: ScannerState, health: Health, is_scanning: bool) -> str:
    """What to do now; empty where the scanner waits for an order and all is well."""
    if state.name == "door open":
        return _CLOSE if is_scanning and health.resumable else _CLOSE_THEN_HOME
    if state.name not in {"idle", "done", "failed"}:
        return _DO.get(state.name, "")
    if is_scanning:
        return "The scan is being prepared."
    remedies = [f"{one.name}: {one.remedy or one.words}." for one in health.devices if one.level == "bad"]
    return " ".join([*remedies, *([_DO[state.name]] if state.name in _DO else [])])

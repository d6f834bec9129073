"""Instructions for the operator, by state."""

from pipelines.console.scanner import Health
from pipelines.live.state import ScannerState

_DO = {
    "disconnected": "The lasers are off. Check the controller’s USB cable and its power, then press “Connect”.",
    "alarm": "The lasers are off and the heads are stopped. Check that their way is clear, then press “Home heads”.",
    "homing": "Keep your hands off the rails.",
    "filming": "Keep the foot still, and do not look into the light.",
    "storing": "The foot may be taken off the glass.",
    "reconstructing": "The foot may be taken off the glass. The result will be shown here.",
    "failed": "The lasers are off, and no incomplete scan was kept. Fix the reported problem, then try again.",
}
_CLOSE = "Lasers and heads are stopped. Close the lid, then press “Go on”; or press “Stop” to give up this scan."
_CLOSE_THEN_HOME = "Lasers and heads are stopped. Close the lid, then press “Home heads”."


def guidance(state: ScannerState, health: Health, action: str | None) -> str:
    """What to do now; empty if the scanner is ready and all is well."""
    is_scanning = action == "scan"
    if action == "calibrate" and state.name == "filming":
        return "Keep your hands off, and do not look into the light."
    if state.name == "door open":
        return _CLOSE if is_scanning and health.resumable else _CLOSE_THEN_HOME
    if state.name not in {"idle", "preparing", "done", "failed"}:
        return _DO.get(state.name, "")
    if is_scanning:
        return "The scan is being prepared."
    if state.name == "preparing":
        return ""
    remedies = [
        f"{device.name}: {device.remedy or device.words}." for device in health.devices if device.level == "bad"
    ]
    return " ".join([*remedies, *([_DO[state.name]] if state.name in _DO else [])])

"""The light that the command line sets."""

from typing import TYPE_CHECKING

from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.live.light import ScanLight
    from schemas.rig import Rig


def light_of(rig: "Rig", power: float | None, exposure_ms: float | None, virtual: bool) -> "ScanLight | None":
    """The light set on the command line; None if it is to be chosen."""
    from pipelines.live.light import light_by_hand

    if power is None and exposure_ms is None:
        if not virtual:
            return None
        from pipelines.live.virtual.world import EXPOSURE_MS

        return light_by_hand(rig, 1.0, EXPOSURE_MS)  # its pictures are made beforehand, and for one light
    if power is None or exposure_ms is None:
        raise RefusedInput("--power, --exposure-ms", "go together, expected both or none")
    return light_by_hand(rig, power, exposure_ms)

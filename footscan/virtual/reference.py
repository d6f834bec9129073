"""The reference object that the virtual scanner is calibrated with."""

from schemas.reference import ReferenceObject

_PROFILE: list[tuple[float, float]] = [
    (-20, 0), (20, 0), (20, 30), (50, 30), (50, 70), (20, 70), (20, 100), (-20, 100), (-20, 70), (-50, 70), (-50, 30),
    (-20, 30),
]  # fmt: skip
_PLACEMENTS: list[tuple[float, float]] = [
    (0, 0), (30, 0), (-30, 0), (15, 0), (-15, 0), (24, 8), (-24, 8), (0, 14), (40, 14), (-40, 14),
]  # fmt: skip


def standard_reference() -> ReferenceObject:
    """A cross on a stem, 100 mm wide and high, in ten placements.

    Its corners reach Y = +-50 on the glass, where the flanks of a foot end, and fill the volume of 140 x 114 mm.
    """
    return ReferenceObject(
        format="footscan.reference/1",
        profile_mm=[list(corner) for corner in _PROFILE],
        placements_mm=[list(placement) for placement in _PLACEMENTS],
    )

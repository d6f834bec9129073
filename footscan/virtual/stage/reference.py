"""The reference object that the virtual scanner is calibrated with."""

from pathlib import Path

from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.reference import ReferenceObject

_PROFILE: list[tuple[float, float]] = [
    (-20, 0), (20, 0), (20, 30), (50, 30), (50, 70), (20, 70), (20, 100), (-20, 100), (-20, 70), (-50, 70), (-50, 30),
    (-20, 30),
]  # fmt: skip
_PLACEMENTS: list[tuple[float, float]] = [
    (0, 0), (40, 14), (-40, 14), (30, 0), (-30, 0), (0, 14), (24, 8), (-24, 8), (15, 0), (-15, 0),
]  # fmt: skip
"""The first five fill the volume on their own: its four corners and the middle."""


def standard_reference() -> ReferenceObject:
    """A cross on a stem, 100 mm wide and high, in ten placements.

    Its corners reach Y = +-50 on the glass, where the flanks of a foot end, and fill the volume of 140 x 114 mm.
    """
    return ReferenceObject(
        format="footscan.reference/1",
        profile_mm=[list(corner) for corner in _PROFILE],
        placements_mm=[list(placement) for placement in _PLACEMENTS],
    )


def read_reference(path: Path) -> ReferenceObject:
    """The reference object in the YAML file `path`; refused if a placement puts it into the glass."""
    reference = read_yaml(path, ReferenceObject)
    lowest = min(z for _, z in reference.profile_mm)
    for number, (_, shift) in enumerate(reference.placements_mm):
        if lowest + shift < -1e-9:  # sums of decimals are not exact
            problem = f"reaches down to Z = {lowest + shift:g} mm, expected the object on the glass (Z = 0) or above it"
            raise RefusedInput(path, problem, field=f"placements_mm.{number}")
    return reference

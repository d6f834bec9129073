"""Presets: parameters of several steps that belong together, by name."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator

Sections = Mapping[str, Mapping[str, Any]]

THESIS: Sections = {
    "extraction": {"stripe": "skeleton", "red_threshold": 72},
    "heads": {"correct_heads": False},
    "fusion": {"method": "concatenate", "correct_cameras": False},
    "outliers": {"method": "levels", "z_mm": [0.0, 300.0]},
    "surface": {"method": "ball_pivoting"},
}
"""The method of the thesis: the thinned largest part of the red pixels (5.2), no corrections, the three levels of
outliers within a control volume above the glass, clouds put together as they are, and ball pivoting (5.4). Its
calibration, a quadratic through five clicked points (4.10, 4.11), is a file, which `calibrate chart --model quadratic`
makes. The threshold is the best of 20, 40 and 72 on films of the virtual scanner in ordinary light."""
PRESETS: Mapping[str, Sections] = {"thesis": THESIS}


def preset_sections(preset: str) -> Sections:
    """The parameters of a preset, or of some of its steps.

    Raises
    ------
    ValueError
        There is no such preset, or it says nothing of a step.

    >>> preset_sections("thesis:heads,surface")
    {'heads': {'correct_heads': False}, 'surface': {'method': 'ball_pivoting'}}
    """
    name, colon, listed = preset.partition(":")
    if name not in PRESETS:
        raise ValueError(f"expected {', '.join(PRESETS)}, or {next(iter(PRESETS))}:STEP,STEP, found {name[:40]!r}")
    sections = PRESETS[name]
    steps = listed.split(",") if colon else list(sections)
    for step in steps:
        if step not in sections:
            raise ValueError(f"{name} has no {step[:40]!r}, expected one or more of {', '.join(sections)}")
    return {step: dict(sections[step]) for step in steps}


def _known(preset: str) -> str:
    preset_sections(preset)
    return preset


Preset = Annotated[str, AfterValidator(_known)]
"""The name of a preset, as `preset_sections` takes it."""


def overlaid(below: Sections, above: Sections) -> dict[str, dict[str, Any]]:
    """Both, section by section; where both have a parameter, that of `above`."""
    names = [*below, *(name for name in above if name not in below)]
    return {name: {**below.get(name, {}), **above.get(name, {})} for name in names}

"""Parameters from the command line, in place of those of a workflow."""

from collections.abc import Sequence

from schemas.base.errors import RefusedInput
from schemas.base.overrides import OPTION, overridden, parse_settings
from schemas.parameters.presets import overlaid, preset_sections
from schemas.parameters.scan import ScanParameters

PRESET = "preset"


def changed_parameters(parameters: ScanParameters, settings: Sequence[str]) -> ScanParameters:
    """`parameters` with `settings` (NAME=VALUE) in their place: first those of a preset, then single ones.

    Raises
    ------
    RefusedInput
        A setting is malformed, is repeated, or breaks the model.

    >>> changed = changed_parameters(ScanParameters(), ["preset=thesis:surface,fusion", "fusion.method=merge"])
    >>> print(changed.surface.method, changed.fusion.method, changed.fusion.correct_cameras, changed.outliers.method)
    ball_pivoting merge False evidence
    """
    values = parameters.model_dump(mode="json")
    preset = parse_settings(settings).get(PRESET)
    if preset is not None:
        try:
            values = overlaid(values, preset_sections(str(preset)))
        except ValueError as error:
            raise RefusedInput(OPTION, str(error), field=PRESET) from None
    return overridden(ScanParameters, values, [one for one in settings if one.partition("=")[0].strip() != PRESET])


def set_names(settings: Sequence[str]) -> set[str]:
    """Names, `section.name`, of the parameters that `settings` set, as `changed_parameters` accepts them."""
    given = parse_settings(settings)
    sections = preset_sections(str(given.pop(PRESET))) if PRESET in given else {}
    return {*given, *(f"{section}.{name}" for section, values in sections.items() for name in values)}

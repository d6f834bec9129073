"""Single values on the command line, `--set NAME=VALUE`, in place of those of a document."""

from collections.abc import Mapping, Sequence
from typing import Any

from schemas.base.errors import RefusedInput
from schemas.base.json_files import validate
from schemas.base.model import AnyDocument
from schemas.base.yaml_text import parse_yaml

OPTION = "--set"


def overridden(model: type[AnyDocument], values: Mapping[str, Any], settings: Sequence[str]) -> AnyDocument:
    """The document of `values`, overridden by each of `settings`.

    Parameters
    ----------
    settings : such as "extraction.red_threshold=22"; a list is written as in YAML, "outliers.z_mm=[-1, 100]"

    Raises
    ------
    RefusedInput
        A setting is malformed, is repeated, or breaks the model.
    """
    changed = dict(values)
    for name, value in parse_settings(settings).items():
        *sections, last = name.split(".")
        place = changed
        for section in sections:
            inner = place.get(section, {})
            if not isinstance(inner, Mapping):
                raise RefusedInput(OPTION, f"{section} holds no parameters, expected SECTION.NAME=VALUE", field=name)
            place[section] = place = dict(inner)
        place[last] = value
    return validate(OPTION, model, changed)


def parse_settings(settings: Sequence[str]) -> dict[str, Any]:
    """The value of each setting, by its name."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, value = (part.strip() for part in setting.partition("="))
        if not (name and equals):
            raise RefusedInput(OPTION, f"expected NAME=VALUE, found {setting[:80]!r}")
        if name in values:
            raise RefusedInput(OPTION, "is listed twice, expected each parameter once", field=name)
        values[name] = _list(name, value) if value.startswith("[") else value
    return values


def _list(name: str, value: str) -> Any:
    try:
        return parse_yaml(value)
    except ValueError as error:
        raise RefusedInput(OPTION, str(error), field=name) from None

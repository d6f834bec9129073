"""The base of all documents of the project, and the types of fields that several of them have."""

import json
import re
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict

from schemas.base.errors import RefusedInput


def _pseudonym(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
        raise ValueError("expected 1 to 64 letters, digits, '-' and '_'")
    return name


Pseudonym = Annotated[str, AfterValidator(_pseudonym)]
"""A name that may become a folder: letters, digits, '-' and '_', 1 to 64 of them."""


Side = Literal["right", "left", "unknown"]
"""The side of a foot."""

Posture = Literal["sitting", "half_weight", "standing", "unknown"]
"""Posture of the person and load on the foot: seated, the foot on the glass without body weight; standing, the weight
equally on both feet, as ISO 7250-1 requires; standing, the weight on the scanned foot."""


def _relative(path: str) -> str:
    if not path or "\0" in path or path.startswith(("/", "\\", "~")) or ":" in path.split("/", maxsplit=1)[0]:
        raise ValueError("expected a path relative to this file")
    return path


RelativePath = Annotated[str, AfterValidator(_relative)]
"""A path relative to the document that names it. `inside` resolves it within an archive."""


class Document(BaseModel):
    """Base of all models: unknown fields are refused (a misspelt option must not be ignored), numbers are finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, protected_namespaces=())


AnyDocument = TypeVar("AnyDocument", bound=BaseModel)


def canonical_json(value: Any) -> str:
    """JSON that is the same for equal values: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


def pseudonym(name: str, field: str) -> str:
    """`name`, or a refusal if it cannot be the name of a folder."""
    try:
        return _pseudonym(name)
    except ValueError as error:
        raise RefusedInput(field, f"{error}, found {name[:80]!r}") from None

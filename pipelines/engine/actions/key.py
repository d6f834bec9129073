"""The key of an action: what a result depends on, written down in full, and its hash."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from json.encoder import encode_basestring
from typing import Any

from pydantic import BaseModel

from pipelines.engine.actions.code import code_identity
from pipelines.engine.actions.step import Step
from pipelines.engine.files.digest import sha256
from schemas.base.model import canonical_json

PreImage = dict[str, Any]


def image_text(step: Step, inputs: Mapping[str, str]) -> str:
    """Everything that decides a step's result, as canonical JSON.

    Parameters
    ----------
    step : Step
    inputs : mapping
        Digest of each named input.

    Returns
    -------
    An object: `step`; `code`, the digest of what `CodeIdentity` says; `parameters`, their model and their values;
    `inputs`, for each whether it is a `value`, a `file` or the `result` of another step, and its digest.
    """
    # Written down piece by piece, for this is most of what a warm plan does.
    named = ",".join(
        f'{encode_basestring(name)}:["{source.source}","{inputs[name]}"]'
        for name, source in sorted(step.inputs.items())
    )
    code = code_identity(step.module).digest
    parameters = "null" if step.parameters is None else parameters_text(step.parameters)
    kind = encode_basestring(step.kind)
    return f'{{"code":"{code}","inputs":{{{named}}},"parameters":{parameters},"step":{kind}}}'


def key_of(image: PreImage | str) -> str:
    """SHA-256 of the canonical JSON of a pre-image."""
    return sha256((image if isinstance(image, str) else canonical_json(image)).encode())


def parameters_text(parameters: BaseModel) -> str:
    """Name of the model, and the values of all its fields, as canonical JSON."""
    return _parameters_text(_Same(parameters))


@dataclass(frozen=True)
class _Same:
    """Parameters, by which object they are: equal numbers of two types are not the same."""

    parameters: BaseModel

    def __hash__(self) -> int:
        return id(self.parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.parameters is self.parameters


@lru_cache(maxsize=1024)
def _parameters_text(same: _Same) -> str:
    model = type(same.parameters).__name__
    return canonical_json({"model": model, "values": same.parameters.model_dump(mode="json")})

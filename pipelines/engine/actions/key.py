"""The key of an action: the hash of its pre-image, which lists everything that its result depends on."""

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
"""Decoded pre-image of a key; see `image_text`."""


def image_text(step: Step, inputs: Mapping[str, str]) -> str:
    """Pre-image of an action's key: everything that its result depends on, as canonical JSON.

    Parameters
    ----------
    step : Step
    inputs : mapping
        Digest of each named input.

    Returns
    -------
    image : str
        A JSON object: `step`, the kind of step; `code`, the digest of its `CodeIdentity`; `parameters`, their model and
        their values; `inputs`, for each its source (`value`, `file`, or `result` of another step) and its digest.
    """
    # Written piece by piece, since a plan without misses spends most of its time here.
    input_texts = ",".join(
        f'{encode_basestring(name)}:["{source.source}","{inputs[name]}"]'
        for name, source in sorted(step.inputs.items())
    )
    code = code_identity(step.module).digest
    parameters = "null" if step.parameters is None else parameters_text(step.parameters)
    kind = encode_basestring(step.kind)
    return f'{{"code":"{code}","inputs":{{{input_texts}}},"parameters":{parameters},"step":{kind}}}'


def key_of(image: PreImage | str) -> str:
    """SHA-256 of the canonical JSON of a pre-image."""
    return sha256((image if isinstance(image, str) else canonical_json(image)).encode())


def parameters_text(parameters: BaseModel) -> str:
    """Name of the model, and the values of all its fields, as canonical JSON."""
    return _parameters_text(_ByIdentity(parameters))


@dataclass(frozen=True)
class _ByIdentity:
    """Parameters that compare by object identity, since equal numbers of different types differ in JSON."""

    parameters: BaseModel

    def __hash__(self) -> int:
        return id(self.parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByIdentity) and other.parameters is self.parameters


@lru_cache(maxsize=1024)
def _parameters_text(wrapped: _ByIdentity) -> str:
    model = type(wrapped.parameters).__name__
    return canonical_json({"model": model, "values": wrapped.parameters.model_dump(mode="json")})

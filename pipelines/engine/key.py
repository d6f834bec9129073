"""The key of an action: what a result depends on, written down in full, and its hash."""

from collections.abc import Mapping
from typing import Any

from pipelines.engine.code import code_identity
from pipelines.engine.digest import sha256
from pipelines.engine.step import Step
from schemas.documents import canonical_json

PreImage = dict[str, Any]


def pre_image(step: Step, inputs: Mapping[str, str]) -> PreImage:
    """Everything that decides a step's result.

    Parameters
    ----------
    step : Step
    inputs : mapping
        Digest of each named input.
    """
    code = code_identity(step.module)
    return {
        "step": step.kind,
        "code": code.modules,
        "libraries": code.libraries,
        "parameters": None if step.parameters is None else step.parameters.model_dump(mode="json"),
        "inputs": dict(inputs),
    }


def key_of(image: PreImage) -> str:
    """SHA-256 of the canonical JSON of a pre-image."""
    return sha256(canonical_json(image).encode())


def difference(old: PreImage, new: PreImage) -> str:
    """What changed between two pre-images of one step, in words."""
    changes = [
        f"{noun} {name} changed"
        for part, noun in (("inputs", "input"), ("parameters", "parameter"), ("code", "code of"), ("libraries", ""))
        for name in _changed_names(old.get(part) or {}, new.get(part) or {})
    ]
    return ", ".join(change.strip() for change in changes) or "its result is gone"


def _changed_names(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    return sorted(name for name in old.keys() | new.keys() if old.get(name) != new.get(name))

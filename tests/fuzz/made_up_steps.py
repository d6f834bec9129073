"""Steps that do as little as steps can, and tell that they ran."""

import hashlib
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from schemas.base.errors import Finding


class Doing(BaseModel):
    """What a step does."""

    does: Literal["mix", "read", "write", "find"]
    size: int
    """Of its result, bytes."""
    pause_ms: int
    seed: int


def run(inputs: Mapping[str, bytes], parameters: Doing, places: Mapping[str, Path]) -> bytes:
    """Bytes that depend on all inputs and on the seed."""
    with places["log"].open("a") as log:  # a letter for each time that the step runs
        log.write("x")
    time.sleep(parameters.pause_ms / 1000)
    if parameters.does == "find":
        raise Finding(f"{places['film']}: no stripe")
    mixed = hashlib.shake_256(str(parameters.seed).encode())
    for name, content in sorted(inputs.items()):
        mixed.update(name.encode() + content)
    if parameters.does == "read":
        mixed.update(places["film"].read_bytes())
    result = mixed.digest(parameters.size)
    if parameters.does == "write":
        places["array"].write_bytes(result * 3)
    return result

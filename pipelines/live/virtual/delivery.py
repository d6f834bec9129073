"""What the virtual scanner is delivered with, as by its maker: its calibration, and the latencies of its cameras.

They were measured on it as on any scanner, and hold for the code that films. After a change of that code

    python -m pipelines.live.virtual.deliver

measures them anew. Until then a virtual scanner measures its own before its first scan.
"""

from importlib.resources import as_file, files

from footscan.virtual.stage.pictures import digest_of_rendering
from pipelines.engine.files.digest import sha256
from pipelines.live.virtual.world import EXPOSURE_MS, LATENCIES_S
from schemas.base.json_files import read_json
from schemas.base.model import Document
from schemas.calibration import Calibration
from schemas.rig import RigLatency

FILE = files(__package__) / "delivered.json"
SCANNER_SEED = 1
"""Seed of the scanner that is delivered."""


class Delivery(Document):
    """Calibration and latencies of the virtual scanner of seed `SCANNER_SEED`."""

    filmed_by: str
    """`digest_of_filming` of the code that filmed."""
    calibration: Calibration
    latencies: dict[int, RigLatency]
    """By camera."""


def delivery_of(scanner_seed: int) -> Delivery | None:
    """What the scanner of a seed is delivered with; None without anything that holds."""
    if scanner_seed != SCANNER_SEED or not FILE.is_file():
        return None
    with as_file(FILE) as file:
        delivered = read_json(file, Delivery)
    return delivered if delivered.filmed_by == digest_of_filming() else None


def digest_of_filming() -> str:
    """Digest of what maps and latencies depend on."""
    return sha256(f"{digest_of_rendering()} {LATENCIES_S} {EXPOSURE_MS}".encode())

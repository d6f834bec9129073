"""Measures what the virtual scanner is delivered with: `python -m pipelines.live.virtual.deliver`, some minutes."""

import tempfile
from importlib.resources import as_file
from pathlib import Path

from pipelines.engine.files.atomic import write_atomically
from pipelines.live.virtual.delivery import FILE, SCANNER_SEED, Delivery, digest_of_filming
from pipelines.live.virtual.rig import virtual_rig
from pipelines.live.virtual.world import World
from schemas.calibration import calibration_from_json


def main() -> None:
    """Prepare a scanner that is delivered without anything, and write down what was measured of it."""
    with tempfile.TemporaryDirectory() as folder:
        world = World(pictures=f"{folder}/pictures", scanner_seed=SCANNER_SEED)
        with virtual_rig(Path(folder), world, _tell, is_delivered=False) as prepared:
            rig = prepared.rig
        calibration = Path(str(rig.calibration))
        delivery = Delivery(
            filmed_by=digest_of_filming(),
            calibration=calibration_from_json(calibration.read_text("utf-8"), calibration),
            latencies={camera.id: camera.latency for camera in rig.cameras if camera.latency is not None},
        )
    with as_file(FILE) as file:
        write_atomically(file, (delivery.model_dump_json() + "\n").encode())


def _tell(what: str, done: int, total: int) -> None:
    print(f"{what}: {done} of {total}", flush=True)


if __name__ == "__main__":
    main()

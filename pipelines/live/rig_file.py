"""Reading and writing of rig.yaml."""

from pathlib import Path

import yaml

from pipelines.engine.files.atomic import write_atomically
from schemas.base.yaml_files import read_yaml
from schemas.rig import Rig


def read_rig(path: Path) -> Rig:
    """Read a rig, and make the path of its calibration absolute. RefusedInput if it breaks its format."""
    rig = read_yaml(path, Rig)
    if rig.calibration is None:
        return rig
    return rig.model_copy(update={"calibration": str(path.resolve().parent / rig.calibration)})


def write_rig(path: Path, rig: Rig) -> None:
    """Write a rig; a calibration in the same folder or below is written as a relative path."""
    document = rig.model_dump(mode="json", exclude_none=True)
    if rig.calibration is not None and Path(rig.calibration).is_relative_to(path.resolve().parent):
        document["calibration"] = Path(rig.calibration).relative_to(path.resolve().parent).as_posix()
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    write_atomically(path, text.encode())

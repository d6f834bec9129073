"""The settings of sessions, from the files of a scanner."""

from dataclasses import dataclass
from pathlib import Path

from footscan.calibration.travel.body import Body
from pipelines.live.light import ScanLight
from pipelines.travel_job import read_body
from schemas.base.yaml_files import read_yaml
from schemas.reference import ReferenceObject


@dataclass(frozen=True)
class GuideSettings:
    """Files and limits of all sessions."""

    captures: Path
    """Folder of the sessions."""
    rig_file: Path
    reference: ReferenceObject
    body: Body | None = None
    """Default: the standard one."""
    light: ScanLight | None = None
    """Default: chosen at the first placement."""
    placement_tolerance_mm: float = 1.0
    """Departure of the object from its placement that is not reported; as for a recorded capture."""
    drift_tolerance_mm: float = 0.2
    """RMS deviation up to which a camera is steady; as for a recorded capture."""


def settings_of(
    rig_file: Path, captures: Path, reference: Path | None, body: Path | None, light: ScanLight | None
) -> GuideSettings | None:
    """Read the reference object, by default reference.yaml beside the rig, and the mesh of a body.

    None if no reference object is named, and none lies beside the rig.

    Raises
    ------
    RefusedInput
        A file is missing or breaks its format.
    """
    beside = rig_file.parent / "reference.yaml"
    if reference is None and not beside.exists():
        return None
    known = read_yaml(reference or beside, ReferenceObject)
    return GuideSettings(captures, rig_file, known, None if body is None else read_body(body), light)

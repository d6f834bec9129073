"""The settings of sessions, from the files of a scanner."""

from pathlib import Path

from pipelines.live.calibrating.guide import GuideSettings
from pipelines.live.light import ScanLight
from pipelines.travel_job import read_body
from schemas.base.yaml_files import read_yaml
from schemas.reference import ReferenceObject


def settings_of(
    rig_file: Path, captures: Path, reference: Path | None, body: Path | None, light: ScanLight | None
) -> GuideSettings:
    """Read the reference object, by default reference.yaml beside the rig, and the mesh of a body.

    Raises
    ------
    RefusedInput
        A file is missing or breaks its format.
    """
    known = read_yaml(reference or rig_file.parent / "reference.yaml", ReferenceObject)
    return GuideSettings(captures, rig_file, known, None if body is None else read_body(body), light)

"""What a person decided for a scan: landmarks.yaml and choices.yaml beside its scan.yaml."""

from pathlib import Path
from typing import NamedTuple

from footscan.recordings.scans import RecordedScan
from schemas.base.yaml_files import read_yaml
from schemas.choices import Choices
from schemas.landmarks import ManualLandmarks, Places

LANDMARKS_FILE, CHOICES_FILE = "landmarks.yaml", "choices.yaml"
NONE_SET = ManualLandmarks(format="footscan.landmarks/1", landmarks=Places())
NOTHING_CHOSEN = Choices(format="footscan.choices/1")


class Decisions(NamedTuple):
    """Landmarks and choices of one scan; without a file those that change nothing."""

    landmarks: ManualLandmarks
    landmarks_file: Path
    choices: Choices
    choices_file: Path


def decisions_of(scan: RecordedScan) -> Decisions:
    """Read what was decided for a scan; RefusedInput if a file breaks its format."""
    landmarks, choices = scan.folder / LANDMARKS_FILE, scan.folder / CHOICES_FILE
    return Decisions(
        read_yaml(landmarks, ManualLandmarks) if landmarks.exists() else NONE_SET,
        landmarks,
        read_yaml(choices, Choices) if choices.exists() else NOTHING_CHOSEN,
        choices,
    )

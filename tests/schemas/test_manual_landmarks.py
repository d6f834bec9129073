from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.landmarks import LANDMARKS, ManualLandmarks

DOCUMENT = """\
format: footscan.landmarks/1
landmarks:                            # in the frame of the mesh, mm; those that are left out are found automatically
  navicular: [118.5, -34, 41.25]
  toe_2_tip: [251, 0.5, 11]
"""


def read(folder: Path, text: str) -> ManualLandmarks:
    path = folder / "landmarks.yaml"
    path.write_text(text)
    return read_yaml(path, ManualLandmarks)


def test_some_landmarks_are_set(tmp_path: Path) -> None:
    points = read(tmp_path, DOCUMENT).points()
    assert points == {"navicular": (118.5, -34.0, 41.25), "toe_2_tip": (251.0, 0.5, 11.0)}
    assert set(points) < set(LANDMARKS)


@pytest.mark.parametrize(
    ("text", "replacement", "problem"),
    [
        ("navicular:", "naviculare:", r"landmarks\.naviculare: unknown field, did you mean 'navicular'\?"),
        ("toe_2_tip:", "toe2_tip:", "unknown field, did you mean 'toe_2_tip'"),
        ("[251, 0.5, 11]", "[251, 0.5]", r"landmarks\.toe_2_tip"),
        ("[251, 0.5, 11]", "[251, 0.5, .nan]", r"landmarks\.toe_2_tip"),
        ("landmarks/1", "landmarks/2", "format"),
        ("landmarks: ", "unit: cm\nlandmarks: ", "unit"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, replacement: str, problem: str) -> None:
    assert text in DOCUMENT
    with pytest.raises(RefusedInput, match=problem):
        read(tmp_path, DOCUMENT.replace(text, replacement))

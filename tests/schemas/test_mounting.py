"""Where the cameras of a capture stand."""

from pathlib import Path

import pytest

from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.mounting import CaptureCamera, Mounting, mounting_of
from schemas.reference import Capture

CAPTURE = """\
format: footscan.capture/1
reference: reference.yaml
x_mm: 0.0
cameras:
  - {id: 1, file: cam1.avi}
  - {id: 2, file: cam2.avi, stands: STANDS}
"""


def camera_with(tmp_path: Path, stands: str) -> CaptureCamera:
    path = tmp_path / "capture.yaml"
    path.write_text(CAPTURE.replace("STANDS", stands))
    return read_yaml(path, Capture).cameras[1]


@pytest.mark.parametrize(
    ("camera", "mounting"),
    [
        (1, Mounting(1, 1, 1)),
        (2, Mounting(-1, 1, 1)),
        (3, Mounting(1, -1, 1)),
        (4, Mounting(-1, -1, 1)),
        (5, Mounting(1, 1, -1)),
        (6, Mounting(-1, 1, -1)),
        (7, Mounting(1, -1, -1)),
        (8, Mounting(-1, -1, -1)),
        (9, Mounting(0, 0, 0)),
        (64, Mounting(0, 0, 0)),
    ],
)
def test_the_number_says_where_a_camera_stands(camera: int, mounting: Mounting) -> None:
    assert mounting_of(CaptureCamera(id=camera, file="x.avi")) == mounting


@pytest.mark.parametrize(
    ("stands", "mounting"),
    [
        ("[front, left, above]", Mounting(1, 1, 1)),
        ("[below, right, behind]", Mounting(-1, -1, -1)),
        ("[right]", Mounting(0, -1, 0)),
        ("[above, front]", Mounting(1, 0, 1)),
        ("[]", Mounting(0, 0, 0)),
        ("null", Mounting(-1, 1, 1)),
    ],
)
def test_the_capture_says_it_instead(tmp_path: Path, stands: str, mounting: Mounting) -> None:
    assert mounting_of(camera_with(tmp_path, stands)) == mounting


@pytest.mark.parametrize(
    ("stands", "line"),
    [
        ("[front, behind]", "cameras.1.stands: expected at most one of front and behind"),
        ("[left, above, right]", "cameras.1.stands: expected at most one of left and right"),
        ("[above, below]", "cameras.1.stands: expected at most one of above and below"),
        ("[front, front]", "cameras.1.stands: expected at most one of front and behind"),
        (
            "[over]",
            "cameras.1.stands.0: input should be 'front', 'behind', 'left', 'right', 'above' or 'below', found 'over'",
        ),
        ("front", "cameras.1.stands: input should be a valid list, found 'front'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, stands: str, line: str) -> None:
    with pytest.raises(RefusedInput) as caught:
        camera_with(tmp_path, stands)
    assert str(caught.value).startswith(f"{tmp_path / 'capture.yaml'}: {line}")
    assert "(line 6, column 3" in str(caught.value)


def test_two_mountings_contradict_each_other_where_both_know_a_side() -> None:
    front_left = Mounting(1, 1, 0)
    assert str(front_left) == "front, left"
    assert str(Mounting(-1, -1, -1)) == "behind, right, below"
    assert front_left.contradicts(Mounting(1, -1, 1))
    assert not front_left.contradicts(Mounting(1, 0, -1))

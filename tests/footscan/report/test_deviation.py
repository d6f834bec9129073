import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from footscan.report.colours import distance_colours
from footscan.report.deviation import DOTS, PICTURES, Deviation, deviation_of, deviation_pictures, deviation_ply, drawn
from footscan.verify.distances import Distances
from footscan.verify.regions import FootRegions
from schemas.base.errors import RefusedInput

NOTHING = np.zeros((0, 3), np.int32)
CUBE = trimesh.creation.box(extents=(100, 60, 40))
VERTICES, FACES = np.asarray(CUBE.vertices, np.float64), np.asarray(CUBE.faces, np.int32)
UPPER_RED = np.where(VERTICES[:, 2] > 0, 0.5, -0.5).astype(np.float32)


def test_the_coloured_file_is_read_by_others() -> None:
    mesh = trimesh.load(io.BytesIO(deviation_ply((VERTICES, FACES), UPPER_RED)), file_type="ply", process=False)
    np.testing.assert_allclose(mesh.vertices, VERTICES)
    np.testing.assert_array_equal(mesh.faces, FACES)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], distance_colours(UPPER_RED, 0.5))
    np.testing.assert_array_equal(mesh.metadata["_ply_raw"]["vertex"]["data"]["distance"], UPPER_RED)


def test_a_coloured_cloud_is_read_by_others() -> None:
    cloud = trimesh.load(io.BytesIO(deviation_ply((VERTICES, NOTHING), UPPER_RED)), file_type="ply", process=False)
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_allclose(cloud.vertices, VERTICES)
    np.testing.assert_array_equal(cloud.colors[:, :3], distance_colours(UPPER_RED, 0.5))


def test_a_foot_is_shown_in_its_own_frame_and_never_mirrored() -> None:
    distances = Distances(np.abs(UPPER_RED), UPPER_RED)
    left = FootRegions(np.array([[1.0, 0, 0, -10], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), 100.0)
    shown = deviation_of((VERTICES, FACES), distances, left)
    np.testing.assert_allclose(shown.vertices, VERTICES - [10, 0, 0])
    assert (shown.side, shown.signed) == ("left", True)
    assert shown.distance is UPPER_RED
    plain = deviation_of((VERTICES, FACES), Distances(distances.unsigned, None), None)
    assert plain.vertices is VERTICES
    assert (plain.side, plain.signed) == (None, False)


@pytest.mark.parametrize("faces", [FACES, NOTHING], ids=["mesh", "cloud"])
def test_four_pictures_with_their_colours(faces: np.ndarray) -> None:
    vertices, distance = VERTICES, UPPER_RED
    if not len(faces):
        vertices = trimesh.sample.sample_surface(CUBE, 20_000, seed=0)[0]
        distance = np.where(vertices[:, 2] > 0, 0.5, -0.5).astype(np.float32)
    found = deviation_pictures(Deviation(vertices, faces, distance, True, None))
    assert list(found) == [f"{name}.png" for name in PICTURES]
    above, below, left, _ = (np.asarray(Image.open(io.BytesIO(png))).astype(int) for png in found.values())
    # 100 x 60 mm and a margin of 8 mm; a bar of 240 pixels; dots of a cloud reach beyond it.
    assert above.shape == below.shape
    assert above.shape[1:] == (480, 3)
    height = above.shape[0] - 30 - 52 - 3 * (60 + 16)
    assert height == 0 if len(faces) else 0 < height < 3 * 3
    assert redder(above, 30 + 3 * (8 + 30))
    assert not redder(below, 30 + 3 * (8 + 30))
    assert redder(left, 30 + 3 * (8 + 6))
    assert not redder(left, 30 + 3 * (8 + 34))
    bar = above[above.shape[0] - 40]
    assert bar[120].tolist() == [24, 62, 140]
    assert bar[359].tolist() == [150, 22, 38]
    assert bar[100].tolist() == bar[380].tolist() == [255, 255, 255]


def redder(picture: np.ndarray, row: int) -> bool:
    """True if a patch of the picture, 20 pixels wide, has more red than blue."""
    column = picture.shape[1] // 2
    red, _, blue = picture[row - 10 : row + 10, column - 10 : column + 10].mean(axis=(0, 1))
    assert abs(red - blue) > 15
    return bool(red > blue)


def test_distances_without_a_sign_have_a_bar_from_zero() -> None:
    found = deviation_pictures(Deviation(VERTICES, FACES, np.abs(UPPER_RED), False, "right"))
    picture = np.asarray(Image.open(io.BytesIO(found["above.png"])))
    assert picture[picture.shape[0] - 40, 120].tolist() == [244, 244, 240]


def test_few_points_of_a_large_cloud_are_drawn_and_all_of_a_small_one() -> None:
    random = np.random.default_rng(0)
    large = random.uniform(0, 200, (5 * DOTS, 3))
    vertices, faces, colours = drawn(Deviation(large, NOTHING, np.zeros(len(large)), True, None))
    assert 0.9 * DOTS < len(faces) / 8 <= DOTS
    assert len(vertices) == len(colours) == len(faces) / 8 * 6
    _, faces, _ = drawn(Deviation(large[:100], NOTHING, np.zeros(100), True, None))
    assert len(faces) == 800


@pytest.mark.parametrize("size", [0.0, 0.5, 1e5])
def test_what_no_picture_can_show_is_refused(size: float) -> None:
    with pytest.raises(RefusedInput, match=r"mm across, expected 1 to 2000 mm"):
        deviation_pictures(Deviation(VERTICES / 100 * size, FACES, UPPER_RED, True, None))

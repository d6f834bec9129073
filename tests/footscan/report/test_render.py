import numpy as np
import pytest

from footscan.mesh.topology import vertex_normals
from footscan.report.render import rasterise, render_mesh

RED, GREEN, BLUE = [240.0, 0.0, 0.0], [0.0, 240.0, 0.0], [0.0, 0.0, 240.0]
CORNER = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 0.0, 0.0]])
"""(column, row, depth): the upper left half of 3 x 3 samples; its corners run counter-clockwise as rows run down."""


def drawn(projected, faces, outer, inner=None, shape=(3, 3)):
    outer = np.array(outer)
    inner = np.zeros_like(outer) if inner is None else np.array(inner)
    return rasterise(np.array(projected), np.array(faces, np.int64), outer, inner, shape)


def test_a_triangle_covers_the_samples_in_it_and_mixes_its_colours():
    samples = drawn(CORNER, [[0, 1, 2]], [RED, GREEN, BLUE])
    assert (samples[..., 3] > 0).tolist() == [[True, True, True], [True, True, False], [True, False, False]]
    assert samples[0, 0].tolist() == [*RED, 255]
    assert samples[2, 0].tolist() == [*GREEN, 255]
    assert samples[0, 2].tolist() == [*BLUE, 255]
    assert samples[0, 1].tolist() == [120, 0, 120, 255]
    assert samples[1, 0].tolist() == [120, 120, 0, 255]
    assert samples[1, 1].tolist() == [0, 120, 120, 255]


def test_the_other_side_has_the_inner_colours():
    samples = drawn(CORNER, [[0, 2, 1]], [RED] * 3, [BLUE] * 3)
    assert samples[0, 0].tolist() == [*BLUE, 255]


@pytest.mark.parametrize("faces", [[[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]])
def test_of_two_triangles_the_nearer_is_seen_at_each_sample(faces):
    # The second rises from -1 at column 0 to +1 at column 2, and passes the first, at 0.5, in column 1.5.
    rising = CORNER.copy()
    rising[:, 2] = [-1, -1, 1]
    flat = CORNER.copy()
    flat[:, 2] = 0.5
    samples = drawn(np.concatenate([flat, rising]), faces, [RED] * 3 + [BLUE] * 3)
    assert samples[0, :, 0].tolist() == [240, 240, 0]
    assert samples[0, :, 2].tolist() == [0, 0, 240]


def test_what_lies_outside_the_picture_is_left_out():
    samples = drawn([[-9.0, -9.0, 0.0], [-9.0, 30.0, 0.0], [30.0, -9.0, 0.0]], [[0, 1, 2]], [RED] * 3, shape=(2, 3))
    assert (samples == [*RED, 255]).all()


def test_a_triangle_without_area_draws_nothing():
    assert not drawn([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]], [[0, 1, 2]], [RED] * 3).any()


def test_normals_are_weighted_by_area():
    # Corner 0 belongs to a triangle of area 0.5 facing +Z and to one of area 1 facing +X.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 2, 0], [0, 0, 1], [9, 9, 9]], float)
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 3, 4]]))
    np.testing.assert_allclose(normals[0], np.array([2, 0, 1]) / np.sqrt(5))
    np.testing.assert_allclose(normals[1], [0, 0, 1])
    np.testing.assert_allclose(normals[4], [1, 0, 0])
    np.testing.assert_array_equal(normals[5], [0, 0, 0])


def test_a_square_that_faces_the_viewer():
    # X from 1.5 to 3, Y from -1 down to -3 mm, at a pixel a mm: half of column 1, columns 2; rows 1 and 2.
    vertices = np.array([[1.5, -1, 0], [1.5, -3, 0], [3, -3, 0], [3, -1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    picture = render_mesh(vertices, faces, np.full((4, 3), [200, 100, 0], np.uint8), (4, 4), 1.0)
    assert picture.shape == (4, 4, 4)
    assert picture.dtype == np.uint8
    alpha = [[0, 0, 0, 0], [0, 128, 255, 0], [0, 128, 255, 0], [0, 0, 0, 0]]
    assert picture[..., 3].tolist() == alpha
    # The lamp is seen at a cosine of 0.79 / sqrt(0.35^2 + 0.5^2 + 0.79^2) = 0.7913:
    # 0.30 + 0.24 + 0.46 * 0.7913 = 0.9040 of 200 and of 100.
    assert picture[1, 1, :3].tolist() == [181, 90, 0]
    assert picture[2, 2, :3].tolist() == [181, 90, 0]


def test_a_square_seen_from_its_inner_side_is_darker():
    vertices = np.array([[0, 0, 0], [0, -2, 0], [2, -2, 0], [2, 0, 0]], float)
    picture = render_mesh(vertices, np.array([[0, 2, 1], [0, 3, 2]]), np.full((4, 3), 200, np.uint8), (2, 2), 1.0)
    # 0.45 of 0.9040 of 200
    assert (picture == [81, 81, 81, 255]).all()

import numpy as np
import pytest

from footscan.mesh.mesh import Mesh, on_floor, outward, signed_volume, used, with_normals

VERTICES = np.array([[0.0, 0, 5], [10, 0, 5], [0, 20, 5], [0, 0, 35]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)


def test_a_mesh_that_looks_inwards_is_turned_over() -> None:
    mesh = Mesh(VERTICES, FACES)
    assert signed_volume(mesh) == pytest.approx(10 * 20 * 30 / 6)
    assert outward(mesh) is mesh
    inward = Mesh(VERTICES, FACES[:, ::-1], normals=np.tile([0.0, 0.0, 1.0], (4, 1)))
    np.testing.assert_array_equal(outward(inward).faces, FACES)
    np.testing.assert_array_equal(outward(inward).normals, -inward.normals)


def test_the_lowest_point_comes_to_the_floor() -> None:
    assert on_floor(Mesh(VERTICES, FACES)).vertices.tolist() == (VERTICES - [0, 0, 5]).tolist()


def test_normals_weigh_faces_by_their_angle() -> None:
    """At the right-angled corner of a cube a square of two triangles counts as one of one."""
    vertices = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([face for a, b, c, d in squares for face in ([a, b, c], [a, c, d])], np.int32)
    found = with_normals(Mesh(vertices, faces))
    np.testing.assert_allclose(found.normals, (2 * vertices - 1) / np.sqrt(3), atol=1e-12)
    assert with_normals(found) is found


def test_vertices_without_a_triangle_go() -> None:
    mesh = Mesh(np.vstack([[[9.0, 9, 9]], VERTICES]), FACES + 1, camera=np.array([7, 1, 2, 3, 4], np.uint8))
    assert used(mesh).vertices.tolist() == VERTICES.tolist()
    assert used(mesh).faces.tolist() == FACES.tolist()
    assert used(mesh).camera.tolist() == [1, 2, 3, 4]


def test_what_is_of_other_vertices_is_refused() -> None:
    with pytest.raises(ValueError, match="camera of 3 vertices, expected 4"):
        Mesh(VERTICES, FACES, camera=np.zeros(3, np.uint8))
    with pytest.raises(ValueError, match="expected a key of one word"):
        Mesh(VERTICES, FACES, metadata={"two words": "x"})

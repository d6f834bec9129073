import numpy as np

from footscan.report.filled import CUT, FILLED, MEASURED, filled_colours, filled_key
from schemas.quality import MeshQuality

VERTICES = np.array([[0, 0, 0], [0, 0, 60], [0, 0, 60], [1, 0, 30]], float)


def test_measured_filled_and_cut_are_told_apart():
    # The rim of the cut was measured, what lies within it was not.
    filled = np.array([False, False, True, True])
    assert [tuple(c) for c in filled_colours(VERTICES, filled, 60.0).tolist()] == [MEASURED, MEASURED, CUT, FILLED]
    assert [tuple(c) for c in filled_colours(VERTICES, filled, None).tolist()] == [MEASURED, MEASURED, FILLED, FILLED]
    assert (filled_colours(VERTICES, None, 60.0) == MEASURED).all()


def test_without_a_cut_there_is_no_share_of_it():
    mesh = MeshQuality(
        vertices=4, triangles=4, open_edges=0, non_manifold_edges=0, components=1, holes=0, filled_share=0.04
    )
    key = filled_key(mesh)
    assert "Measured, 96.0 %" in key
    assert "Filled, 4.0 %" in key
    assert "cut" not in key

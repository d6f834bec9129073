"""Sections and spans of measures on a box whose sections are known."""

from typing import Any

import numpy as np
import pytest
import trimesh

from footscan.report.scan.measure_drawings import measure_drawings
from schemas.measures import MeasuredLandmark, Measures

BOX = trimesh.creation.box(bounds=[[0, -50, 0], [250, 50, 80]])
VERTICES, FACES = np.asarray(BOX.vertices, np.float64), np.asarray(BOX.faces)
PLACED = [[1.0, 0, 0, -10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
MIRRORED = [[1.0, 0, 0, -10], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def measures(transform: list[list[float]], **more: Any) -> Measures:
    girth = {"value": 360.0, "unit": "mm", "status": "ok", "definition": "d", "surface_length": 360.0}
    plain = {"unit": "mm", "status": "ok", "definition": "d"}
    return Measures.model_validate(
        {
            "side": "right", "axis": "toe2", "transform": transform,
            "measures": {
                "instep_girth": girth | {"plane": [[100.0, 0, 0], [1.0, 0, 0]]},
                "instep_height": plain | {"value": 80.0},
                "foot_length": plain | {"value": 250.0},
                "foot_breadth": plain | {"value": 100.0},
                "arch_index": plain | {"unit": "1", "value": 0.2},
                "heel_girth": plain | {"value": None, "status": "incomplete"},
            },
            "landmarks": {
                "pternion": MeasuredLandmark(point=(0, 0, 20), method="geometric", confidence=1),
                "metatarsale_fibulare": MeasuredLandmark(point=(160, -50, 9), method="geometric", confidence=1),
            },
        } | more
    )  # fmt: skip


def test_a_girth_is_the_loop_of_its_plane_in_the_foots_frame() -> None:
    [loop] = measure_drawings(VERTICES, FACES, measures(PLACED))["instep_girth"].lines
    assert np.array_equal(loop[0], loop[-1])
    np.testing.assert_allclose(loop[:, 0], 90)
    assert np.linalg.norm(np.diff(loop, axis=0), axis=1).sum() == pytest.approx(2 * (100 + 80))


def test_a_height_stands_in_the_section_of_its_girth() -> None:
    drawings = measure_drawings(VERTICES, FACES, measures(PLACED))
    np.testing.assert_array_equal(drawings["instep_height"].lines[0], drawings["instep_girth"].lines[0])


@pytest.mark.parametrize(("transform", "medial"), [(PLACED, 100), (MIRRORED, -100)])
def test_spans_run_from_their_landmark_as_far_as_their_value(transform: list[list[float]], medial: float) -> None:
    """A left foot is mirrored by its transform, but shown as it is: its medial side lies towards -Y."""
    drawings = measure_drawings(VERTICES, FACES, measures(transform))
    [length], [breadth] = drawings["foot_length"].lines, drawings["foot_breadth"].lines
    np.testing.assert_allclose(length, [[-10, 0, 20], [240, 0, 20]])
    np.testing.assert_allclose(breadth[1] - breadth[0], [0, medial, 0])
    np.testing.assert_allclose(drawings["foot_breadth"].points, [[150, -50, 9]])


def test_what_has_no_place_or_no_value_is_not_drawn() -> None:
    drawings = measure_drawings(VERTICES, FACES, measures(PLACED))
    assert drawings.keys() == {"instep_girth", "instep_height", "foot_length", "foot_breadth"}
    assert measure_drawings(VERTICES, FACES, measures(PLACED, measures={}, landmarks={})) == {}

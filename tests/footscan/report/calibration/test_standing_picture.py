"""Drawings show an object where the calibration takes it to be, and where the virtual scanner puts it."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.calibration.travel.body import TURN_DEG, standard_body
from footscan.report.calibration.standing_picture import EDGE, body_picture, placement_picture
from footscan.virtual.stage.reference import standard_reference
from footscan.virtual.stage.standing import stand_on_glass

SVG = "{http://www.w3.org/2000/svg}"
X_MM, TRAVEL = 180.0, (0.0, 400.0)


def outlines(svg: str) -> list[NDArray[np.float64]]:
    """The outlines of the object in the views: seen from the front, from the side and from above."""
    drawn = ElementTree.fromstring(svg).iter(f"{SVG}polygon")
    return [
        np.array([corner.split(",") for corner in one.attrib["points"].split()], np.float64) * [1.0, -1.0]
        for one in drawn
        if one.attrib["stroke"] == EDGE
    ]


@pytest.mark.parametrize("number", range(3))
def test_a_placement_is_drawn_where_the_calibration_takes_it_to_be(number: int) -> None:
    reference = standard_reference()
    profile, placements = np.array(reference.profile_mm), np.array(reference.placements_mm)
    front, side, above = outlines(placement_picture(profile, placements, number, [0, 1], X_MM, TRAVEL))
    assert front == pytest.approx(profile + placements[number])
    assert side[:, 1].min() == pytest.approx(placements[number, 1])
    assert above[:, 1].mean() == pytest.approx(placements[number, 0])
    assert side[:, 0].mean() == pytest.approx(X_MM)
    assert above[:, 0].mean() == pytest.approx(X_MM)


def test_the_body_is_drawn_as_it_stands_on_the_virtual_glass() -> None:
    body = standard_body()
    stands = stand_on_glass(body.vertices, X_MM, TURN_DEG)
    views = outlines(body_picture(body, X_MM, (90.0, 270.0)))
    for outline, axes in zip(views, ([1, 2], [0, 2], [0, 1]), strict=True):
        away = np.linalg.norm(outline[:, None] - stands[None, :, axes], axis=2).min(axis=1)
        assert away.max() < 0.01
        assert np.ptp(outline, axis=0) == pytest.approx(np.ptp(stands[:, axes], axis=0), abs=0.02)


def test_dimensions_and_places_are_named() -> None:
    words = re.findall(r">([^<]+)</text>", body_picture(standard_body(), X_MM, (90.0, 270.0)))
    assert {"150", "64", "84", "20°", "X = 180", "travel of the heads, X = 90 to 270", "X, travel", "Z"} <= set(words)

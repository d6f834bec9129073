"""Reference objects: what can be one, and what is told of one that cannot."""

from math import cos, pi, sin
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.base.errors import RefusedInput
from schemas.base.json_files import validate
from schemas.base.yaml_files import read_yaml
from schemas.reference import ReferenceObject

Corners = list[list[float]]
BOX: Corners = [[-20, 0], [20, 0], [20, 30], [-20, 30]]


def reference(profile: object, placements: object = ((0, 0),)) -> ReferenceObject:
    document = {"format": "footscan.reference/1", "profile_mm": profile, "placements_mm": placements}
    return validate("reference.yaml", ReferenceObject, document)


def refusal(profile: object, placements: object = ((0, 0),)) -> str:
    with pytest.raises(RefusedInput) as caught:
        reference(profile, placements)
    return str(caught.value)


@pytest.mark.parametrize(
    "profile",
    [
        BOX,
        BOX[::-1],
        [[0, 0], [10, 0], [0, 10]],
        [[0, 0], [5, 0], [10, 0], [10, 10]],  # a corner at which nothing turns
        [[0, 0], [30, 0], [30, 30], [15, 1], [0, 30]],  # a notch that nearly reaches the bottom
        [[1000 * cos(2 * pi * k / 999) / 2, 500 * sin(2 * pi * k / 999)] for k in range(999)],
    ],
)
def test_simple_polygons_are_accepted(profile: Corners) -> None:
    assert reference(profile).profile_mm == profile


@pytest.mark.parametrize(
    ("profile", "problem"),
    [
        ([[0, 0], [4, 0], [4, 3]], "its largest extent is 4 mm, expected 10 to 1000; is it in millimetres?"),
        ([[0, 0], [4000, 0], [4000, 3]], "its largest extent is 4000 mm, expected 10 to 1000; is it in millimetres?"),
        ([[-1e308, 0], [1e308, 0], [0, 3]], "its largest extent is inf mm, expected 10 to 1000; is it in millimetres?"),
        ([[1e15, 0], [1e15 + 40, 0], [1e15, 30]], "corner [1e+15, 0] is out of reach, expected -1000 to 1000"),
        (
            [[0, 0], [40, 0], [40, 0], [0, 30]],
            "corner 1 and corner 2 are one, expected each corner once: the profile closes by itself",
        ),
        (
            [*BOX, BOX[0]],
            "corner 4 repeats the first one, expected each corner once: the profile closes by itself",
        ),
        ([[0, 0], [10, 10], [30, 30]], "all corners lie on one line, expected a polygon"),
        ([[0, 0], [0.1, 0.3], [10, 30], [20, 60], [0.2, 0.6]], "all corners lie on one line, expected a polygon"),
        (
            [[0, 0], [40, 30], [40, 0], [0, 30]],
            "the edges [0, 0] to [40, 30] and [40, 0] to [0, 30] cross or touch, "
            "expected a polygon that does not meet itself",
        ),
        (  # a tip that touches the bottom
            [[0, 0], [30, 0], [30, 30], [15, 0], [0, 30]],
            "the edges [0, 0] to [30, 0] and [15, 0] to [0, 30] cross or touch, "
            "expected a polygon that does not meet itself",
        ),
        (  # a spike that runs back on itself, at the corner where the profile closes
            [[0, 0], [30, 0], [30, 30], [0, 30], [0, -20]],
            "the edges [0, 0] to [30, 0] and [0, 30] to [0, -20] cross or touch, "
            "expected a polygon that does not meet itself",
        ),
        ([[0, 0], [20, 0], [20, 0.01]], "encloses 0.1 mm2, expected at least 1; is it in millimetres?"),
    ],
)
def test_other_profiles_are_refused(profile: Corners, problem: str) -> None:
    assert refusal(profile) == f"reference.yaml: profile_mm: {problem}"


@pytest.mark.parametrize(
    ("placements", "problem"),
    [
        ([[0, 0], [10, 0], [0, -0.0]], "placements_mm: placement 2 repeats placement 0, expected each placement once"),
        ([[0, 0], [1000.5, 0]], "placements_mm.1.0: input should be less than or equal to 1000, found '1000.5'"),
        ([[0, -1e308]], "placements_mm.0.1: input should be greater than or equal to -1000, found '-1e+308'"),
        ([[0, float("nan")]], "placements_mm.0.1: input should be a finite number, found 'nan'"),
    ],
)
def test_other_placements_are_refused(placements: Corners, problem: str) -> None:
    assert refusal(BOX, placements) == f"reference.yaml: {problem}"


@pytest.mark.parametrize("turn", range(5))
@pytest.mark.parametrize("tip", [[0, -20], [0, -0.5], [0, 40]])
def test_a_fold_is_refused_wherever_the_profile_begins(turn: int, tip: list[float]) -> None:
    profile = [[0, 0], [30, 0], [30, 30], [0, 30], tip]
    assert "cross or touch" in refusal(profile[turn:] + profile[:turn])


def test_an_edge_there_and_back_is_refused() -> None:
    assert "cross or touch" in refusal([[0, 0], [30, 0], [0, 0], [0, 30]])


def test_placements_as_far_as_they_go() -> None:
    assert reference(BOX, [[1000, -1000], [1000, -999]]).placements_mm == [[1000, -1000], [1000, -999]]


def test_a_refusal_names_the_file(tmp_path: Path) -> None:
    path = tmp_path / "cross.yaml"
    path.write_text("format: footscan.reference/1\nprofile_mm: [[0, 0], [4, 0], [4, 3]]\nplacements_mm: [[0, 0]]\n")
    with pytest.raises(RefusedInput, match=r"cross\.yaml: profile_mm: its largest extent is 4 mm, "):
        read_yaml(path, ReferenceObject)


star = st.lists(st.floats(20.0, 400.0), min_size=3, max_size=12)


@given(radii=star, turn=st.integers(0, 11), flip=st.booleans())
def test_whether_a_polygon_is_simple_depends_on_its_shape_alone(radii: list[float], turn: int, flip: bool) -> None:
    """A star-shaped polygon is simple by construction, from whichever corner and in whichever direction it is told."""
    profile = star_of(radii)
    turned = profile[turn % len(profile) :] + profile[: turn % len(profile)]
    reference(turned[::-1] if flip else turned)


@given(radii=st.lists(st.floats(50.0, 400.0), min_size=4, max_size=12), data=st.data())
def test_two_neighbours_that_change_places_make_it_cross(radii: list[float], data: st.DataObject) -> None:
    """Corners at growing angles around a point within: told in another order, two of the edges cross."""
    profile = star_of([200.0 + radius / 100 for radius in radii])  # nearly a circle, so that all corners are convex
    k = data.draw(st.integers(0, len(profile) - 2))
    profile[k], profile[k + 1] = profile[k + 1], profile[k]
    assert "cross or touch" in refusal(profile)


def star_of(radii: list[float]) -> Corners:
    angles = [2 * pi * k / len(radii) for k in range(len(radii))]
    return [[radius * cos(angle), radius * sin(angle)] for radius, angle in zip(radii, angles, strict=True)]

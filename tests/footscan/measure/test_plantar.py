import numpy as np
import pytest

from footscan.measure.foot_landmarks import Landmark
from footscan.measure.foot_surface import FootSurface
from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.plantar import arch_index, chippaux_smirak, clarke_angle, footprint, staheli
from footscan.measure.quantity import NotMeasurable

Block = tuple[int, int, int, int]
"""X from, X to, Y from (lateral), Y to (medial), mm, in steps of STEP."""
STEP = 2
HEEL, MIDFOOT, BALL = (0, 60, -24, 24), (60, 120, -24, -4), (120, 180, -36, 36)  # thirds of 60 mm
TOES = [(204, 220, y, y + 16) for y in (-40, -20, 0, 20)]


def standing(blocks: list[Block], opened: float = 0.0) -> FootSurface:
    """Blocks from 10 mm below the height of contact and 30 mm high, welded into one surface, and a ball's landmarks.
    Walls at X < `opened` are left out."""
    cells = {(x, y) for x0, x1, y0, y1 in blocks for x in range(x0, x1, STEP) for y in range(y0, y1, STEP)}
    quads = []
    for x, y in cells:
        corners = [(x, y), (x + STEP, y), (x + STEP, y + STEP), (x, y + STEP)]
        quads += [[(*corner, 20) for corner in corners], [(*corner, -10) for corner in reversed(corners)]]
        beside = [(x, y - STEP), (x + STEP, y), (x, y + STEP), (x - STEP, y)]
        for k, other in enumerate(beside):
            if other not in cells and not x < opened:
                start, end = corners[k], corners[(k + 1) % 4]
                for z in range(-10, 20, STEP):
                    quads.append([(*start, z), (*end, z), (*end, z + STEP), (*start, z + STEP)])
    vertices, numbers = np.unique(np.array(quads, np.float64).reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c, d = numbers.reshape(-1, 4).T
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    foot = FootFrame(vertices, faces, vertices, np.eye(4), "toe2", 250.0)
    return FootSurface(foot, marks())


def marks() -> dict[str, Landmark]:
    """A ball that runs straight across."""
    points = {"metatarsale_tibiale": (160.0, 36.0, 15.0), "metatarsale_fibulare": (160.0, -36.0, 15.0)}
    return {name: Landmark(np.array(point), "geometric", 1.0) for name, point in points.items()}


def test_indices_of_a_print_of_rectangles() -> None:
    foot = standing([HEEL, MIDFOOT, BALL])
    contact = footprint(foot)
    assert (contact.rear, contact.front) == pytest.approx((0, 180))
    assert contact.doubt is None
    # Areas: heel 48, midfoot 20, ball 72 times 60 each.
    assert arch_index(foot).value == pytest.approx(20 / 140, abs=1e-3)
    assert chippaux_smirak(foot).value == pytest.approx(20 / 72, abs=1e-3)
    assert staheli(foot).value == pytest.approx(20 / 48, abs=1e-3)


def test_toes_do_not_count() -> None:
    foot = standing([HEEL, MIDFOOT, BALL, *TOES])
    assert footprint(foot).front == pytest.approx(180)
    assert arch_index(foot).value == pytest.approx(20 / 140, abs=1e-3)


def test_toes_that_run_into_the_print_are_cut_and_told() -> None:
    foot = standing([HEEL, MIDFOOT, BALL, (180, 220, -30, 30)])
    contact = footprint(foot)
    assert contact.doubt == "toes run into the print"
    assert contact.front == pytest.approx(160 + 0.13 * 250, abs=6.0)
    assert arch_index(foot).doubt == contact.doubt


def test_a_third_ends_within_a_section_of_the_print() -> None:
    print_mm = standing([HEEL, (60, 122, -24, -4), (122, 182, -36, 36)])
    # A third of 182 mm lies within the middle part, which is 20 mm wide.
    assert arch_index(print_mm).value == pytest.approx(182 / 3 * 20 / (60 * 48 + 62 * 20 + 60 * 72), abs=1e-4)


def test_a_print_in_two_parts() -> None:
    foot = standing([HEEL, BALL])
    assert arch_index(foot).value == pytest.approx(0.0, abs=1e-9)
    assert chippaux_smirak(foot).value == 0.0
    with pytest.raises(NotMeasurable, match="two parts"):
        clarke_angle(foot)


def test_the_clarke_angle_of_a_hollow() -> None:
    # The tangent runs along Y = 36 past the first metatarsal at X = 160; the arch is a parabola, deepest at (90, 6).
    arch = [(x, 6 + (x - 90) ** 2 / 30) for x in np.arange(120.0, 59.5, -1.0)]
    assert clarke_angle(tube([(0, -24), (180, -24), (180, 36), *arch, (0, 36)])).value == pytest.approx(
        np.rad2deg(np.arctan2(30, 160 - 90)), abs=0.3
    )


def tube(corners: list[tuple[float, float]]) -> FootSurface:
    """Upright walls over a polygon, (X, Y) counter-clockwise, in triangles of 1 mm."""
    outline = []
    for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
        parts = max(int(np.hypot(x1 - x0, y1 - y0)), 1)
        outline += [(x0 + (x1 - x0) * k / parts, y0 + (y1 - y0) * k / parts) for k in range(parts)]
    heights = np.arange(-8.5, 12.0)
    vertices = np.array([(*point, z) for z in heights for point in outline])
    number = np.arange(len(vertices)).reshape(len(heights), -1)
    beside = np.roll(number, -1, axis=1)
    a, b, c, d = number[:-1].ravel(), beside[:-1].ravel(), number[1:].ravel(), beside[1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])]).astype(np.int32)
    return FootSurface(FootFrame(vertices, faces, vertices, np.eye(4), "toe2", 250.0), marks())


def test_an_open_sole_gives_no_print() -> None:
    with pytest.raises(NotMeasurable, match="gap at the sole"):
        footprint(standing([HEEL, MIDFOOT, BALL], opened=20.0))


@pytest.mark.parametrize("behind_mm", [0, 2])
def test_a_foot_on_its_toes(behind_mm: int) -> None:
    """Of a print that begins where it is cut from the toes, nothing is left, or a line."""
    with pytest.raises(NotMeasurable, match="with its toes only"):
        footprint(standing([(192 - behind_mm, 222, -30, 30)]))


def test_a_foot_in_the_air() -> None:
    foot = standing([HEEL, MIDFOOT, BALL])
    raised = foot.mesh.vertices + np.array([0.0, 0.0, 30.0])
    frame = FootFrame(raised, foot.mesh.faces.astype(np.int32), raised, np.eye(4), "toe2", 250.0)
    with pytest.raises(NotMeasurable, match="does not reach the floor"):
        footprint(FootSurface(frame, foot.landmarks))

"""Drawings of an object that stands on the glass to be filmed: from the front, from the side and from above, in mm.

X is the travel of the heads, Y goes across, Z up from the glass. All views have one scale.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from footscan.calibration.travel.body import TURN_DEG, Body

Floats = NDArray[np.float64]

MARGIN, GAP, CAPTION, BELOW = 26.0, 14.0, 13.0, 44.0
"""Space about an object, between views, above a view for its title, and below the glass, mm of the drawing."""
PRISM_MM = 90.0
"""Length along X at which a prism of unknown length is drawn."""
INK, SOFT, GLASS, LASER, FILL, EDGE = "#1c2530", "#9fb4c2", "#cfe3ec", "#b3202c", "#f6d9c8", "#b0470a"
MINUS = "\N{MINUS SIGN}"


class _View(NamedTuple):
    """A window (low, high) along two axes; the second one goes up."""

    title: str
    across: str
    up: str
    low: Floats
    high: Floats

    @property
    def width(self) -> float:
        return float(self.high[0] - self.low[0])

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])


def placement_picture(
    profile: Floats, placements: Floats, number: int, taken: Sequence[int], x_mm: float, reach_mm: tuple[float, float]
) -> str:
    """Draw a prism in placement `number`, and where it stood in those that are `taken`, as SVG.

    Parameters
    ----------
    profile : (C, 2) Y and Z of its corners, mm
    placements : (P, 2) shift in Y and Z of each placement, mm
    x_mm : X of the laser plane, in which its cross-section is seen
    reach_mm : ends of the travel, X

    Examples
    --------
    >>> cross = np.array([[-20.0, 0.0], [20.0, 0.0], [20.0, 30.0], [-20.0, 30.0]])
    >>> drawing = placement_picture(cross, np.array([[0.0, 0.0], [40.0, 14.0]]), 1, [0], 200.0, (0.0, 400.0))
    >>> "Y = +40 mm, raised by 14 mm" in drawing
    True
    """
    corners = profile[None] + placements[:, None]
    y = corners[..., 0]
    broad = float(np.abs(y).max()) + MARGIN
    top = float(corners[..., 1].max()) + MARGIN
    now, (dy, dz) = corners[number], placements[number]
    low, high = now.min(axis=0), now.max(axis=0)
    back, fore = x_mm - PRISM_MM / 2.0, x_mm + PRISM_MM / 2.0
    front = _View("seen from +X", "Y", "Z", np.array([-broad, -BELOW]), np.array([broad, top]))
    side = _View(f"seen from {MINUS}Y", "X", "Z", np.array([back - MARGIN, -BELOW]), np.array([fore + MARGIN, top]))
    above = _View("seen from above", "X", "Y", np.array([back - MARGIN, -broad]), np.array([fore + MARGIN, broad]))
    earlier = "".join(_polygon(corners[one], "none", SOFT, 0.6) for one in taken if one != number)
    where = f"Y = {_signed(dy)} mm, {'on the glass' if dz == 0 else f'raised by {dz:g} mm'}"
    return _sheet(
        (
            front,
            _glass(front) + earlier + _polygon(now, FILL, EDGE, 1.2) + _middle_line(front)
            + _across(low[0], high[0], top - 12.0, f"{high[0] - low[0]:g}")
            + _upright(high[0] + 8.0, low[1], high[1], f"{high[1] - low[1]:g}")
            + (_upright(low[0] - 8.0, 0.0, low[1], f"{low[1]:g}") if low[1] > 0 else "")
            + (_across(min(0.0, dy), max(0.0, dy), -19.0, f"{abs(dy):g}") if dy else "")
            + _line(dy, -21.0, dy, low[1], SOFT, 0.6, "3 3"),
        ),
        (
            side,
            _glass(side) + _polygon(_box(back, fore, low[1], high[1]), FILL, EDGE, 1.2)
            + "".join(_line(back, z, fore, z, EDGE, 0.5) for z in np.unique(now[:, 1])) + _laser(side, x_mm, reach_mm),
        ),
        (
            above,
            _polygon(_box(above.low[0], above.high[0], above.low[1], above.high[1]), GLASS, "none", 0.0)
            + _polygon(_box(back, fore, low[0], high[0]), FILL, EDGE, 1.2)
            + "".join(_line(back, one, fore, one, EDGE, 0.5) for one in np.unique(now[:, 0]))
            + _line(above.low[0], 0.0, above.high[0], 0.0, SOFT, 0.6, "3 3") + _laser(above, x_mm, reach_mm)
            + (_upright(fore + 9.0, min(0.0, dy), max(0.0, dy), f"{abs(dy):g}") if dy else ""),
        ),
        below=f"{where}, its length along the travel",
    )  # fmt: skip


def body_picture(body: Body, x_mm: float, reach_mm: tuple[float, float], turn_deg: float = TURN_DEG) -> str:
    """Draw a body on the glass, its middle at X = `x_mm` and Y = 0 and its length turned to the travel, as SVG.

    Parameters
    ----------
    reach_mm : ends of the film's travel, X
    """
    angle = np.radians(turn_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    own = np.asarray(body.vertices, np.float64)
    own = own - np.array([*(own[:, :2].min(axis=0) + own[:, :2].max(axis=0)) / 2.0, own[:, 2].min()])
    length, breadth, height = np.ptp(own, axis=0)
    at = own @ turn.T + np.array([x_mm, 0.0, 0.0])
    low, high = at.min(axis=0), at.max(axis=0)
    broad, top = float(np.abs(at[:, 1]).max()) + MARGIN, height + MARGIN
    begin, end = min(low[0], reach_mm[0]) - MARGIN, max(high[0], reach_mm[1]) + MARGIN
    front = _View("seen from +X", "Y", "Z", np.array([-broad, -BELOW]), np.array([broad, top]))
    side = _View(f"seen from {MINUS}Y", "X", "Z", np.array([begin, -BELOW]), np.array([end, top]))
    above = _View("seen from above", "X", "Y", np.array([begin, -broad]), np.array([end, broad]))
    centre, along, across = np.array([x_mm, 0.0]), turn[:2, 0] * length / 2.0, turn[:2, 1] * breadth / 2.0
    axis, beside = along * (1.0 + 28.0 / length), across * (1.0 + 16.0 / breadth)
    ends = _line(x_mm - axis[0], -axis[1], x_mm + axis[0], axis[1], INK, 0.6, "6 2 1 2")
    return _sheet(
        (
            front,
            _glass(front) + _seen(at, body.faces, 0, (1, 2), 1.0) + _middle_line(front)
            + _upright(high[1] + 8.0, 0.0, height, f"{height:g}"),
        ),
        (
            side,
            _glass(side) + _seen(at, body.faces, 1, (0, 2), -1.0) + _travel(reach_mm, -9.0)
            + _line(x_mm, -4.0, x_mm, side.high[1], SOFT, 0.6, "3 3"),
        ),
        (
            above,
            _polygon(_box(begin, end, above.low[1], above.high[1]), GLASS, "none", 0.0)
            + _seen(at, body.faces, 2, (0, 1), 1.0) + _line(begin, 0.0, end, 0.0, SOFT, 0.6, "3 3")
            + _line(x_mm, above.low[1], x_mm, above.high[1], SOFT, 0.6, "3 3") + ends
            + _words(x_mm + axis[0] + 2.0, axis[1] + 3.0, f"{turn_deg:g}°", "start")
            + _dimension(centre - along - beside, centre + along - beside, f"{length:g}", -9.0)
            + _dimension(centre - along * 1.15 - across, centre - along * 1.15 + across, f"{breadth:g}", 4.0)
            + _words(x_mm + 2.0, above.low[1] + 3.0, f"X = {x_mm:g}", "start"),
        ),
        below=f"{length:g} x {breadth:g} x {height:g} mm, its middle at X = {x_mm:g} mm and Y = 0, "
        f"turned by about {turn_deg:g}°",
    )  # fmt: skip


def _sheet(*views: tuple[_View, str], below: str) -> str:
    """Views side by side, the glass of all at one height, and a line of words below them."""
    tallest = max(view.height for view, _ in views)
    parts, left = [], 0.0
    for view, content in views:
        down = CAPTION + (view.high[1] if view.up == "Z" else view.height / 2.0 + (tallest - view.height) / 2.0)
        shift = left - view.low[0]
        axes = _axes(view)
        parts.append(
            f'<text x="{left:.1f}" y="9" font-weight="700">{view.title}</text>'
            f'<g transform="translate({shift:.1f} {down:.1f})">{content}{axes}</g>'
        )
        left += view.width + GAP
    width, height = left - GAP, CAPTION + tallest + 14.0
    parts.append(f'<text class="where" x="0" y="{height - 3.0:.1f}" font-weight="700">{_minus(below)}</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.1f} {height:.1f}" font-family="sans-serif" '
        f'font-size="8.5" fill="{INK}"><defs><marker id="tip" viewBox="0 0 6 6" refX="6" refY="3" markerWidth="5" '
        f'markerHeight="5" orient="auto-start-reverse"><path d="M0 0L6 3L0 6z" fill="{INK}"/></marker></defs>'
        f"{''.join(parts)}</svg>"
    )


def _axes(view: _View) -> str:
    """The axes of a view as arrows in its lower left corner."""
    x, y = view.low[0] + 5.0, view.low[1] + 5.0
    across = "X, travel" if view.across == "X" else "Y"
    return (
        _line(x, y, x + 18.0, y, INK, 0.9, ends="e") + _line(x, y, x, y + 16.0, INK, 0.9, ends="e")
        + _words(x + 20.0, y - 3.0, across, "start") + _words(x + 3.0, y + 12.0, view.up, "start")
    )  # fmt: skip


def _glass(view: _View) -> str:
    """The glass, 6 mm thick, below Z = 0."""
    return (
        _polygon(_box(view.low[0], view.high[0], -6.0, 0.0), GLASS, "none", 0.0)
        + _line(view.low[0], 0.0, view.high[0], 0.0, INK, 1.2)
        + (_words(view.high[0], -16.0, "glass, Z = 0", "end") if view.across == "Y" else "")
    )


def _middle_line(view: _View) -> str:
    return _line(0.0, -21.0, 0.0, view.high[1], SOFT, 0.6, "3 3") + _words(2.0, view.high[1] - 7.0, "Y = 0", "start")


def _laser(view: _View, x_mm: float, reach_mm: tuple[float, float]) -> str:
    """The plane of the lasers, on edge."""
    begin, end = reach_mm
    low = 0.0 if view.up == "Z" else view.low[1] + 22.0
    return (
        _line(x_mm, low, x_mm, view.high[1], LASER, 1.2)
        + _words(x_mm + 2.0, view.high[1] - 7.0, f"laser, X = {x_mm:g}", "start")
        + (_words(x_mm, -16.0, f"travel, X = {begin:g} to {end:g}", "middle") if view.up == "Z" else "")
    )


def _travel(reach_mm: tuple[float, float], at: float) -> str:
    begin, end = reach_mm
    return _line(begin, at, end, at, LASER, 1.2, ends="e") + _words(
        (begin + end) / 2.0, at - 9.0, f"travel of the heads, X = {begin:.0f} to {end:.0f}", "middle"
    )


def _seen(at: Floats, faces: NDArray[np.int64], away: int, shown: tuple[int, int], towards: float) -> str:
    """A mesh (V, 3) along the axis `away`, seen from its positive end or, `towards` = -1, from the negative one."""
    flat = at[:, shown]
    outline = _polygon(flat[ConvexHull(flat).vertices], FILL, EDGE, 1.2)
    normal = np.cross(at[faces[:, 1]] - at[faces[:, 0]], at[faces[:, 2]] - at[faces[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    facing = towards * normal[:, away] > 1e-6
    edges: dict[tuple[int, int], list[int]] = {}
    for face in np.flatnonzero(facing).tolist():
        for a, b in ((0, 1), (1, 2), (2, 0)):
            first, second = sorted((int(faces[face, a]), int(faces[face, b])))
            edges.setdefault((first, second), []).append(face)
    sharp = [edge for edge, beside in edges.items() if len(beside) == 1 or normal[beside[0]] @ normal[beside[1]] < 0.94]
    return outline + "".join(_between(flat[first], flat[second], EDGE, 0.5) for first, second in sharp)


def _across(low: float, high: float, at: float, words: str) -> str:
    """A dimension along the first axis."""
    return _line(low, at, high, at, INK, 0.5, ends="se") + _words((low + high) / 2.0, at + 2.0, words, "middle")


def _upright(at: float, low: float, high: float, words: str) -> str:
    """A dimension along the second axis."""
    return _line(at, low, at, high, INK, 0.5, ends="se") + _words(at + 2.0, (low + high) / 2.0 - 3.0, words, "start")


def _dimension(start: Floats, end: Floats, words: str, up: float) -> str:
    """A dimension from one place to another, with its words so much above its middle."""
    middle = (start + end) / 2.0
    return _between(start, end, INK, 0.5, ends="se") + _words(middle[0], middle[1] + up, words, "middle")


def _box(left: float, right: float, low: float, high: float) -> Floats:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def _polygon(corners: Floats, fill: str, stroke: str, width: float) -> str:
    points = " ".join(f"{x:.2f},{-y:.2f}" for x, y in corners)
    return f'<polygon points="{points}" fill="{fill}" stroke="{stroke}" stroke-width="{width:g}"/>'


def _between(start: Floats, end: Floats, stroke: str, width: float, ends: str = "") -> str:
    return _line(float(start[0]), float(start[1]), float(end[0]), float(end[1]), stroke, width, ends=ends)


def _line(
    x1: float, y1: float, x2: float, y2: float, stroke: str, width: float, dashes: str = "", ends: str = ""
) -> str:
    tips = ('marker-start="url(#tip)" ' if "s" in ends else "") + ('marker-end="url(#tip)" ' if "e" in ends else "")
    dashed = f'stroke-dasharray="{dashes}" ' if dashes else ""
    return (
        f'<line x1="{x1:.2f}" y1="{-y1:.2f}" x2="{x2:.2f}" y2="{-y2:.2f}" stroke="{stroke}" {dashed}{tips}'
        f'stroke-width="{width:g}"/>'
    )


def _words(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.2f}" y="{-y:.2f}" text-anchor="{anchor}">{_minus(words)}</text>'


def _minus(words: str) -> str:
    return words.replace("-", MINUS)


def _signed(mm: float) -> str:
    return f"{mm:+g}" if mm else "0"

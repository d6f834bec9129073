"""Draws the scanner of a rig.yaml with its dimensions, and the reference object, as SVG and PDF; and its STL.

    .venv/bin/python docs/build/drawings.py [RIG.yaml [FOLDER]]

Default: rig.yaml and the folder of this file. The rig says how many heads and cameras there are, how the heads travel,
and how far their lasers are ahead of each other. Where a camera stands within its head is that of the virtual scanner:
its stand to the left or right, in front or behind, above or below.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from footscan.mesh.formats.files import mesh_bytes
from footscan.mesh.mesh import Mesh
from footscan.virtual.filming.capture import HALF_LENGTH_MM, prism
from footscan.virtual.optics.glass import THICKNESS_MM
from footscan.virtual.optics.scanner import FAN_DEGREES, VOLUME_MM, Stand, nominal_place, usual_lasers, usual_stand
from footscan.virtual.stage.reference import standard_reference
from schemas.base.yaml_files import read_yaml
from schemas.rig import Rig, RigCamera

HERE = Path(__file__).resolve().parent
GLASS_HALF_MM = 110.0
"""Half the width of the plate: the volume and a rim on which it lies."""
LASER, CAMERA, GLASS, INK = "#d62728", "#1f77b4", "#9ecae1", "#222222"
FORMATS = ("svg", "pdf")
mpl.rcParams["svg.hashsalt"] = "footscan"  # the same drawing gives the same bytes


def main() -> None:
    rig_file = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "rig.yaml"
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else HERE
    rig = read_yaml(rig_file, Rig)
    places = {camera.id: nominal_place(stand_of(camera)) for camera in rig.cameras}
    for name, draw in (("front", _front), ("side", _side), ("above", _above)):
        figure = Figure(figsize=(9, 7), layout="constrained")
        draw(figure.subplots(), rig, places)
        _save(figure, folder / name)
    figure = Figure(figsize=(6, 6), layout="constrained")
    _reference(figure.subplots())
    _save(figure, folder / "reference")
    (folder / "reference.stl").write_bytes(mesh_bytes(reference_solid(), ".stl"))


def stand_of(camera: RigCamera) -> Stand:
    """The stand of a camera of a rig: as it says, or else the usual one of its number."""
    usual = usual_stand(camera.id if camera.id <= 8 else 1)
    if camera.stands is None:
        return usual
    below = "below" in camera.stands if {"above", "below"} & set(camera.stands) else usual.below
    left = "left" in camera.stands if {"left", "right"} & set(camera.stands) else usual.left
    front = "front" in camera.stands if {"front", "behind"} & set(camera.stands) else usual.front
    return Stand(below, left, front, usual_stand(5 if below else 1).elevation_degrees)


def reference_solid() -> Mesh:
    """The reference object as a closed body with flat ends, mm. All corners of its profile are seen from its middle."""
    profile = np.asarray(standard_reference().profile_mm)
    sides, count = prism(profile), len(profile)
    here, there = np.arange(count), (np.arange(count) + 1) % count
    middles = [[x, *profile.mean(axis=0)] for x in (HALF_LENGTH_MM, -HALF_LENGTH_MM)]
    front = np.column_stack([here, there, np.full(count, 2 * count)])
    back = np.column_stack([there + count, here + count, np.full(count, 2 * count + 1)])
    return Mesh(np.vstack([sides.vertices, middles]), np.concatenate([sides.faces, front, back]).astype(np.int32))


def _front(panel: Axes, rig: Rig, places: dict[int, Any]) -> None:
    """Across the travel: Y to the foot's left, Z up."""
    _titled(panel, "From the front: across the travel", "Y, mm", "Z, mm")
    (left, right), (bottom, top) = VOLUME_MM
    panel.add_patch(Rectangle((left, bottom), right - left, top - bottom, fill=False, linestyle=":", color=INK))
    panel.add_patch(Rectangle((-GLASS_HALF_MM, -THICKNESS_MM), 2 * GLASS_HALF_MM, THICKNESS_MM, color=GLASS))
    for laser in usual_lasers()[: len(rig.heads)]:
        _, y, z = laser.position
        half = np.radians(FAN_DEGREES / 2)
        middle = np.arctan2(laser.axis[2], laser.axis[1])
        rim = [(y + 260 * np.cos(middle + turn), z + 260 * np.sin(middle + turn)) for turn in (-half, half)]
        panel.add_patch(Polygon([(y, z), *rim], color=LASER, alpha=0.08))
        panel.plot(y, z, "s", color=LASER)
        panel.annotate(f"laser ({y:g}, {z:g})", (y, z), xytext=(4, -22), textcoords="offset points", fontsize=7)
    for y, z, ids in _grouped([(place[1], place[2], number) for number, (place, _) in places.items()]):
        panel.plot(y, z, "o", color=CAMERA)
        label = f"cameras {ids} ({y:.0f}, {z:.0f})"
        panel.annotate(label, (y, z), xytext=(4, -10), textcoords="offset points", fontsize=7)
    _dimension(panel, (left, top + 14), (right, top + 14), f"{right - left:g}")
    _dimension(panel, (right + 14, bottom), (right + 14, top), f"{top - bottom:g}")
    _dimension(panel, (-GLASS_HALF_MM, -24), (GLASS_HALF_MM, -24), f"glass {2 * GLASS_HALF_MM:g} × {THICKNESS_MM:g}")


def _side(panel: Axes, rig: Rig, places: dict[int, Any]) -> None:
    """Along the travel, the heads at X = 0."""
    _titled(panel, "From the side: along the travel, heads at X = 0", "X, mm", "Z, mm")
    end = rig.travel.start_mm + rig.travel.length_mm
    panel.add_patch(Rectangle((rig.travel.start_mm, -THICKNESS_MM), rig.travel.length_mm, THICKNESS_MM, color=GLASS))
    panel.axvline(0.0, color=LASER, linewidth=1)
    for x, z, ids in _grouped([(place[0], place[2], number) for number, (place, _) in places.items()]):
        panel.plot(x, z, "o", color=CAMERA)
        panel.plot([x, 0.0], [z, 50.0 if z > 0 else 16.0], color=CAMERA, linewidth=0.6)
        label = f"cameras {ids} ({x:.0f}, {z:.0f})"
        panel.annotate(label, (x, z), xytext=(4, -10), textcoords="offset points", fontsize=7)
    _dimension(panel, (rig.travel.start_mm, -60), (end, -60), f"travel {rig.travel.length_mm:g}")
    longest = max(rig.board.travel_mm)
    home = min(head.offset_mm for head in rig.heads)
    _dimension(panel, (home, -90), (home + longest, -90), f"rail between the switches, more than {longest:g}")


def _above(panel: Axes, rig: Rig, places: dict[int, Any]) -> None:
    """The cameras of each head from above."""
    _titled(panel, "From above: places of the cameras, laser planes in red", "X, mm", "Y, mm")
    for head in rig.heads:
        for laser in head.lasers:
            panel.axvline(laser.offset_mm, color=LASER, linewidth=1)
    for number, (place, target) in places.items():
        panel.plot(place[0], place[1], "o", color=CAMERA)
        panel.annotate(
            "",
            (target[0], target[1]),
            (place[0], place[1]),
            arrowprops={"arrowstyle": "->", "color": CAMERA, "lw": 0.7},
        )
        level = "above" if place[2] > 0 else "below"
        label = f"{number}, {level} ({place[0]:.0f}, {place[1]:.0f}, {place[2]:.0f})"
        panel.annotate(label, (place[0], place[1]), xytext=(4, 4), textcoords="offset points", fontsize=7)


def _reference(panel: Axes) -> None:
    """The profile of the reference object with the length of each edge."""
    _titled(panel, f"Reference object, {2 * HALF_LENGTH_MM:g} long in X", "Y, mm", "Z, mm")
    profile = np.asarray(standard_reference().profile_mm)
    panel.add_patch(Polygon(profile, facecolor="#dddddd", edgecolor=INK))
    for here, there in zip(profile, np.roll(profile, -1, axis=0), strict=True):
        middle, way = (here + there) / 2, there - here
        outward = np.array([way[1], -way[0]]) / np.hypot(*way)
        panel.annotate(f"{np.hypot(*way):g}", middle + 5 * outward, ha="center", va="center", fontsize=8)
    panel.set_aspect("equal", adjustable="box")
    panel.set_xlim(-70, 70)
    panel.set_ylim(-15, 115)


def _grouped(places: Sequence[tuple[float, float, int]]) -> list[tuple[float, float, str]]:
    """Cameras that lie behind each other in a view, by their place."""
    found: dict[tuple[int, int], list[int]] = {}
    for first, second, number in places:
        found.setdefault((round(first), round(second)), []).append(number)
    return [(first, second, ", ".join(map(str, numbers))) for (first, second), numbers in found.items()]


def _titled(panel: Axes, title: str, across: str, up: str) -> None:
    panel.set_title(title, fontsize=10)
    panel.set_xlabel(across, fontsize=8)
    panel.set_ylabel(up, fontsize=8)
    panel.tick_params(labelsize=7)
    panel.set_aspect("equal", adjustable="datalim")


def _dimension(panel: Axes, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    """A line with two arrows, and its length beside it."""
    panel.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": INK, "lw": 0.8})
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    panel.annotate(text, middle, xytext=(3, 3), textcoords="offset points", fontsize=8)


def _save(figure: Figure, place: Path) -> None:
    for kind in FORMATS:
        figure.savefig(place.with_suffix(f".{kind}"), metadata={"Date" if kind == "svg" else "CreationDate": None})


if __name__ == "__main__":
    main()

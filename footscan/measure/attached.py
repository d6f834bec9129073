"""Things that were held at the foot, and became part of its surface: a block or a hand beside it, a sock's cuff.

The sides of a foot, its back and its leg are smooth from section to section; a thing begins and ends with a step. At
the toes the outline has steps of its own, and nothing is looked for.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.landmarks.sides import FULL_SIZE_MM
from footscan.measure.outline import polygon_area
from footscan.mesh.sections import Cuttable, cut, cuttable

Floats = NDArray[np.float64]

ALONG_MM, UPWARDS_MM = 4.0, 2.0
"""Distance of the sections across the foot, and of those across the leg, on a foot of `FULL_SIZE_MM`."""
SIDES, BACK = (0.08, 0.6), (0.5, 0.85)
"""Shares of the length in which the sides are looked at, and the back of the foot."""
LOW_MM = 60.0
"""The sides are looked at up to this height, and the leg from there on: above, the leg leans as it likes."""
STEP_MM, BACK_STEP_MM, CUFF_MM = 9.0, 6.0, 0.9
"""Steps from section to section that no foot has, in the sides, the back and the radius of the leg, on a foot of
`FULL_SIZE_MM`. On 105 drawn feet, some with swellings, hammer toes and missing toes, they are up to 8.0, 3.6 and
0.55."""
LEG_SHARE = 0.55
"""A level section that is shorter than this share of the length is one of the leg."""


def things_at_foot(foot: FootFrame) -> list[str]:
    """Say where the surface has steps that no foot has, one line for the sides, the back and the leg.

    Examples
    --------
    A box of 250 mm, which has no steps, and the same with a block beside it:

    >>> import open3d as o3d
    >>> def measured(*boxes):
    ...     parts = [o3d.geometry.TriangleMesh.create_box(*size).translate(place) for size, place in boxes]
    ...     vertices = np.concatenate([np.asarray(part.vertices) for part in parts])
    ...     faces = np.concatenate([np.asarray(part.triangles) + 8 * n for n, part in enumerate(parts)])
    ...     return FootFrame(vertices, faces, vertices, np.eye(4), "toe2", 250.0)
    >>> box, block = ((250, 80, 50), (0, 0, 0)), ((40, 20, 30), (90, 75, 0))
    >>> print(things_at_foot(measured(box)), things_at_foot(measured(box, block)))
    [] ['the side of the foot has a step of 15 mm at 37 % of its length: something was held at it, or it moved']
    """
    mesh = cuttable(foot.vertices, foot.faces)
    size = min(1.0, foot.length / FULL_SIZE_MM)
    along = np.arange(SIDES[0] * foot.length, BACK[1] * foot.length, ALONG_MM * size)
    outline = np.array([_outline(mesh, x, size) for x in along])
    return [*_steps_along(outline, along / foot.length, size), *_cuff(mesh, foot.length, foot.cut_height, size)]


def _outline(mesh: Cuttable, x: float, size: float) -> tuple[float, float, float]:
    """Least and greatest Y of the low part of a section, and its greatest Z, mm; NaN without one."""
    loops = cut(mesh, np.array([x, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    points = np.concatenate([np.empty((0, 3)), *(loop.points for loop in loops)])
    low = points[points[:, 2] < LOW_MM * size, 1]
    return (float(low.min()), float(low.max()), float(points[:, 2].max())) if len(low) else (np.nan,) * 3


def _steps_along(outline: Floats, share: Floats, size: float) -> Iterator[str]:
    steps = np.abs(np.diff(outline, axis=0))
    # Where the leg is cut off, its front ends in a step.
    below_cut = np.maximum(outline[1:, 2], outline[:-1, 2]) < np.nanmax(outline[:, 2]) - BACK_STEP_MM * size
    at = share[1:]
    sides = np.where((at < SIDES[1])[:, None], steps[:, :2], 0.0).max(axis=1)
    back = np.where((at > BACK[0]) & below_cut, steps[:, 2], 0.0)
    for name, found, limit in (("side", sides, STEP_MM), ("back", back, BACK_STEP_MM)):
        step = np.nan_to_num(found)
        worst = int(step.argmax())
        if step[worst] > limit * size:
            yield (
                f"the {name} of the foot has a step of {step[worst]:.0f} mm at {100 * at[worst]:.0f} % of its length: "
                "something was held at it, or it moved"
            )


def _cuff(mesh: Cuttable, length: float, cut_height: float | None, size: float) -> Iterator[str]:
    """Look for a step in the radius of the leg, from one level section to the next."""
    top = float(mesh.vertices[:, 2].max()) if cut_height is None else cut_height
    heights = np.arange(LOW_MM * size, top - 2 * UPWARDS_MM * size, UPWARDS_MM * size)
    radius = np.array([_leg_radius(mesh, height, LEG_SHARE * length) for height in heights])
    bend = np.nan_to_num(np.abs(np.diff(radius, n=2)))
    if len(bend) and bend.max() > CUFF_MM * size:
        height = heights[1 + int(bend.argmax())]
        yield f"the leg has a step at a height of {height:.0f} mm: a cuff or a hand was on it"


def _leg_radius(mesh: Cuttable, height: float, longest: float) -> float:
    """Radius of the circle that has the area of the largest level section, mm; NaN if that is not of the leg."""
    loops = cut(mesh, np.array([0.0, 0.0, height]), np.array([0.0, 0.0, 1.0]))
    if not loops:
        return np.nan
    areas = [abs(polygon_area(loop.points[:, :2])) for loop in loops]
    points = loops[int(np.argmax(areas))].points
    return float(np.sqrt(max(areas) / np.pi)) if np.ptp(points[:, 0]) < longest else np.nan

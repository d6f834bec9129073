"""The surface of a foot, prepared for measuring: sections, landmarks, noise."""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.measure.foot_landmarks import Landmark
from footscan.measure.frame.foot_frame import FootFrame
from footscan.measure.landmarks.dorsal import CORNER_MM
from footscan.measure.landmarks.errors import saddle_gradient, summit_gradient
from footscan.measure.landmarks.sides import FULL_SIZE_MM
from footscan.measure.outline import Outline, Plane, smooth_outline
from footscan.measure.quantity import NotMeasurable, Quantity
from footscan.measure.roughness import Roughness, roughness
from footscan.mesh.sections import Cuttable, Loop, cut, cuttable
from footscan.mesh.topology import vertex_normals

Floats = NDArray[np.float64]
_Result = TypeVar("_Result")

ACROSS = np.array([1.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])
CLOSED_GAP_MM = 5.0
"""A narrower opening of a section is closed by a straight line; chosen by hand."""
LEAST_LOOP_MM = 60.0
"""Shorter loops are no section of a foot; chosen by hand."""
LEAST_SINE = 0.1
"""Least sine of the angle between a plane and the normals where it cuts; smaller ones are noise. Chosen by hand."""
MIDFOOT_SHARE = 0.02
"""Vertices this near to half the foot length, as a share of it, locate the middle of the section there."""
FACING = {
    "pternion": (-1.0, 0.0, 0.0),
    "metatarsale_tibiale": (0.0, 1.0, 0.0),
    "metatarsale_fibulare": (0.0, -1.0, 0.0),
    "heel_medial": (0.0, 1.0, 0.0),
    "heel_lateral": (0.0, -1.0, 0.0),
    "medial_malleolus": (0.0, 1.0, 0.0),
    "lateral_malleolus": (0.0, -1.0, 0.0),
} | {f"toe_{toe}_tip": (1.0, 0.0, 0.0) for toe in range(1, 6)}
"""Direction in which each landmark that is a summit of the surface is outermost; foot frame."""


class LandmarkQuantities(NamedTuple):
    """A landmark as three quantities, mm, in the foot's frame."""

    x: Quantity
    y: Quantity
    z: Quantity

    @property
    def point(self) -> Floats:
        """(3,) mm"""
        return np.array([self.x.value, self.y.value, self.z.value])


class FootSurface:
    """A foot in its own frame, with what all measures share: normals, noise, landmarks, sections.

    Parameters
    ----------
    rough : of the mesh of which this is a replicate, displaced a little: values are asked for, and all derivatives are
        NaN; default: it is estimated
    """

    def __init__(self, foot: FootFrame, landmarks: Mapping[str, Landmark], rough: Roughness | None = None) -> None:
        self.length_mm = foot.length
        self.mesh: Cuttable = cuttable(foot.vertices, foot.faces)
        self.normals: Floats = vertex_normals(foot.vertices, foot.faces)
        self.roughness = rough or roughness(foot.vertices, self.normals, foot.faces)
        self.errors, self.noise = self.roughness
        self._no_derivatives = None if rough is None else np.full(len(self.normals), np.nan)
        self.landmarks = landmarks
        self._places: dict[str, LandmarkQuantities] = {}
        self._outlines: dict[tuple[float, ...], Outline] = {}
        self._results: dict[Callable[[FootSurface], Any], Any] = {}

    @cached_property
    def midfoot(self) -> Outline:
        """The section at half the foot length.

        Raises
        ------
        NotMeasurable
            There is no section, or it has a gap.
        """
        x = 0.5 * self.length_mm
        near = self.mesh.vertices[np.abs(self.mesh.vertices[:, 0] - x) < MIDFOOT_SHARE * self.length_mm]
        if not len(near):
            raise NotMeasurable("the surface has no section here")
        inside = np.array([x, *(near[:, 1:].min(axis=0) + near[:, 1:].max(axis=0)) / 2])
        return self.outline(Plane.across(inside, ACROSS), inside)

    @property
    def top(self) -> float:
        """Height of the highest point, mm."""
        return float(self.mesh.vertices[:, 2].max())

    def place(self, name: str) -> LandmarkQuantities:
        """The landmark `name`, with its derivatives by the displacements of the vertices.

        The derivatives are known for summits and for the junction of foot and leg. Those of landmarks set by hand are
        0, and so are those of the landing point, which hardly follows the surface. Those of all others are NaN.

        Raises
        ------
        NotMeasurable
            The landmark was not found.
        """
        if name not in self._places:
            if name not in self.landmarks:
                raise NotMeasurable(f"{name.replace('_', ' ')} was not found")
            landmark = self.landmarks[name]
            doubt = None
            if landmark.method == "fallback" or landmark.at_border:
                why = "by a fallback" if landmark.method == "fallback" else "at the border of where it is sought"
                doubt = f"{name.replace('_', ' ')} {why}"
            gradient = self._landmark_gradient(name, landmark)
            self._places[name] = LandmarkQuantities(
                *(Quantity(float(value), row, doubt) for value, row in zip(landmark.point, gradient, strict=True))
            )
        return self._places[name]

    def _landmark_gradient(self, name: str, landmark: Landmark) -> Floats:
        """Returns (3, V) derivatives of the coordinates by the displacements of the vertices; NaN where unknown."""
        if self._no_derivatives is not None:
            return np.broadcast_to(self._no_derivatives, (3, len(self.normals)))
        vertices, normals, point, cap = self.mesh.vertices, self.normals, landmark.point, landmark.cap
        if cap is not None and name in FACING:
            return summit_gradient(vertices, normals, point, np.array(FACING[name]), cap)
        if cap is not None and name == "junction_point":
            scale = min(1.0, self.length_mm / FULL_SIZE_MM)
            corner = np.array([CORNER_MM[0], 0.0, CORNER_MM[1]]) * scale
            return saddle_gradient(vertices, normals, point, corner, cap)
        is_fixed = landmark.method == "manual" or (landmark.method == "geometric" and name == "landing_point")
        return np.full((3, len(normals)), 0.0 if is_fixed else np.nan)

    def station(self, share: float) -> Quantity:
        """X at a share of the foot length: 0 at the rearmost heel point, 1 at the longest toe."""
        tips = [self.place(name) for name in self.landmarks if name.startswith("toe_")]
        longest = max((tip.x for tip in tips), key=lambda x: x.value, default=None)
        gradient = np.zeros(len(self.normals)) if longest is None else share * longest.gradient
        if "pternion" in self.landmarks:
            gradient = gradient + (1.0 - share) * self.place("pternion").x.gradient
        return Quantity(share * self.length_mm, gradient)

    def sections(self, plane: Plane) -> list[Loop]:
        """All loops of the surface in `plane`."""
        return cut(self.mesh, plane.point, plane.normal)

    def outline(self, plane: Plane, seed: Floats) -> Outline:
        """The smoothed loop in `plane` around (3,) `seed`, or else the one that passes nearest to it.

        Raises
        ------
        NotMeasurable
            There is no loop, or it is open by CLOSED_GAP_MM or more.
        """
        key = tuple(np.concatenate([plane.point, plane.normal, seed]).tolist())
        if key not in self._outlines:
            loop = nearest_loop(self.sections(plane), plane, seed)
            if loop is None:
                raise NotMeasurable("the surface has no section here")
            if loop.gap >= CLOSED_GAP_MM:
                raise NotMeasurable(f"the surface has a gap of {loop.gap:.0f} mm here")
            self._outlines[key] = self.smooth(loop, plane)
        return self._outlines[key]

    def once(self, compute: "Callable[[FootSurface], _Result]") -> _Result:
        """The result of `compute` for this surface; it is computed once and kept."""
        if compute not in self._results:
            self._results[compute] = compute(self)
        result: _Result = self._results[compute]
        return result

    def smooth(self, loop: Loop, plane: Plane) -> Outline:
        """The loop in `plane`, with the noise of the mesh smoothed away."""
        x, y = self.outwards(plane, loop.edges.ravel()).T
        moves = np.hypot(x, y).reshape(-1, 2)
        return smooth_outline(loop, plane, moves * self.noise[loop.edges])

    def gradient(self, outline: Outline, by_points: Floats) -> Floats:
        """Returns (V,) derivatives by the displacements of the vertices, from (N, 2) ones by the outline's points."""
        if self._no_derivatives is not None:
            return self._no_derivatives
        by_points = outline.raw_gradient(by_points)
        shares = (1.0 - outline.loop.shares, outline.loop.shares)
        total = np.zeros(len(self.normals))
        for vertex, share in zip(outline.loop.edges.T, shares, strict=True):
            along = np.einsum("ni,ni->n", by_points, self.outwards(outline.plane, vertex))
            total += np.bincount(vertex, share * along, len(total))
        return total

    def outwards(self, plane: Plane, vertices: NDArray[np.int64]) -> Floats:
        """Returns (N, 2) displacements of a section where (N,) vertices move outwards by 1.

        Their length is 1 over the sine of the angle between plane and normal, which is taken as at least LEAST_SINE.
        """
        return _outwards(self.normals, vertices, plane.first, plane.second)


def nearest_loop(loops: list[Loop], plane: Plane, seed: Floats, least: float = LEAST_LOOP_MM) -> Loop | None:
    """The longest loop around (3,) `seed`; if there is none, the loop that passes nearest to it.

    Loops shorter than `least` mm are left out.
    """
    centre = plane.flat(seed[None])[0]
    around, passing = [], []
    for loop in loops:
        length, nearest, is_around = _seen_from_origin(plane.flat(loop.points) - centre)
        if length < least:
            continue
        if is_around:
            around.append((length, loop))
        passing.append((nearest, loop))
    if around:
        return max(around, key=lambda candidate: candidate[0])[1]
    return min(passing, key=lambda candidate: candidate[0])[1] if passing else None


@compiled
def _outwards(normals: Floats, vertices: NDArray[np.int64], first: Floats, second: Floats) -> Floats:
    moved = np.empty((len(vertices), 2))
    for k in range(len(vertices)):
        x, y, z = normals[vertices[k], 0], normals[vertices[k], 1], normals[vertices[k], 2]
        u, v = x * first[0] + y * first[1] + z * first[2], x * second[0] + y * second[1] + z * second[2]
        squared = max(u * u + v * v, LEAST_SINE**2)
        moved[k, 0], moved[k, 1] = u / squared, v / squared
    return moved


@compiled
def _seen_from_origin(polygon: Floats) -> tuple[float, float, bool]:
    """Returns the length of a (N, 2) polygon, the distance of its nearest corner, and whether it surrounds the origin.

    It does if a ray from the origin crosses an odd number of its sides.
    """
    length, nearest, is_around = 0.0, np.inf, False
    for k in range(len(polygon)):
        x, y = polygon[k]
        end_x, end_y = polygon[(k + 1) % len(polygon)]
        length += np.hypot(end_x - x, end_y - y)
        nearest = min(nearest, np.hypot(x, y))
        if (y > 0) != (end_y > 0) and x - y * (end_x - x) / (end_y - y) > 0:
            is_around = not is_around
    return length, nearest, is_around

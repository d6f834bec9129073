"""The frame of a foot: origin on the floor below the heel, X along the axis, Z up."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.frame.axis import along_axis
from footscan.measure.frame.glass import to_glass
from footscan.measure.frame.pose import Pose, find_pose
from footscan.measure.landmarks.dense_points import dense_points
from footscan.measure.landmarks.toes import FOREFOOT, STRIP_MM
from footscan.mesh.rigid_transform import apply, low_height
from footscan.mesh.topology import keep_large_components, used_vertices
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.glass import CALIBRATED, Plane
from schemas.measures import Axis

Floor = Literal["glass", "sole", "resting"]
Floats = NDArray[np.float64]

STRAY_SHARE = 0.02
"""Parts of a mesh with less than this share of its triangles are not the foot; chosen by hand."""
SPACING_MM = 4.0
"""Largest distance of neighbouring samples, approximately; chosen by hand."""
DIAGONAL_MM = (110.0, 900.0)
"""Diagonals from a child's foot without a leg to a large foot with the leg up to the knee."""
LENGTH_MM = (100.0, 380.0)
"""Foot lengths that are accepted."""
SLENDERNESS = (1.7, 4.5)
"""Range of length over breadth that a foot can have; chosen by hand."""
TOES, DESCENT = 0.80, 0.75
"""Ahead of the first share of the length, a foot is lower than the second share of the height of its hind part; a block
or an egg is not. Chosen by hand."""
CONVEX = 0.9
"""A foot fills less than this share of its convex hull; chosen by hand."""
HEEL_STATION, BALL_STATION, HEEL_OVER_BALL = (0.08, 0.22), (0.55, 0.85), 1.0
"""Between these shares of the length, the heel of a foot is no broader than its ball; the narrow end of a pear may be.
Chosen by hand."""
GLASS_MM, GLASS_DEG = 3.0, 3.0
"""A mesh stands on the glass if its lowest point is nearer than this to it and its sole is parallel to this angle.
Chosen by hand."""
ABOUT_LEVEL_DEG = 20.0
"""Largest tilt on the glass of a foot without a flat sole, whose level is less certain; chosen by hand."""
CLEAR_SIDE = 0.03
"""The form determines the side if toes and ball reach farther ahead on one side by this share of the length; chosen by
hand."""


class Body(NamedTuple):
    """What is known of a body before it is measured."""

    is_whole: bool = True
    """False accepts the proportions of a foot without its toes or its heel"""
    to_floor: Floats | None = None
    """(4, 4) from the frame of the mesh to one with the floor at Z = 0; None: the floor is the glass or the sole"""
    shell: Pose | None = None
    """Pose of a foot without its upper side; None: its upper side is there"""


class FootFrame(NamedTuple):
    """A foot in its own frame, in mm.

    +X runs from heel to toes along the axis, Z up; the origin is on the floor below the rearmost heel point. A left
    foot is mirrored into a right one, so that +Y is medial.
    """

    vertices: Floats
    """(V, 3)"""
    faces: NDArray[np.int32]
    """(F, 3), without strays"""
    samples: Floats
    """(N, 3) the vertices and points on large triangles, so that neighbours are about `SPACING_MM` apart at most"""
    transform: Floats
    """(4, 4) from the frame of the mesh to this one"""
    axis: Axis
    length: float
    """Foot length, mm."""
    side: Side = "right"
    """The side as which the foot was measured: the stated one, or else the one inferred from the form."""
    side_note: str | None = None
    """A warning if the form contradicts the stated side."""
    floor: Floor = "sole"
    """Origin of the floor: the scanner's glass, a plane through the flat sole, or, without a flat sole, the
    plane on which the foot comes to rest."""
    floor_residual: float = 0.0
    """Standard deviation of the skin on the floor about it, mm."""
    cut_height: float | None = None
    """Lowest point of the cut through the leg, mm; None if the leg has no flat end."""
    axis_not_found: Axis | None = None
    """The requested axis of a whole foot where `axis` is another one, since the second toe could not be identified."""

    @property
    def low(self) -> float:
        """Height in mm below which there is foot and no leg."""
        return low_height(self.length)


def foot_frame(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    side: Side,
    axis: Axis = "toe2",
    marked: Mapping[str, Floats] | None = None,
    glass: Plane = CALIBRATED,
    body: Body | None = None,
) -> FootFrame:
    """Compute the frame of a foot in any pose; on the scanner's glass that is the floor.

    The axis runs from the rearmost heel point to the tip of the second toe ("toe2"), to the middle of the ball
    ("ball_center"), or along the medial tangent of heel and ball ("brannock"). Where the second toe cannot be
    identified, "toe2" becomes "ball_center". Without toes or heel, the axis is the long axis of the footprint, which
    counts as "ball_center".

    Parameters
    ----------
    vertices : (V, 3) mm, any frame
    faces : (F, 3), looking outward
    side : "unknown" is inferred from the form
    axis : the requested axis
    marked : (3,) mm, points set by a person, in the frame of the mesh; pternion and toe_2_tip are used here
    glass : the plane of the scanner's glass in the frame of the mesh
    body : what is known of a foot that is not whole; default: it is whole

    Raises
    ------
    Finding
        The surface is no foot, or not in mm.
    """
    places, faces = used_vertices(np.asarray(vertices, np.float64), keep_large_components(faces, STRAY_SHARE))
    _check_size(places)
    body = body or Body()
    pose = body.shell or find_pose(places, faces)
    transform, floor = _on_floor(places, pose, to_glass(glass), body.to_floor)
    samples = dense_points(places, faces, SPACING_MM)
    moved = apply(transform, samples)
    if body.is_whole:
        _check_form(moved, pose, body.shell is None)

    lead = _medial_lead(moved, pose.length)
    form: Side = "right" if lead >= 0 else "left"
    measured = form if side == "unknown" else side
    if measured == "left":
        transform = np.diag([1.0, -1.0, 1.0, 1.0]) @ transform
        faces = faces[:, ::-1]
    low = samples[moved[:, 2] <= low_height(pose.length)]
    forefoot = forefoot_points(apply(transform, places), faces, pose.length, low_height(pose.length))
    forefoot = apply(np.linalg.inv(transform), forefoot)
    if body.is_whole:
        transform, actual_axis, length = along_axis(transform, low, forefoot, pose.length, axis, marked or {})
    else:
        transform, actual_axis, length = _along_footprint(transform, low)
    _check_length(length)
    note = f"toes and ball look like those of a {form} foot"
    return FootFrame(
        vertices=apply(transform, places),
        faces=faces,
        samples=apply(transform, samples),
        transform=transform,
        axis=actual_axis,
        length=length,
        side=measured,
        side_note=note if measured != form and abs(lead) > CLEAR_SIDE else None,
        floor=floor,
        floor_residual=pose.residual,
        cut_height=None if pose.leg_end is None else float(apply(transform, pose.leg_end)[:, 2].min()),
        axis_not_found=axis if body.is_whole and actual_axis != axis else None,
    )


def _along_footprint(transform: Floats, low: Floats) -> tuple[Floats, Axis, float]:
    """The frame and the length of a foot without its toes or its heel, along its footprint; as `along_axis`."""
    moved = apply(transform, low)
    shift = np.eye(4)
    shift[:2, 3] = -moved[np.argmin(moved[:, 0]), :2]
    return shift @ transform, "ball_center", float(np.ptp(moved[:, 0]))


def forefoot_points(vertices: Floats, faces: NDArray[np.integer], length: float, low: float) -> Floats:
    """Returns (N, 3) points of the forefoot, dense enough to separate its toes.

    Parameters
    ----------
    vertices : (V, 3) mm, in the foot's frame
    length, low : mm, foot length and height below which there is no leg
    """
    x, z = vertices[:, 0], vertices[:, 2]
    ahead = (x > FOREFOOT * length) & (z <= low)
    return dense_points(*used_vertices(vertices, faces[ahead[faces].any(axis=1)]), STRIP_MM)


def _check_size(vertices: Floats) -> None:
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if not DIAGONAL_MM[0] <= diagonal <= DIAGONAL_MM[1]:
        raise Finding(f"the surface is {diagonal:.3g} across, expected a foot in mm: {_range(DIAGONAL_MM)}")


def _on_floor(vertices: Floats, pose: Pose, to_glass: Floats, to_floor: Floats | None) -> tuple[Floats, Floor]:
    """Returns (4, 4) the transform to the floor if that is known, to the glass if the foot stands on it, or else to the
    floor of its pose.

    The heel comes to lie near X = 0.
    """
    transform = pose.transform.copy()
    floor: Floor = "sole" if pose.stands else "resting"
    to_plane = to_glass if to_floor is None else to_floor
    turn = transform[:3, :3] @ to_plane[:3, :3].T
    tilt = float(np.degrees(np.arccos(np.clip(turn[2, 2], -1.0, 1.0))))
    lowest = apply(to_glass, vertices)[:, 2].min()
    on_glass = abs(lowest) < GLASS_MM and tilt < (GLASS_DEG if pose.stands else ABOUT_LEVEL_DEG)
    if to_floor is not None or on_glass:
        floor = "glass" if to_floor is None else "sole"
        along = turn[0, :2] / np.linalg.norm(turn[0, :2])
        about_z = np.eye(4)
        about_z[:2, :2] = along, [-along[1], along[0]]
        transform = about_z @ to_plane
    low = apply(transform, vertices)
    transform[0, 3] -= low[low[:, 2] <= low_height(pose.length), 0].min()
    return transform, floor


def _check_form(samples: Floats, pose: Pose, has_upper_side: bool) -> None:
    """Raise `Finding` if the form is not that of a foot; `samples` with the floor at Z = 0 and the heel near X = 0."""
    length = pose.length
    _check_length(length)
    breadth = float(np.ptp(samples[samples[:, 2] <= low_height(length), 1]))
    if not SLENDERNESS[0] <= length / breadth <= SLENDERNESS[1]:
        raise Finding(f"the surface is {length:.0f} mm long and {breadth:.0f} mm broad, expected a foot")
    if not pose.convexity < CONVEX:
        raise Finding("the surface is round or a block without hollows, expected a foot")
    x, z = samples[:, 0], samples[:, 2]
    hind, toes = z[x < (1 - TOES) * length].max(initial=0.0), z[x > TOES * length].max(initial=0.0)
    if has_upper_side and not toes < DESCENT * hind:
        heights = f"the surface is {hind:.0f} mm high at one end and {toes:.0f} mm at the other"
        raise Finding(f"{heights}, expected a foot, whose toes are lower than its heel with the leg")
    low = samples[samples[:, 2] <= low_height(length)]
    heel, ball = (
        float(
            np.ptp(
                low[(low[:, 0] > first * length) & (low[:, 0] < last * length), 1],
            )
        )
        for first, last in (HEEL_STATION, BALL_STATION)
    )
    if not 0.0 < heel < HEEL_OVER_BALL * ball:
        raise Finding(f"the surface is {heel:.0f} mm broad at the heel and {ball:.0f} mm at the ball, expected a foot")


def _check_length(length: float) -> None:
    if not LENGTH_MM[0] <= length <= LENGTH_MM[1]:
        raise Finding(f"the surface is {length:.0f} mm long, expected a foot of {_range(LENGTH_MM)}")


def _range(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.0f} to {bounds[1]:.0f} mm"


def _medial_lead(samples: Floats, length: float) -> float:
    """Distance in lengths by which toes and ball reach farther ahead on the +Y side than on the other."""
    low = samples[samples[:, 2] <= low_height(length)]
    toes = low[low[:, 0] > 0.6 * length]
    last, first = float(toes[:, 1].max()), float(toes[:, 1].min())
    quarter = (last - first) / 4
    of_toes = toes[toes[:, 1] > last - quarter, 0].max() - toes[toes[:, 1] < first + quarter, 0].max()
    ball = low[(low[:, 0] > 0.5 * length) & (low[:, 0] < 0.78 * length)]
    of_ball = ball[np.argmax(ball[:, 1]), 0] - ball[np.argmin(ball[:, 1]), 0]
    return float(of_toes + of_ball) / (2 * length)

"""What stands on the glass in a world: its surface, and its true measures."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.foot.foot import Foot, FootShape, make_foot, placed, sample_shape
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.portable import cos_sin
from footscan.virtual.worlds.draw import TRAVEL_MM
from schemas.base.errors import RefusedInput
from schemas.world import WorldSubject

MESH_MM = 1.0
"""Edge length of the mesh that is filmed. Its true measures are those of the smooth foot: with edges of 2 mm, girths of
the mesh at waist and instep are 0.05 to 0.09 mm short of them, with 1 mm 0.01 to 0.02."""
TRIES = 40
"""Shapes that are drawn until one can have the arch and the toes of the world. Chosen by hand."""
WHOLE_LENGTH_MM = 262.0
"""Length of the foot that is scaled to the length of the subject: the mean one, as no child's shape is at hand."""
AXIS_TOE = 2
"""The toe whose tip the axis of all measures runs to: an object without it has none of them by definition."""
NAIL_MM = 7.0
"""Half the length of the nail of toe 1; those of the others are shorter. Chosen by hand."""
BODY_TURN_DEG, BODY_TURN_SPREAD_DEG, BODY_SPREAD_MM = 20.0, 5.0, 5.0
"""A body stands at about this angle to the travel, as somebody puts it by hand. Chosen by hand."""
LONGEST_EDGE_MM = 8.0
"""Longest edge of a body's mesh: the light on a face is that of its corners. Chosen by hand."""
SCAN_HEIGHT = "scan_height"
"""Height at which a scan ends, which is no measure of the foot."""


@dataclass(frozen=True)
class Subject:
    """An object in the frame of the glass plate: Z = 0 is its upper face."""

    mesh: Mesh
    measures: dict[str, float | None]
    """True measures, mm; None for those that the object does not have."""
    nails: NDArray[np.float64]
    """(K, 4) centre and radius of toenails."""


def make_subject(subject: WorldSubject, resolution_mm: float = MESH_MM) -> Subject:
    """Make the subject of a world in the middle of the travel.

    resolution_mm : edge length of the mesh.
    """
    foot = _foot(subject, resolution_mm)
    deformity = subject.deformity
    is_stump = deformity.amputated_at is not None or subject.kind == "last" or AXIS_TOE in deformity.missing_toes
    measures = {name: None if is_stump else value for name, value in foot.measures.items() if name != SCAN_HEIGHT}
    measures.setdefault("toe_height", None)
    middle = np.array([subject.length_mm / 2.0, 0.0, 0.0])
    tips = {name: place - middle for name, place in foot.landmarks.items()}
    centred = replace(foot, vertices=foot.vertices - middle, landmarks=tips)
    standing = placed(centred, TRAVEL_MM / 2.0, subject.y_mm, subject.turn_deg)
    return Subject(Mesh(standing.vertices, standing.faces.astype(np.int64)), measures, _nails(standing, subject))


def make_body(body: Mesh, seed: int) -> Subject:
    """Place a body, a closed mesh with Z = 0 at its foot, by hand in the middle of the travel."""
    random = np.random.default_rng([seed, 320])
    cos, sin = cos_sin(BODY_TURN_DEG + random.uniform(-BODY_TURN_SPREAD_DEG, BODY_TURN_SPREAD_DEG))
    x, y = np.array([TRAVEL_MM / 2.0, 0.0]) + random.uniform(-BODY_SPREAD_MM, BODY_SPREAD_MM, 2)
    finer, split = body.vertices, body.faces
    while _longest_edge(finer, split) > LONGEST_EDGE_MM:
        finer, split = _halved(finer, split)
    turned = np.column_stack([cos * finer[:, 0] - sin * finer[:, 1], sin * finer[:, 0] + cos * finer[:, 1]])
    place = np.column_stack([turned + np.array([x, y]), finer[:, 2]])
    return Subject(Mesh(place, split), {}, np.empty((0, 4)))


def _longest_edge(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> float:
    return float(np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2).max())


def _halved(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The mesh with a vertex in the middle of each edge, and four faces in place of each."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    ab, bc, ca = number.reshape(3, -1) + len(vertices)
    a, b, c = faces.T
    parts = [np.column_stack(corners) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([vertices, vertices[edges].mean(axis=1)]), np.concatenate(parts)


def _nails(foot: Foot, subject: WorldSubject) -> NDArray[np.float64]:
    """Nails lie behind the tips of the toes."""
    size = subject.length_mm / WHOLE_LENGTH_MM
    cos, sin = cos_sin(subject.turn_deg)
    nails = []
    for toe in range(1, 6):
        tip = foot.landmarks.get(f"toe_{toe}_tip")
        if tip is not None:
            radius = size * (NAIL_MM if toe == 1 else 0.6 * NAIL_MM)
            nails.append([*(tip + radius * np.array([-cos, -sin, 1.0])), 1.2 * radius])
    return np.array(nails, np.float64).reshape(-1, 4)


def _foot(subject: WorldSubject, resolution_mm: float) -> Foot:
    deformity = subject.deformity
    scale = subject.length_mm / WHOLE_LENGTH_MM
    refused: RefusedInput | None = None
    for attempt in range(TRIES):
        random = np.random.default_rng([subject.shape_seed, attempt])
        shape = sample_shape(random, "male" if random.random() < 0.5 else "female")
        wanted = replace(
            _scaled(shape, WHOLE_LENGTH_MM / shape.foot_length),
            arch_height=subject.arch_mm,
            toe_gap=subject.toe_gap_mm,
            scan_height=subject.leg_mm / scale,
            ankle_swelling=deformity.ankle_swelling_mm,
            hammer_toes=deformity.hammer_toes,
            missing_toes=(1, 2, 3, 4, 5) if subject.kind == "last" else tuple(deformity.missing_toes),
            amputated_at=deformity.amputated_at,
        )
        try:
            return make_foot(
                wanted,
                side="left" if subject.side == "left" else "right",
                resolution_mm=resolution_mm,
                size=scale,
            )
        except RefusedInput as error:
            refused = error
    raise refused or AssertionError("at least one shape is tried")


def _scaled(shape: FootShape, factor: float) -> FootShape:
    """A foot of the same form and another size; toe gap, arch and leg are set apart from it."""
    lengths = (
        "foot_length", "ball_length", "lateral_ball_length", "foot_breadth", "ball_girth", "heel_breadth",
        "instep_height", "hallux_height", "ankle_breadth", "ankle_girth", "malleolus_height",
    )  # fmt: skip
    return replace(shape, **{name: factor * getattr(shape, name) for name in lengths})

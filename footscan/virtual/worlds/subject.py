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

TRIES = 40
"""Shapes that are drawn until one can have the arch and the toes of the world. Chosen by hand."""
WHOLE_LENGTH_MM = 262.0
"""Length of the foot that is scaled to the length of the subject: the mean one, as no child's shape is at hand."""
AXIS_TOE = 2
"""The toe whose tip the axis of all measures runs to: an object without it has none of them by definition."""
NAIL_MM = 7.0
"""Half the length of the nail of toe 1; those of the others are shorter. Chosen by hand."""
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


def make_subject(subject: WorldSubject, resolution_mm: float = 2.0) -> Subject:
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

"""The room of a world: hardware that travels with a camera, and things that stand or move while heads travel past them.

A thing is a sphere, which a picture shows as a disc, or a rod between two points. What is behind the subject is hidden
by it; what is in front of it, between camera and subject, does not occur.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.scanner import Camera
from footscan.virtual.portable import gaussian_blur
from footscan.virtual.worlds.draw import TRAVEL_MM
from footscan.virtual.worlds.machine import Machine, Pose
from schemas.world import WorldRoom

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

NEAREST_MM, FARTHEST_MM = 250.0, 3000.0
"""Distances of things from the middle of the scan volume, away from the camera. Chosen by hand."""
VOLUME_MM = 350.0
"""Distance from a camera to the middle of the scan volume, about."""
PEOPLE_MM_PER_S = (100.0, 1200.0)
"""Speeds of people in the background: from shifting weight to walking."""


class Thing(NamedTuple):
    """A thing of the room, in the scanner frame."""

    start: Floats
    """(3,) mm at the first frame."""
    end: Floats
    """(3,) mm: the other end of a rod; of a sphere the same."""
    radius_mm: float
    colour: Floats
    """(3,) reflectance; above 1 it shines by itself."""
    velocity: Floats
    """(3,) mm/s"""
    is_laser_lit: bool
    """True if it reflects the laser: its light follows the laser's power, not the room's."""


def things_of(machine: Machine, camera_id: int, travel_mm: float) -> list[Thing]:
    """Draw the things that a camera may see, at random but fixed for the world."""
    room = machine.world.room
    camera = machine.cameras[camera_id]
    random = np.random.default_rng([machine.world.seed, 500 + camera_id])
    rows, columns = machine.size

    def place() -> Floats:
        pixel = random.uniform([0.0, 0.0], [columns, rows])
        _, directions = camera.rays(pixel[None])
        depth = VOLUME_MM + np.exp(random.uniform(np.log(NEAREST_MM), np.log(FARTHEST_MM)))
        return np.asarray(
            camera.position + depth * directions[0] + np.array([random.uniform(0.0, travel_mm), 0.0, 0.0])
        )

    things = [_thing(place(), random, kind) for kind, count in _kinds(room) for _ in range(count)]
    return sorted(things, key=lambda thing: -float(np.linalg.norm(thing.start - camera.position)))


def _kinds(room: WorldRoom) -> list[tuple[str, int]]:
    return [
        ("thing", room.things), ("red", room.red_things), ("line", room.line_things), ("person", room.people),
        ("sun", room.sun_patches), ("glint", room.room_glints),
    ]  # fmt: skip


def _thing(place: Floats, random: np.random.Generator, kind: str) -> Thing:
    still, grey = np.zeros(3), np.full(3, random.uniform(0.05, 0.9))
    way = random.normal(0.0, 1.0, 3)
    way /= np.sqrt((way**2).sum())
    size = np.exp(random.uniform(np.log(5.0), np.log(200.0)))
    if kind == "line":
        return Thing(
            place, place + way * random.uniform(100.0, 800.0), random.uniform(0.5, 3.0), grey * 1.2, still, False
        )
    if kind == "red":
        return Thing(place, place + way * size, size / 4.0, np.array([0.9, 0.12, 0.1]), still, False)
    if kind == "person":
        walks = way * np.array([1.0, 1.0, 0.05]) * random.uniform(*PEOPLE_MM_PER_S)
        return Thing(place, place + np.array([0.0, 0.0, 800.0]), 150.0, grey, walks, False)
    if kind == "sun":
        return Thing(place, place, size, np.array([6.0, 5.6, 5.0]), still, False)
    if kind == "glint":
        return Thing(place, place, random.uniform(0.5, 3.0), np.full(3, random.uniform(0.2, 2.0)), still, True)
    return Thing(place, place + way * size * random.uniform(0.0, 3.0), size / 2.0, grey, still, False)


def draw_things(
    things: list[Thing],
    camera: Camera,
    pose: Pose,
    plate: Pose,
    seconds: float,
    lights: tuple[float, float],
    into: Singles,
) -> None:
    """Draw things into a picture (R, C, 3) of light, the farthest first.

    camera : head frame. pose : head frame to plate frame. lights : of the room and of the laser, 1 being white.
    """
    for thing in things:
        moved = thing.velocity * seconds
        ends = pose.undo(plate.undo(np.array([thing.start + moved, thing.end + moved])))
        pixels = camera.lens.pixels(np.einsum("ij,nj->ni", camera.rotation, ends - camera.position))
        if not np.isfinite(pixels).all():
            continue
        depth = float(np.linalg.norm(ends[0] - camera.position))
        radius_px = max(thing.radius_mm * camera.lens.focal_px / depth, 0.5)
        strength = lights[1] if thing.is_laser_lit else lights[0]
        draw_rod(pixels, radius_px, (thing.colour * strength).astype(np.float32), thing.is_laser_lit, into)


@compiled
def draw_rod(pixels: Floats, radius: float, colour: Singles, adds: bool, into: Singles) -> None:
    """Draw a rod between two `pixels` (2, 2), with round ends, over a picture (R, C, K), or add its light."""
    rows, columns = into.shape[0], into.shape[1]
    ai, aj, bi, bj = pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1]
    least_i, most_i = max(min(ai, bi) - radius - 1.0, 0.0), min(max(ai, bi) + radius + 1.0, columns - 1.0)
    least_j, most_j = max(min(aj, bj) - radius - 1.0, 0.0), min(max(aj, bj) + radius + 1.0, rows - 1.0)
    for j in range(int(least_j), int(most_j) + 1):
        for i in range(int(least_i), int(most_i) + 1):
            share = np.float32(min(max(radius + 0.5 - _away(i, j, ai, aj, bi, bj), 0.0), 1.0))
            if share > 0.0:
                for c in range(len(colour)):
                    behind = into[j, i, c]
                    into[j, i, c] = behind + share * colour[c] if adds else behind + share * (colour[c] - behind)


def hardware(machine: Machine, camera_id: int) -> tuple[Singles, Singles]:
    """Draw what travels with a camera: plates and rails (R, C, 3), reflectance, and laser glints (R, C)."""
    rows, columns = machine.size
    random = np.random.default_rng([machine.world.seed, 520 + camera_id])
    row, column = np.mgrid[0:rows, 0:columns]
    slope = random.normal(0.0, 0.1, 2)
    grey = 0.12 + slope[0] * (column / columns - 0.5) + slope[1] * (row / rows - 0.5)
    for _ in range(int(random.integers(0, 8))):
        angle, offset = random.uniform(0.0, np.pi), random.uniform(-0.5, 0.5) * columns
        across = np.cos(angle) * (column - columns / 2) + np.sin(angle) * (row - rows / 2) - offset
        grey = np.where(np.abs(across) < random.uniform(3.0, 40.0), random.uniform(0.02, 0.4), grey)
    plates = gaussian_blur(np.maximum(grey, 0.01), 2.0)[:, :, None] * random.uniform(0.9, 1.1, 3)
    glints = np.zeros((rows, columns))
    for _ in range(machine.world.room.head_glints):
        i, j = random.uniform([0.0, 0.0], [columns, rows])
        angle, long, short = random.uniform(0.0, np.pi), random.uniform(2.0, 25.0), random.uniform(0.6, 3.0)
        u = np.cos(angle) * (column - i) + np.sin(angle) * (row - j)
        v = -np.sin(angle) * (column - i) + np.cos(angle) * (row - j)
        glints += random.uniform(0.05, 1.0) * np.exp(-0.5 * ((u / long) ** 2 + (v / short) ** 2))
    return plates.astype(np.float32), glints.astype(np.float32)


class Copy(NamedTuple):
    """A copy of the stripe in a shiny thing."""

    mask: Singles
    """(R, C) strength, and where it is seen."""
    offset: tuple[int, int]
    """Rows and columns."""
    is_mirrored: bool


def copies(machine: Machine, camera_id: int) -> list[Copy]:
    """Draw the glints that move as the stripe does, and the mirrors that show it turned."""
    room, (rows, columns) = machine.world.room, machine.size
    random = np.random.default_rng([machine.world.seed, 580 + camera_id])
    row, column = np.mgrid[0:rows, 0:columns]
    made = []
    for is_mirrored, count in ((False, room.stripe_glints), (True, room.mirrors)):
        for _ in range(count):
            j, i = random.uniform([0.0, 0.0], [rows, columns])
            radius = random.uniform(0.1, 0.4) * rows
            inside = (row - j) ** 2 + (column - i) ** 2 < radius**2
            strength = random.uniform(0.1, 0.6) if is_mirrored else random.uniform(0.01, 0.1)
            offset = random.uniform(-0.3, 0.3, 2) * rows
            made.append(Copy((strength * inside).astype(np.float32), (int(offset[0]), int(offset[1])), is_mirrored))
    return made


def smudge(machine: Machine, camera_id: int) -> Singles | None:
    """Draw the share of light that smudges on a lens scatter, (R, C); None for a clean lens."""
    rows, columns = machine.size
    random = np.random.default_rng([machine.world.seed, 600 + camera_id])
    row, column = np.mgrid[0:rows, 0:columns]
    share = np.zeros((rows, columns))
    for _ in range(machine.world.cameras.smudges):
        j, i = random.uniform([0.0, 0.0], [rows, columns])
        radius = random.uniform(0.05, 0.25) * rows
        share += random.uniform(0.1, 0.5) * np.exp(-0.5 * ((row - j) ** 2 + (column - i) ** 2) / radius**2)
    return np.minimum(share, 0.8).astype(np.float32) if share.any() else None


class Mark(NamedTuple):
    """A mark on the plate's upper face: a rod between two points, plate frame."""

    ends: Floats
    """(2, 3) mm"""
    radius_mm: float
    opacity: float
    """Share of the light from above that it takes away."""


def glass_marks(machine: Machine) -> list[Mark]:
    """Draw dust, scratches, fingerprints and wet spots of the plate; they stand still while heads travel."""
    glass = machine.world.glass
    random = np.random.default_rng([machine.world.seed, 620])
    kinds = [
        (glass.dust, (0.1, 0.6), 0.0, (0.2, 0.9)),
        (glass.scratches, (0.05, 0.2), 60.0, (0.1, 0.5)),
        (glass.fingerprints, (5.0, 9.0), 4.0, (0.02, 0.15)),
        (glass.wet_spots, (3.0, 20.0), 5.0, (0.05, 0.3)),
    ]
    marks = []
    for count, radii, length, opacities in kinds:
        for _ in range(count):
            start = np.array([random.uniform(0.0, TRAVEL_MM), random.uniform(-70.0, 70.0), 0.0])
            angle = random.uniform(0.0, np.pi)
            end = start + length * np.array([np.cos(angle), np.sin(angle), 0.0])
            marks.append(Mark(np.array([start, end]), random.uniform(*radii), random.uniform(*opacities)))
    return marks


def draw_marks(marks: list[Mark], camera: Camera, light: Singles) -> None:
    """Take away the light that marks of the plate keep from a `camera` below it, plate frame."""
    for mark in marks:
        pixels = camera.project(mark.ends)
        if np.isfinite(pixels).all():
            distance = float(np.linalg.norm(mark.ends[0] - camera.position))
            radius_px = max(mark.radius_mm * camera.lens.focal_px / distance, 0.5)
            dim_rod(pixels, radius_px, np.float32(mark.opacity), light)


@compiled
def dim_rod(pixels: Floats, radius: float, opacity: np.float32, light: Singles) -> None:
    """Take a share of the light (R, C, 3) away where a rod between two `pixels` (2, 2) is."""
    rows, columns = light.shape[0], light.shape[1]
    ai, aj, bi, bj = pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1]
    least_i, most_i = max(min(ai, bi) - radius - 1.0, 0.0), min(max(ai, bi) + radius + 1.0, columns - 1.0)
    least_j, most_j = max(min(aj, bj) - radius - 1.0, 0.0), min(max(aj, bj) + radius + 1.0, rows - 1.0)
    for j in range(int(least_j), int(most_j) + 1):
        for i in range(int(least_i), int(most_i) + 1):
            share = np.float32(min(max(radius + 0.5 - _away(i, j, ai, aj, bi, bj), 0.0), 1.0))
            for c in range(3):
                light[j, i, c] *= np.float32(1.0) - share * opacity


@compiled
def _away(i: float, j: float, ai: float, aj: float, bi: float, bj: float) -> float:
    """Distance of a pixel from the segment between two others."""
    wi, wj = bi - ai, bj - aj
    squared = wi * wi + wj * wj
    along = ((i - ai) * wi + (j - aj) * wj) / squared if squared > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    away: float = np.sqrt((i - ai - along * wi) ** 2 + (j - aj - along * wj) ** 2)
    return away

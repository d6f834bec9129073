"""The stripe points that a world's cameras give, without pictures: exact places, and the errors of real ones.

Geometry is exact: the section of the subject by the laser sheet at the moment of each row's exposure, lit by the lasers
and seen by the camera. The errors of a point follow from its light: noise of the sensor and speckle move it across
the stripe, and a point whose light drowns in the room or in noise is not found. Signal, noise and width are those of
physics (shot noise, subjective speckle, point spread), not those of any extraction.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.glass import directions_from_below, exits_above
from footscan.virtual.optics.laser_light import FAN_EDGE_DEGREES, FOCUS_MM, beams_of
from footscan.virtual.optics.scanner import FAN_DEGREES, WIDTH, Camera, Laser
from footscan.virtual.optics.scene import SKIN, Scene
from footscan.virtual.portable import cos_sin
from footscan.virtual.worlds.machine import Exposure, Machine, moved_camera, moved_laser
from footscan.virtual.worlds.section import Cut, CutMesh
from footscan.virtual.worlds.subject import Subject
from schemas.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

STRIPE_DTYPE = np.dtype(
    [("frame", "<i4"), ("i", "<f8"), ("j", "<f8"), ("width", "<f4"), ("peak", "<f4"), ("score", "<f4"),
     ("saturation", "<f4"), ("sigma", "<f4"), ("place", "<f4", 3)]
)  # fmt: skip
"""Columns of stripe points as `footscan extract` has them, two more of the pipeline, and the true `place`: mm, plate
frame, NaN for clutter."""

GRAZING = 0.05
"""Least cosine between sight and normal of a surface that counts as seen. Chosen by hand."""
READ_NOISE, SHOT_NOISE = 0.008, 0.02
"""Standard deviation of a webcam's pixel in the dark, and at its white, 1 being the white; of an 8-bit sensor."""
FAINTEST_SNR = 4.0
"""Ratio of a stripe's peak to the noise at which half of its points are found (A. Rose's criterion, 1948)."""
FAINTEST = 0.01
"""Smallest peak that 8 bits show, in units of the white."""
ONE_MOMENT_MM = 0.02
"""Travel within one exposure row by row up to which all rows count as one moment: less than noise. Chosen by hand."""
ROW_STEPS = 2
"""Steps to the row in which a point is seen, which depends on how far the head has moved until that row is exposed.
Each step divides the error by 70 or more."""
TATTOO_PLACE, TATTOO_SPREAD = np.array([200.0, 0.0, 60.0]), np.array([50.0, 25.0, 20.0])
"""Mean place of tattoos, mm, plate frame, and its standard deviation. Chosen by hand."""
TATTOO_MM = 18.0
LEAST_ROOM_LIGHT = 0.1
"""Share of the room's light that reaches a surface that faces down. Chosen by hand."""
TEXTURE_SD = 0.15
"""Relative standard deviation of the surface's albedo from place to place. Chosen by hand."""


class _Seen(NamedTuple):
    """Points of stripes in one frame of a camera, in their order."""

    pixels: Floats
    """(N, 2)"""
    light: Floats
    """(N,) peak of the stripe, 1 being the sensor's white."""
    width_mm: Floats
    """(N,) standard deviation of the stripe across X as the camera sees it."""
    room: Floats
    """(N,) light of the room there."""
    places: Floats
    """(N, 3) mm, plate frame."""


class _Lit(NamedTuple):
    """The lit part of a sheet's stripe on the subject."""

    cut: Cut
    light: Floats
    """(N,) relative to the sheet on a white surface that faces it at its focus."""
    texture: Floats
    """(N,) albedo relative to the mean."""


def world_stripes(machine: Machine, subject: Subject) -> dict[int, NDArray[np.void]]:
    """Return the stripe points of each camera, (N,) of `STRIPE_DTYPE`, by frame and along the stripe."""
    cut_mesh, scene = CutMesh(subject.mesh), Scene(subject.mesh, SKIN)
    parts: dict[int, list[NDArray[np.void]]] = {camera: [] for camera in machine.cameras}
    random = {camera: np.random.default_rng([machine.world.seed, 300 + camera]) for camera in machine.cameras}
    for frame in range(max(machine.frames(head) for head in range(3))):
        lit: dict[tuple[int, int], _Lit] = {}
        for camera in machine.cameras:
            if frame < machine.frames(machine.head_of[camera]):
                seen = _seen_in_frame(machine, camera, frame, cut_mesh, scene, lit)
                if len(seen.light):
                    parts[camera].append(_measured(seen, frame, machine.world, machine, random[camera]))
    stripes = {}
    for camera, frames in parts.items():
        points = np.concatenate([*frames, *_clutter(machine, camera, random[camera]), np.empty(0, STRIPE_DTYPE)])
        stripes[camera] = points[np.argsort(points["frame"], kind="stable")]
    return stripes


def _seen_in_frame(
    machine: Machine, camera_id: int, frame: int, cut_mesh: CutMesh, scene: Scene, lit: dict[tuple[int, int], _Lit]
) -> _Seen:
    """All stripes in one frame; rows that are exposed later see heads that have travelled on.

    `lit` keeps the stripes of each sheet and pass for the other cameras, where all rows are of one moment.
    """
    head = machine.head_of[camera_id]
    in_pass = machine.pass_number(head)
    own = machine.exposure(head, machine.seconds(frame))
    camera = moved_camera(machine.cameras[camera_id], own.middle)
    parts = []
    for other in machine.sheets_near(head, own.seconds):
        sheet = machine.sheet(other, own.seconds, in_pass)
        if max(np.abs(own.way).max(), np.abs(sheet.way).max()) > ONE_MOMENT_MM:
            cut = _cut_row_by_row(machine, camera, own.way, sheet, cut_mesh)
            stripe = _lit_stripe(machine, other, sheet, cut, scene)
        else:
            if (other, in_pass) not in lit:
                cut = cut_mesh.cut(*_distance(machine, sheet, cut_mesh))
                lit[other, in_pass] = _lit_stripe(machine, other, sheet, cut, scene)
            stripe = lit[other, in_pass]
        parts.append(_seen_by(machine, camera, own.way, stripe, scene))
    return _Seen(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _distance(machine: Machine, sheet: Exposure, cut_mesh: CutMesh) -> tuple[Floats, Ints]:
    """Distances (V,) in X, mm, of vertices from a sheet in the middle of its exposure, and the edges (E,) near it.

    The distance is set at the ends of these edges, and NaN elsewhere.
    """
    edges = cut_mesh.edges_within(*machine.sheet_reach(cut_mesh.corners, sheet))
    vertices, ends = cut_mesh.mesh.vertices, cut_mesh.ends(edges)
    distance = np.full(len(vertices), np.nan)
    distance[ends] = machine.sheet_distance(vertices[ends], sheet, _middle(ends))
    return distance, edges


def _cut_row_by_row(machine: Machine, camera: Camera, way: Floats, sheet: Exposure, cut_mesh: CutMesh) -> Cut:
    """Cut by a sheet as it stands when the row of each point is exposed."""
    distance, edges = _distance(machine, sheet, cut_mesh)
    near = cut_mesh.ends_near(distance, edges, float(np.abs(sheet.way).max()))
    vertices = cut_mesh.mesh.vertices[near]
    distance[near] = machine.sheet_distance(vertices, sheet, _row_share(camera, way, vertices, machine.size[0]))
    return cut_mesh.cut(distance, edges)


def _row_share(camera: Camera, way: Floats, points: Floats, rows: int) -> Floats:
    """Part of the exposure after which each of points (N, 3) is seen by a camera that stands at its middle pose."""
    share = _middle(points)
    if not way.any():
        return share
    for _ in range(ROW_STEPS):
        row = camera.project(points - (share - 0.5)[:, None] * way)[:, 1]
        share = np.clip(np.nan_to_num(row + 0.5, nan=0.5 * rows) / rows, 0.0, 1.0)
    return share


def _middle(points: Floats | Ints) -> Floats:
    return np.full(len(points), 0.5)


def _lit_stripe(machine: Machine, number: int, sheet: Exposure, cut: Cut, scene: Scene) -> _Lit:
    """The lit part of a sheet's stripe on the subject; the light is that of the middle of the exposure."""
    light = np.zeros(len(cut.points))
    for laser in machine.sheets[number].lasers:
        light += _irradiance(moved_laser(laser, sheet.middle), cut, scene)
    lit = light > 0.0
    cut = Cut(cut.points[lit], cut.normals[lit])
    return _Lit(cut, light[lit], vertex_albedo(cut.points, machine.world))


def _seen_by(machine: Machine, camera: Camera, way: Floats, lit: _Lit, scene: Scene) -> _Seen:
    """A stripe as a camera sees it, in the plate frame; from the first row to the last the camera moves by `way`."""
    world = machine.world
    moved = (_row_share(camera, way, lit.cut.points, machine.size[0]) - 0.5)[:, None] * way
    pixels, facing = _view(lit.cut, moved, camera, machine.size, scene)
    seen = facing > 0.0
    normals = lit.cut.normals[seen]
    brightness = world.subject.albedo * world.cameras.gain * lit.texture[seen]
    up = np.clip(0.5 + 0.5 * normals[:, 2], LEAST_ROOM_LIGHT, 1.0)
    slope = np.sqrt(1.0 - np.clip(normals[:, 0] ** 2, 0.0, 0.96))  # a surface that faces X is crossed at a slant
    width_mm = np.hypot(world.laser.sigma_mm, 0.3 * world.subject.scatter_mm) / slope
    peak = world.laser.power * lit.light[seen] * brightness
    return _Seen(pixels[seen], peak, width_mm, world.room.light * brightness * up, lit.cut.points[seen])


def _irradiance(laser: Laser, cut: Cut, scene: Scene) -> Floats:
    """Light of a laser on the surface, (N,), 1 being that of the sheet on a surface that faces it at its focus."""
    beams = beams_of(laser, cut.points)
    cosine = np.einsum("ij,ij->i", cut.normals, beams.towards)
    outer, inner = cos_sin(FAN_DEGREES / 2.0)[0], cos_sin(FAN_DEGREES / 2.0 - FAN_EDGE_DEGREES)[0]
    fan = np.clip((-beams.towards @ np.asarray(laser.axis) - outer) / (inner - outer), 0.0, 1.0)
    distance = np.linalg.norm(cut.points - np.asarray(laser.position), axis=1)
    light = np.maximum(cosine, 0.0) * fan * beams.transmitted * FOCUS_MM / distance
    lit = np.flatnonzero(light > 0.0)
    light[lit[scene.hidden(cut.points[lit], cut.normals[lit], beams.sources[lit])]] = 0.0
    return np.asarray(light)


def _view(cut: Cut, moved: Floats, camera: Camera, size: tuple[int, int], scene: Scene) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of points, and the cosine (N,) of the sight; 0 where the camera does not see the point.

    moved : (N, 3) mm, how far the camera is from its middle pose when the row of each point is exposed.
    """
    points = cut.points - moved
    if camera.below_glass:
        directions = directions_from_below(camera.position, points, thickness=camera.plate_mm)
        eyes, towards = exits_above(camera.position, directions, thickness=camera.plate_mm), -directions
    else:
        eyes = np.broadcast_to(camera.position, points.shape)
        towards = (eyes - points) / np.linalg.norm(eyes - points, axis=1, keepdims=True)
    pixels = camera.project(points)
    rows, columns = size
    facing = np.einsum("ij,ij->i", cut.normals, towards)
    inside = (pixels > -0.5).all(axis=1) & (pixels[:, 0] < columns - 0.5) & (pixels[:, 1] < rows - 0.5)
    seen = np.flatnonzero(inside & (facing > GRAZING))
    hidden = scene.hidden(cut.points[seen], cut.normals[seen], (eyes + moved)[seen])
    cosine = np.zeros(len(points))
    cosine[seen[~hidden]] = facing[seen[~hidden]]
    return pixels, cosine


def vertex_albedo(points: Floats, world: World) -> Floats:
    """Albedo (N,) at `points` (N, 3), plate frame, relative to its mean: a smooth field, tattoos, a sock's pattern."""
    random = np.random.default_rng([world.seed, 310])
    waves = random.normal(0.0, 2.0 * np.pi / 25.0, (8, 3))
    phases = random.uniform(0.0, 2.0 * np.pi, 8)
    field = np.cos(points @ waves.T + phases).sum(axis=1) / 2.0
    factor = np.maximum(1.0 + TEXTURE_SD * field, 0.2)
    if world.subject.covering == "patterned sock":
        factor = factor * np.where(np.sin(points[:, 0] * 0.6) > 0.0, 1.6, 0.3)
    for _ in range(world.subject.tattoos):
        centre = TATTOO_PLACE + random.normal(0.0, 1.0, 3) * TATTOO_SPREAD
        factor = np.where(np.linalg.norm(points - centre, axis=1) < TATTOO_MM, 0.25 * factor, factor)
    return np.asarray(factor)


def _measured(seen: _Seen, frame: int, world: World, machine: Machine, random: np.random.Generator) -> NDArray[np.void]:
    """The points of one frame that are found, with the errors of their centres."""
    cameras = world.cameras
    middle = np.array([machine.size[1] / 2.0, machine.size[0] / 2.0])
    scale = machine.size[1] / WIDTH
    px_per_mm = 3.8 * scale
    off_focus = np.minimum(np.linalg.norm(seen.pixels - middle, axis=1) / (60.0 * px_per_mm), 1.0)
    blur = np.hypot(cameras.blur_px * scale, cameras.defocus_px * scale * off_focus)
    width_px = np.hypot(seen.width_mm * 0.67 * px_per_mm, blur)  # sin 42 degrees: sheet and sight
    peak = seen.light * seen.width_mm * 0.67 * px_per_mm / width_px  # blur spreads the light
    clipped = np.minimum(peak + seen.room, 1.0)
    contrast = np.maximum(clipped - np.minimum(seen.room, 1.0), 0.0)
    noise = cameras.noise * np.sqrt(READ_NOISE**2 * cameras.gain + SHOT_NOISE**2 * clipped)
    snr = contrast / noise
    found = (contrast > FAINTEST) & (random.normal(size=len(snr)) < 2.0 * (snr - FAINTEST_SNR))
    # Centre of a Gaussian in white noise, and of a line of speckle grains a pixel wide.
    of_noise = np.sqrt(width_px) * 1.2 / np.maximum(snr, 1.0)
    of_speckle = 0.4 * world.laser.speckle * np.sqrt(width_px)
    sigma = np.hypot(of_noise, of_speckle)
    across = _across(seen.pixels)
    moved = seen.pixels + across * (sigma * random.normal(size=len(sigma)))[:, None]
    points = np.zeros(len(sigma), STRIPE_DTYPE)
    points["frame"], points["i"], points["j"] = frame, moved[:, 0], moved[:, 1]
    points["place"] = seen.places
    saturation = np.clip((peak + seen.room - 1.0) / np.maximum(peak, 1e-9), 0.0, 1.0)
    points["width"] = 2.355 * width_px * (1.0 + saturation)
    points["peak"] = 255.0 * clipped
    points["score"] = contrast / (contrast + 0.05)
    points["saturation"] = saturation
    points["sigma"] = sigma * np.exp(random.normal(0.0, 0.2, len(sigma)))
    return np.asarray(points[found])


def _across(pixels: Floats) -> Floats:
    """Unit vectors (N, 2) across a line of points in their order."""
    along = np.gradient(pixels, axis=0) if len(pixels) > 1 else np.tile([1.0, 0.0], (len(pixels), 1))
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return np.column_stack([-along[:, 1], along[:, 0]])


def _clutter(machine: Machine, camera_id: int, random: np.random.Generator) -> list[NDArray[np.void]]:
    """Points that are no stripe of the subject: glints of three kinds, and things of the room that drift past."""
    world, rows, columns = machine.world, *machine.size
    head = machine.head_of[camera_id]
    frames = machine.frames(head)
    drift_px = 3.8 * columns / WIDTH * machine.step_mm(head) * 0.7  # a thing as far away as the foot
    pieces = []
    kinds = [("head", world.room.head_glints), ("stripe", world.room.stripe_glints), ("room", world.room.room_glints)]
    kinds += [("room", world.room.line_things + world.room.red_things)]
    for kind, count in kinds:
        for _ in range(count):
            start = random.uniform([0.0, 0.0], [columns, rows])
            angle, length = random.uniform(0.0, np.pi), random.uniform(4.0, 60.0)
            line = np.arange(length)[:, None] * np.array([np.cos(angle), np.sin(angle)])
            way = np.array([np.cos(way_angle := random.uniform(0.0, 2.0 * np.pi)), np.sin(way_angle)])
            speed = {"head": 0.0, "stripe": 0.5, "room": random.uniform(0.1, 1.0)}[kind] * drift_px
            first = int(random.integers(frames))
            shown = range(frames) if kind == "head" else range(first, min(first + int(random.integers(8, 60)), frames))
            strength = random.uniform(0.1, 1.0)
            for frame in shown:
                if random.random() < 0.3:  # flicker
                    continue
                pixels = start + line + way * speed * (frame - shown[0]) + random.normal(0.0, 0.2, line.shape)
                inside = (pixels > 0.0).all(axis=1) & (pixels < [columns - 1, rows - 1]).all(axis=1)
                points = np.zeros(int(inside.sum()), STRIPE_DTYPE)
                points["frame"], points["i"], points["j"] = frame, pixels[inside, 0], pixels[inside, 1]
                points["width"], points["peak"] = random.uniform(3.0, 12.0), 255.0 * strength
                points["score"], points["sigma"] = strength * 0.8, 0.3
                points["place"] = np.nan
                pieces.append(points)
    return pieces

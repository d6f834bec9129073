"""The scanner of a world: where its heads, lasers and cameras truly are at each moment, seen from the glass plate.

Frames: *head* (X = 0 is the nominal laser plane of a head, as in `optics.scanner`), *scanner* (X along the rails, Z = 0
the upper face of the plate when the scanner was calibrated) and *plate* (fixed to what stands on the glass; Z = 0 is
the plate's upper face now). Lengths in mm, times in s.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, Camera, Laser, standard_scanner
from footscan.virtual.worlds.draw import TRAVEL_MM
from footscan.virtual.worlds.rig import LEFT_HEAD, LOWER_HEAD, RIGHT_HEAD, cameras_of
from schemas.world import World, WorldHead, WorldSubject

Floats = NDArray[np.float64]

SECOND_LASER_MM = 70.0
"""Distance in Y from the middle of two lower lasers that light one plane: the thesis's Table 3-1 has four lasers in
all."""
HEAD_CENTRE = np.array([0.0, 0.0, 57.0])
"""Point of a head about which it is turned, head frame: the middle of the scan volume."""
PLATE_CENTRE = np.array([TRAVEL_MM / 2.0, 0.0, 0.0])
"""Point about which the plate is tilted, scanner frame."""
SEEN_HEADS_MM = 60.0
"""Stripes of other heads that are farther away are out of the picture."""
BEND_HALF_MM = 70.0
"""The sagitta of a bent sheet is measured over twice this length."""
ROUNDING_MM = 1e-6
"""What a place that is computed in two ways differs by, at most."""
BODY = WorldSubject(kind="cast", albedo=0.7, scatter_mm=0.1)
"""A body that stands still; its form is given apart."""
TREMOR_HZ, SWAY_HZ = (8.0, 12.0), (0.2, 0.8)
"""Physiological tremor (R. J. Elble, 1996) and postural sway; frequencies in between are rare."""


class Pose(NamedTuple):
    """A rigid transform: p -> `turn` p + `shift`."""

    turn: Floats
    """(3, 3)"""
    shift: Floats
    """(3,) mm"""

    def apply(self, points: Floats) -> Floats:
        """Move points (N, 3)."""
        return np.asarray(np.einsum("ij,nj->ni", self.turn, points) + self.shift)

    def undo(self, points: Floats) -> Floats:
        """Move points (N, 3) back."""
        return np.asarray(np.einsum("ji,nj->ni", self.turn, points - self.shift))


class Exposure(NamedTuple):
    """The exposure of one frame: from the first row to the last, a head moves from `pose` by `way`."""

    seconds: float
    """When the first row is exposed."""
    pose: Pose
    """Head frame to plate frame at that time."""
    way: Floats
    """(3,) mm, plate frame."""

    @property
    def middle(self) -> Pose:
        """The head when the middle row is exposed."""
        return Pose(self.pose.turn, self.pose.shift + 0.5 * self.way)


@dataclass(frozen=True)
class Sheet:
    """A plane of light of one head."""

    head: int
    lasers: tuple[Laser, ...]
    """Those that light it, in its frame: X = 0 is the plane."""
    ahead_mm: float = 0.0
    """X of the plane in the head's frame."""

    def pose(self, of_head: Pose) -> Pose:
        """The frame of the sheet, from that of its head."""
        return Pose(of_head.turn, of_head.shift + self.ahead_mm * of_head.turn[:, 0])


@dataclass(frozen=True)
class Machine:
    """The scanner of a world."""

    world: World
    cameras: dict[int, Camera]
    """The cameras of the world, head frame, as they stand during the scan."""
    calibrated: dict[int, Camera]
    """The same, as they stood when the scanner was calibrated."""
    head_of: dict[int, int]
    """The head of each camera, counted from 0."""
    sheets: tuple["Sheet", ...]
    """The sheets of light: those of heads 0, 1, 2 in their order, then second ones of a head."""
    size: tuple[int, int]
    """(rows, columns) of a picture."""
    jitter: Floats
    """(3, F) mm"""
    phases: Floats
    """(8,) of ripple, tremor and sway."""
    plate: Pose
    """Plate frame to scanner frame."""
    one_by_one: bool = False
    """The heads travel one after the other: no camera sees the laser of another head."""

    def step_mm(self, head: int) -> float:
        """Reported travel of a head from frame to frame."""
        return self.world.cameras.step_mm * self.world.heads[head].speed

    def frames(self, head: int) -> int:
        """Number of frames in which the head has travelled to the end."""
        return max(int(TRAVEL_MM / self.step_mm(head)), 1)

    def seconds(self, frame: float) -> float:
        """Time of a frame; all cameras film at the same rate."""
        return frame / self.world.cameras.frames_per_second

    def reported_x(self, head: int, seconds: float) -> float:
        """X that the travel says the head has."""
        return self.step_mm(head) * seconds * self.world.cameras.frames_per_second

    def pose(self, head: int, seconds: float, pass_number: int | None = None) -> Pose:
        """Head frame to plate frame at a time of a pass, by default that in which its cameras film."""
        to_scanner = self._head_pose(head, seconds)
        moved = self._subject_moved(pass_number or self.pass_number(head), seconds)
        turn = self.plate.turn.T @ to_scanner.turn
        return Pose(turn, self.plate.turn.T @ (to_scanner.shift - self.plate.shift) - moved)

    def exposure(self, head: int, seconds: float, pass_number: int | None = None) -> Exposure:
        """The exposure of the frame that begins at a time; parameters as of `pose`."""
        first = self.pose(head, seconds, pass_number)
        last = self.pose(head, seconds + self.world.cameras.rolling_shutter_ms / 1000.0, pass_number)
        return Exposure(seconds, first, last.shift - first.shift)

    def sheets_near(self, head: int, seconds: float) -> list[int]:
        """The sheets whose stripes the cameras of a head may see."""
        own = self.reported_x(head, seconds)
        near = [other for other in range(3) if abs(self.reported_x(other, seconds) - own) <= SEEN_HEADS_MM]
        heads = [head] if self.one_by_one else near
        return [number for number, sheet in enumerate(self.sheets) if sheet.head in heads]

    def sheet(self, number: int, seconds: float, pass_number: int) -> Exposure:
        """The exposure of the frame that begins at a time of a pass, for a sheet: that of its head, ahead of it."""
        sheet = self.sheets[number]
        exposure = self.exposure(sheet.head, seconds, pass_number)
        return exposure._replace(pose=sheet.pose(exposure.pose))

    def sheets_of(self, camera: int) -> list["Sheet"]:
        """The sheets of a camera's own head."""
        return [sheet for sheet in self.sheets if sheet.head == self.head_of[camera]]

    def pass_number(self, head: int) -> int:
        """The pass in which the cameras of a head film the subject."""
        subject = self.world.subject
        return 2 if head == LOWER_HEAD and (subject.wait_s or any(subject.shift_mm)) else 1

    def calibration_pose(self, head: int) -> Pose:
        """Head frame to scanner frame when the reference object was filmed, at X = 0 by the travel."""
        errors = self.world.heads[head]
        turn = _turn(errors.roll_deg, errors.pitch_deg, errors.yaw_deg)
        return Pose(turn, HEAD_CENTRE - turn @ HEAD_CENTRE + np.array([errors.offset_mm, 0.0, 0.0]))

    def sheet_distance(self, points: Floats, exposure: Exposure, share: Floats) -> Floats:
        """Signed distance in X, (N,), of points (N, 3) in the plate frame from the laser sheet of a head.

        share : (N,) part of the exposure's way that the head has moved.
        """
        bend = self.world.laser.bend_mm / BEND_HALF_MM**2
        pose, way = exposure.pose, exposure.way
        return np.asarray(_sheet_distance(points, np.asarray(share, np.float64), pose.turn, pose.shift, way, bend))

    def sheet_reach(self, corners: Floats, exposure: Exposure) -> tuple[float, float]:
        """Least and greatest X, mm, that a laser sheet has in a box while a frame is exposed.

        corners : (8, 3) mm, plate frame, of the box; its sides are parallel to the axes.
        """
        turn = exposure.pose.turn
        from_head = np.concatenate([corners, corners - exposure.way]) - exposure.pose.shift
        x, y = from_head @ turn[:, 0] / turn[0, 0], from_head @ turn[:, 1]
        flat = np.tile(corners[:, 0], 2) - x
        bent = abs(self.world.laser.bend_mm) * (np.abs(y).max() / BEND_HALF_MM) ** 2 / turn[0, 0]
        return float(flat.min() - bent - ROUNDING_MM), float(flat.max() + bent + ROUNDING_MM)

    def _head_pose(self, head: int, seconds: float) -> Pose:
        still = self.calibration_pose(head)
        return Pose(still.turn, still.shift + np.array([self._true_x(head, seconds), 0.0, 0.0]))

    def _true_x(self, head: int, seconds: float) -> float:
        errors: WorldHead = self.world.heads[head]
        x = self.reported_x(head, seconds)
        frame = min(max(round(seconds * self.world.cameras.frames_per_second), 0), self.jitter.shape[1] - 1)
        ripple = errors.ripple_mm * np.sin(2.0 * np.pi * x / errors.ripple_period_mm + self.phases[head])
        lost = errors.lost_mm if x > errors.lost_at * TRAVEL_MM else 0.0
        return float(x * (1.0 + errors.travel_scale) + ripple + self.jitter[head, frame] - lost)

    def _subject_moved(self, pass_number: int, seconds: float) -> Floats:
        """How far the subject has moved from its place, (3,), plate frame."""
        subject = self.world.subject
        if pass_number > 1:
            seconds += subject.wait_s
        tremor = subject.tremor_mm * np.sqrt(2.0) * np.sin(2.0 * np.pi * self.phases[5] * seconds + self.phases[3])
        sway = subject.sway_mm * np.sin(2.0 * np.pi * self.phases[6] * seconds + self.phases[4])
        angle = self.phases[7]
        shift = subject.shift_mm if pass_number > 1 else (0.0, 0.0)
        return np.array([tremor + sway * np.cos(angle) + shift[0], sway * np.sin(angle) + shift[1], 0.0])


def when_calibrated(machine: Machine) -> Machine:
    """The scanner as it was when it was calibrated, with heads that travel one after the other over a matt body."""
    return replace(
        machine,
        world=machine.world.model_copy(update={"subject": BODY}),
        cameras=machine.calibrated,
        plate=Pose(np.eye(3), np.zeros(3)),
        one_by_one=True,
    )


def machine_of(world: World) -> Machine:
    """Build the scanner of a world. Its mounting and its lenses follow from the world's seed."""
    placed = cameras_of(world)
    columns, rows = map(int, world.cameras.size.split("x"))
    thickness = world.glass.thickness_mm
    present = [camera for number, (camera, _) in placed.items() if number not in world.cameras.missing]
    calibrated = {camera.id: _resized(replace(camera, plate_mm=thickness), rows, columns) for camera in present}
    knocks = {knock.camera: knock for knock in world.cameras.knocked}
    cameras = dict(calibrated)
    for camera_id in knocks.keys() & calibrated.keys():
        knock, camera = knocks[camera_id], calibrated[camera_id]
        turn = _turn(*knock.turn_deg)
        cameras[camera_id] = replace(
            camera, position=camera.position + np.array(knock.mm), rotation=camera.rotation @ turn.T
        )
    left, right, below = (replace(laser, plate_mm=thickness) for laser in standard_scanner(world.seed).lasers)
    lower: tuple[Laser, ...] = (below,)
    second: tuple[Sheet, ...] = ()
    if world.laser.lower_lasers == 2 and world.laser.lower_apart_mm:
        second = (Sheet(LOWER_HEAD, (below,), world.laser.lower_apart_mm),)
    elif world.laser.lower_lasers == 2:
        lower = tuple(_aside(below, side * SECOND_LASER_MM) for side in (1.0, -1.0))
    first = (Sheet(LEFT_HEAD, (left,)), Sheet(RIGHT_HEAD, (right,)), Sheet(LOWER_HEAD, lower))
    head_of = {camera.id: placed[camera.id][1] for camera in present}
    random = np.random.default_rng([world.seed, 200])
    slowest = min(head.speed for head in world.heads)
    frames = int(TRAVEL_MM / (world.cameras.step_mm * slowest)) + 2
    jitter = np.array([random.normal(0.0, 1.0, frames) * head.jitter_mm for head in world.heads])
    phases = np.concatenate(
        [random.uniform(0.0, 2.0 * np.pi, 5), [random.uniform(*TREMOR_HZ), random.uniform(*SWAY_HZ)],
         random.uniform(0.0, 2.0 * np.pi, 1)]
    )  # fmt: skip
    tilt = _turn(world.glass.tilt_x_deg, world.glass.tilt_y_deg, 0.0)
    lift = PLATE_CENTRE - tilt @ PLATE_CENTRE + np.array([0.0, 0.0, world.glass.height_mm])
    return Machine(
        world, cameras, calibrated, head_of, first + second, (rows, columns), jitter, phases, Pose(tilt, lift)
    )


def moved_camera(camera: Camera, pose: Pose) -> Camera:
    """The camera in the frame that `pose` leads to."""
    return replace(
        camera, position=pose.apply(camera.position[None])[0], rotation=np.asarray(camera.rotation @ pose.turn.T)
    )


def moved_laser(laser: Laser, pose: Pose) -> Laser:
    """The laser in the frame that `pose` leads to."""
    x, y, z = pose.apply(np.array([laser.position]))[0]
    a, b, c = pose.turn @ np.array(laser.axis)
    return replace(laser, position=(float(x), float(y), float(z)), axis=(float(a), float(b), float(c)))


def _aside(laser: Laser, y_mm: float) -> Laser:
    """The laser at another Y, its fan towards the same point of the glass."""
    _, _, z = laser.position
    length = float(np.hypot(y_mm, z))
    return replace(laser, position=(0.0, y_mm, z), axis=(0.0, -y_mm / length, -z / length))


def _resized(camera: Camera, rows: int, columns: int) -> Camera:
    """The same view in a picture of another size: of the same breadth, cut at the top and the bottom."""
    scale = columns / WIDTH
    i, j = camera.lens.centre_px
    centre = (scale * (i + 0.5) - 0.5, scale * (j + 0.5 - HEIGHT / 2.0) + rows / 2.0 - 0.5)
    return replace(camera, lens=replace(camera.lens, focal_px=scale * camera.lens.focal_px, centre_px=centre))


@compiled
def _sheet_distance(points: Floats, share: Floats, turn: Floats, shift: Floats, way: Floats, bend: float) -> Floats:
    """Signed distance in X of points from the sheet of a head that moves by `share` of `way`."""
    distance = np.empty(len(points))
    for k in range(len(points)):
        x, y = 0.0, 0.0
        for d in range(3):
            from_head = points[k, d] - shift[d] - share[k] * way[d]
            x += from_head * turn[d, 0]
            y += from_head * turn[d, 1]
        distance[k] = x - bend * y * y
    return distance


def _turn(x_deg: float, y_deg: float, z_deg: float) -> Floats:
    """Rotation (3, 3) about X, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = (f(np.radians([x_deg, y_deg, z_deg])) for f in (np.cos, np.sin))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)

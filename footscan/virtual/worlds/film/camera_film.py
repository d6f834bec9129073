"""Films of one camera of a world: all light on its sensor, row by row as it is exposed, and the JPEG that it sends."""

from typing import NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from footscan.virtual.optics.glass import reflectance
from footscan.virtual.optics.laser_light import DIVERGENCE, FAN_EDGE_DEGREES, FOCUS_MM, beams_of
from footscan.virtual.optics.scanner import FAN_DEGREES, WIDTH, Camera
from footscan.virtual.optics.scene import SKIN, Scene
from footscan.virtual.optics.sensor import CODES, develop, expose_mosaic
from footscan.virtual.portable import cos_sin, gaussian_blur, gaussian_kernel
from footscan.virtual.worlds.draw import TRAVEL_MM
from footscan.virtual.worlds.film.details import draw_hairs, hairs_of, highlight, lit_hairs, sparkle, visible
from footscan.virtual.worlds.film.pixels import (
    add_light,
    blurred,
    enlarged,
    interpolated,
    mix,
    put_object,
)
from footscan.virtual.worlds.film.raster import NOTHING, Projected, Raster, project, rasterise
from footscan.virtual.worlds.film.scenery import (
    copies,
    draw_marks,
    draw_things,
    glass_marks,
    hardware,
    smudge,
    things_of,
)
from footscan.virtual.worlds.machine import Exposure, Machine, Pose, moved_camera, moved_laser
from footscan.virtual.worlds.stripes import vertex_albedo
from footscan.virtual.worlds.subject import Subject

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]

LASER_COLOURS = {"red": (1.0, 0.12, 0.09), "green": (0.10, 1.0, 0.14), "blue": (0.06, 0.20, 1.0)}
"""Responses of red, green and blue pixels to lasers of 650, 520 and 450 nm, with the leaks of their filters. Chosen by
hand after data sheets of webcam sensors."""
SKIN_COLOUR = (1.0, 0.68, 0.52)
"""Albedo of skin for red, green and blue light, relative to red."""
LAMPS = (0.28, 0.18, 0.54)
"""Room light on a surface: from all sides, from above, from the lamps. Chosen by hand."""
SEEN_MM = 140.0
"""Distance in X from the laser plane beyond which no camera of a head sees anything of a subject on the glass."""
REACH_SIGMAS = 4.6
"""Half width of a sheet in standard deviations."""
FAINTEST_REFLECTED = 0.02
"""Light of which no reflection is drawn, 1 being white."""
GLOW_BLOCK = 4
"""Light scattered below the skin is computed for blocks of 4 x 4 pixels: a bound of time."""
GLOW_SHARE = 0.2
"""Share of the laser's light that skin scatters sideways. Chosen by hand."""
GLINT_SHARE = 0.05
"""Light of a glint as a share of the laser's power. Chosen by hand."""
PX_PER_MM = 3.8
"""Scale in the middle of a picture of 640 columns."""
FOCUS_DEPTH_MM = 60.0
"""Distance from the middle of the picture at which the lens is out of focus by its whole `defocus_px`."""
NOISE_POOL = 1_000_000
"""Each frame begins its noise elsewhere in a pool of so many numbers: to draw new ones takes 3 ms. A bound of time."""
LEAST_DEFOCUS_PX = 0.2
"""Defocus that no picture shows."""
AUTO_MEAN = 0.22
"""Mean brightness that automatic exposure aims at, 1 being white. Chosen by hand."""
AUTO_RANGE = (0.25, 4.0)
"""Range of automatic exposure and of the gains of automatic white balance."""


class _Pixels(NamedTuple):
    """The pixels that show the subject."""

    flat: Ints
    """(K,) indices in a flattened picture."""
    points: Floats
    """(K, 3) mm, plate frame."""
    normals: Floats
    """(K, 3) unit."""
    albedo: Floats
    """(K,) relative to the mean."""


class CameraFilm:
    """One camera of a world, ready to film; equal worlds give equal bytes."""

    def __init__(self, machine: Machine, subject: Subject, camera_id: int, scene: Scene | None = None) -> None:
        self._machine, self._subject, self._id = machine, subject, camera_id
        self._camera = machine.cameras[camera_id]
        self._pass = machine.pass_number(machine.head_of[camera_id])
        self._scene = scene or Scene(subject.mesh, SKIN)
        mesh = subject.mesh
        corners = mesh.vertices[mesh.faces]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(mesh.vertices)
        for corner in range(3):
            np.add.at(normals, mesh.faces[:, corner], crossed)
        self._normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        self._albedo = vertex_albedo(mesh.vertices, machine.world)
        plates, self._glints = hardware(machine, camera_id)
        self._things = things_of(machine, camera_id, TRAVEL_MM)
        self._copies, self._smudge = copies(machine, camera_id), smudge(machine, camera_id)
        self._marks = glass_marks(machine)
        self._hairs, self._centres = hairs_of(mesh, self._normals, machine.world), corners.mean(axis=1)
        world = machine.world
        relative = np.array(
            SKIN_COLOUR if world.subject.covering == "none" and world.subject.kind == "foot" else (1.0,) * 3
        )
        warmth = np.array([1.0 + world.room.warmth, 1.0, 1.0 - world.room.warmth])
        self._room_colour = (world.room.light * warmth).astype(np.float32)
        self._behind = plates * self._room_colour
        self._object_colour = (world.subject.albedo * relative * self._room_colour).astype(np.float32)
        self._laser_colour = np.array(LASER_COLOURS[world.laser.colour], np.float32)
        self._defocused = _defocused(*machine.size)
        pool = np.random.default_rng([world.seed, 660 + camera_id])
        self._normal = pool.standard_normal(NOISE_POOL + np.prod(machine.size), dtype=np.float32)
        lamp = np.random.default_rng([world.seed, 540]).normal(0.0, 1.0, 3)
        lamp[2] = abs(lamp[2]) + 0.5
        self._lamp = lamp / np.sqrt((lamp**2).sum())

    def jpeg(self, frame: int) -> bytes:
        """Returns the JPEG of a frame."""
        cameras = self._machine.world.cameras
        picture = self.picture(frame)
        return bytes(
            simplejpeg.encode_jpeg(
                picture, quality=cameras.jpeg_quality, colorspace="RGB", colorsubsampling=cameras.jpeg_chroma
            )
        )

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Returns the picture before compression, (rows, columns, 3) uint8 RGB."""
        world = self._machine.world
        random = np.random.default_rng([world.seed, 560 + self._id, frame])
        light = self.light(frame, random)
        scale = world.cameras.gain
        if world.cameras.auto_exposure:
            mean = float(np.minimum(light * np.float32(scale), 1.0).mean())
            scale *= float(np.clip(AUTO_MEAN / max(mean, 1e-6), *AUTO_RANGE))
        gains = np.full(3, scale, np.float32)
        if world.cameras.auto_white_balance:
            means = light.mean(axis=(0, 1)) + 1e-6
            gains *= np.clip(means[1] / means, *AUTO_RANGE).astype(np.float32)
        light *= gains
        rows, columns = self._machine.size
        first = int(random.integers(len(self._normal) - rows * columns))
        normal = self._normal[first : first + rows * columns].reshape(rows, columns)
        noise = np.float32(world.cameras.noise * np.sqrt(max(scale, 1.0)))
        linear = np.linspace(0.0, 1.0, CODES)
        tone = np.rint(255.0 * linear ** (1.0 / world.cameras.gamma)).astype(np.uint8)
        return np.asarray(develop(expose_mosaic(light, normal, noise), tone))

    def light(self, frame: int, random: np.random.Generator) -> Singles:
        """Light on the sensor at gain 1, (rows, columns, 3) float32, 1 being its white."""
        machine, world = self._machine, self._machine.world
        moment = machine.exposure(machine.head_of[self._id], machine.seconds(frame))
        camera = moved_camera(self._camera, moment.pose)
        raster = self._raster(camera, moment)
        pixels = self._pixels(raster)
        stripe = self._stripes(camera, moment, pixels)
        stripe += self._reflections(stripe, camera, pixels, raster)
        light = self._behind.copy()
        laser = world.laser.power * float(random.uniform(0.6, 1.2))
        draw_things(
            self._things, self._camera, moment.pose, machine.plate, moment.seconds,
            (world.room.light, laser * GLINT_SHARE), light,
        )  # fmt: skip
        add_light(light, self._glints, self._laser_colour * np.float32(laser * GLINT_SHARE))
        put_object(light, pixels.flat, pixels.normals, pixels.albedo, self._lamp, np.array(LAMPS), self._object_colour)
        glow = self._glow(stripe, raster.face != NOTHING)
        self._put_highlights(light, camera, pixels)
        add_light(light, self._speckled(stripe, random) + glow, self._laser_colour)
        self._put_details(light, camera, moment, raster)
        if self._smudge is not None:
            light *= (1.0 - self._smudge)[:, :, None]
            light += (self._smudge * np.float32(light.mean()))[:, :, None]
        self._flicker(light, moment)
        return self._unsharp(light)

    def _unsharp(self, light: Singles) -> Singles:
        """The picture as the lens shows it; towards its border things are out of focus."""
        cameras, scale = self._machine.world.cameras, self._machine.size[1] / WIDTH
        sharp = _blurred_by(light, scale * cameras.blur_px)
        if cameras.defocus_px < LEAST_DEFOCUS_PX:
            return sharp
        mix(sharp, _blurred_by(light, scale * float(np.hypot(cameras.blur_px, cameras.defocus_px))), self._defocused)
        return sharp

    def _put_highlights(self, light: Singles, camera: Camera, pixels: _Pixels) -> None:
        """Put the highlights of the room's lamp on nails."""
        world, nails = self._machine.world, self._subject.nails
        if world.subject.nail_gloss == 0.0 or not len(nails):
            return
        near = np.flatnonzero(pixels.points[:, 0] > nails[:, 0].min() - nails[:, 3].max())
        points = pixels.points[near]
        towards = np.broadcast_to(self._lamp, points.shape)
        shine = highlight(points, pixels.normals[near], towards, _towards(camera, points), nails)
        brightness = (world.subject.nail_gloss * shine).astype(np.float32)
        light.reshape(-1, 3)[pixels.flat[near]] += brightness[:, None] * self._room_colour

    def _put_details(self, light: Singles, camera: Camera, moment: Exposure, raster: Raster) -> None:
        """Put hairs and marks of the glass into the picture, and the laser's light on them."""
        machine = self._machine
        hairs = self._hairs[visible(self._hairs, camera, (raster, self._centres))]
        draw_hairs(hairs, camera, light)
        if camera.below_glass:
            draw_marks(self._marks, camera, light)
        caught = np.zeros((*machine.size, 1), np.float32)
        for number in machine.sheets_near(machine.head_of[self._id], moment.seconds):
            pose = machine.sheet(number, moment.seconds, self._pass).pose
            lit_hairs(hairs, pose, camera, machine.world.laser.power, caught)
            sparkle(self._marks, pose, camera, machine.world.laser.power, raster, caught)
        add_light(light, caught[:, :, 0], self._laser_colour)

    def _raster(self, camera: Camera, moment: Exposure) -> Raster:
        """Scan conversion of the subject; a vertex is seen when the row is exposed in which it lies then."""
        mesh, rows = self._subject.mesh, self._machine.size[0]
        near = np.flatnonzero(np.abs(mesh.vertices[:, 0] - moment.pose.shift[0]) < SEEN_MM)
        vertices = mesh.vertices[near]
        seen = project(vertices, camera)
        if moment.way.any():
            share = np.clip(np.nan_to_num(seen.pixels[:, 1]) / rows, 0.0, 1.0)
            seen = project(vertices - share[:, None] * moment.way, camera)
        projected = Projected(np.full((len(mesh.vertices), 2), np.nan), np.ones(len(mesh.vertices)))
        projected.pixels[near], projected.depth[near] = seen
        return rasterise(projected, mesh.faces, self._machine.size)

    def _pixels(self, raster: Raster) -> _Pixels:
        index = np.flatnonzero(raster.face.ravel() != NOTHING)
        face, shares = raster.face.ravel()[index], raster.shares.reshape(-1, 2)[index]
        mesh = self._subject.mesh
        return _Pixels(index, *interpolated(face, shares, mesh.faces, mesh.vertices, self._normals, self._albedo))

    def _stripes(self, camera: Camera, moment: Exposure, pixels: _Pixels) -> Floats:
        """Laser light of all heads that each pixel receives, (rows, columns)."""
        machine, world = self._machine, self._machine.world
        rows, columns = machine.size
        picture = np.zeros(rows * columns)
        row_share = (pixels.flat // columns) / rows
        reach = REACH_SIGMAS * float(np.hypot(world.laser.sigma_mm, 0.3)) + 1.0
        for number in machine.sheets_near(machine.head_of[self._id], moment.seconds):
            sheet = machine.sheet(number, moment.seconds, self._pass)
            distance = machine.sheet_distance(pixels.points, sheet, row_share)
            near = np.flatnonzero(np.abs(distance) < reach)
            if len(near):
                moved = sheet.way * row_share[near, None]
                light = self._sheet_light(number, sheet.pose, moved, pixels, near, distance[near], camera)
                picture[pixels.flat[near]] += light
        return picture.reshape(rows, columns)

    def _sheet_light(
        self, number: int, pose: Pose, moved: Floats, pixels: _Pixels, near: Ints, distance: Floats, camera: Camera
    ) -> Floats:
        """Light of a sheet's lasers on the pixels `near` its sheet, at `distance` (N,) mm from its middle."""
        world = self._machine.world
        points, normals = pixels.points[near] - moved, pixels.normals[near]
        sight = _towards(camera, points)
        footprint = 1.0 / (PX_PER_MM * np.clip(np.einsum("ij,ij->i", normals, sight), 0.1, 1.0))
        total = np.zeros(len(near))
        for laser in self._machine.sheets[number].lasers:
            moved_one = moved_laser(laser, pose)
            beams = beams_of(moved_one, points)
            cosine = np.maximum(np.einsum("ij,ij->i", normals, beams.towards), 0.0)
            outer, inner = cos_sin(FAN_DEGREES / 2.0)[0], cos_sin(FAN_DEGREES / 2.0 - FAN_EDGE_DEGREES)[0]
            fan = np.clip((-beams.towards @ np.asarray(moved_one.axis) - outer) / (inner - outer), 0.0, 1.0)
            away = np.linalg.norm(points - np.asarray(moved_one.position), axis=1)
            variance = world.laser.sigma_mm**2 + (DIVERGENCE * (away - FOCUS_MM)) ** 2 + footprint**2 / 12.0
            profile = np.exp(-0.5 * distance**2 / variance) * world.laser.sigma_mm / np.sqrt(variance)
            light = profile * fan * beams.transmitted * FOCUS_MM / away
            light *= cosine * world.subject.albedo * pixels.albedo[near] + world.subject.nail_gloss * highlight(
                points, normals, beams.towards, sight, self._subject.nails
            )
            lit = np.flatnonzero(light * world.laser.power > 1e-4)
            hidden = self._scene.hidden(points[lit] + moved[lit], normals[lit], beams.sources[lit] + moved[lit])
            total[lit[~hidden]] += light[lit[~hidden]]
        return total * world.laser.power

    def _reflections(self, stripe: Floats, camera: Camera, pixels: _Pixels, raster: Raster) -> Floats:
        """The stripe in the glass and in shiny things, (rows, columns).

        A camera below sees it again by light that was reflected at both faces of the plate; one above sees its mirror
        image beside the subject. Glints that move as the stripe does are faint copies of it, mirrors turned ones.
        """
        rows, columns = stripe.shape
        picture = np.zeros(rows * columns)
        light = stripe.ravel()[pixels.flat]
        lit = np.flatnonzero(light > FAINTEST_REFLECTED)
        points, light = pixels.points[lit], light[lit]
        if camera.below_glass:
            places, strength = camera.project(points, passes=3), np.full(len(points), self._machine.world.glass.ghost)
        else:
            image = points * np.array([1.0, 1.0, -1.0])
            sight = image - camera.position
            places = camera.project(image)
            strength = reflectance(np.abs(sight[:, 2]) / np.linalg.norm(sight, axis=1))
        i, j = np.rint(np.nan_to_num(places, nan=-1.0)).astype(np.int64).T
        inside = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
        place = (j * columns + i)[inside]
        if not camera.below_glass:
            inside[inside] = raster.face.ravel()[place] == NOTHING
            place = (j * columns + i)[inside]
        np.add.at(picture, place, (light * strength)[inside])
        reflected = picture.reshape(rows, columns)
        for copy in self._copies:
            turned = stripe[:, ::-1] if copy.is_mirrored else stripe
            reflected += copy.mask * np.roll(turned, copy.offset, axis=(0, 1))
        return reflected

    def _glow(self, stripe: Floats, is_object: NDArray[np.bool_]) -> Singles:
        """Laser light that was scattered below the surface, (rows, columns), on the subject alone."""
        rows, columns = stripe.shape
        reach = self._machine.world.subject.scatter_mm * PX_PER_MM * columns / WIDTH / GLOW_BLOCK
        blocks = stripe.reshape(rows // GLOW_BLOCK, GLOW_BLOCK, columns // GLOW_BLOCK, GLOW_BLOCK).mean(axis=(1, 3))
        wide = gaussian_blur(blocks.astype(np.float32), reach + 0.3, truncate=3.0)
        return np.asarray(GLOW_SHARE * enlarged(wide, GLOW_BLOCK) * is_object, dtype=np.float32)

    def _speckled(self, stripe: Floats, random: np.random.Generator) -> Singles:
        speckle = self._machine.world.laser.speckle
        rows, columns = np.nonzero(stripe)
        line = stripe.astype(np.float32)
        if len(rows) and speckle > 0.0:
            grain = np.maximum(1.0 + 1.6 * speckle * random.standard_normal(len(rows), dtype=np.float32), 0.0)
            line[rows, columns] *= grain
        return line

    def _flicker(self, light: Singles, moment: Exposure) -> None:
        """Lamps at the mains: rows that are exposed at other times are brighter or darker."""
        room, cameras = self._machine.world.room, self._machine.world.cameras
        if room.flicker > 0.0:
            rows = light.shape[0]
            seconds = moment.seconds + np.arange(rows) / rows * cameras.rolling_shutter_ms / 1000.0
            light *= (1.0 + room.flicker * np.sin(4.0 * np.pi * room.mains_hz * seconds)).astype(np.float32)[
                :, None, None
            ]


def _towards(camera: Camera, points: Floats) -> Floats:
    """Unit vectors (N, 3) from points to the camera."""
    sight = camera.position - points
    return np.asarray(sight / np.linalg.norm(sight, axis=1, keepdims=True))


def _blurred_by(light: Singles, sigma_px: float) -> Singles:
    return np.asarray(blurred(light, gaussian_kernel(sigma_px, int(3.0 * sigma_px + 1.0)).astype(np.float32)))


def _defocused(rows: int, columns: int) -> Singles:
    """Share of light that is out of focus, which grows towards the border of the picture."""
    row, column = np.ogrid[0:rows, 0:columns]
    reach_px = FOCUS_DEPTH_MM * PX_PER_MM * columns / WIDTH
    away = np.hypot(row - rows / 2.0, column - columns / 2.0) / reach_px
    return np.asarray(np.minimum(away, 1.0) ** 2, np.float32)

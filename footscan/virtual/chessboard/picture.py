"""A camera's picture of a chessboard, with the laser off or on."""

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.chessboard.printed_board import WHITE, PrintedBoard
from footscan.virtual.filming.render import laser_colour, stripe_on_sensor
from footscan.virtual.optics.laser_light import stripe_picture
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, VirtualScanner
from footscan.virtual.optics.scene import Scene, Surface
from footscan.virtual.optics.sensor import compress, photograph
from footscan.virtual.optics.views import camera_views
from footscan.virtual.portable import gaussian_blur
from footscan.virtual.room.room import LEVELS
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

PAPER = Surface(albedo=(1.0, 1.0, 1.0), laser_albedo=1.0, halo=0.0, unevenness=0.0)
"""Its reflectance is that of the board's places."""
BEHIND = 0.1
"""Brightness of what is behind the board, of that of a white surface. Chosen by hand."""
SAMPLES = 4
"""Rays along each side of a pixel."""


class BoardCameraman:
    """Takes pictures of boards with one camera; what is the same in all pictures is computed once."""

    def __init__(self, scanner: VirtualScanner, camera_id: int, settings: SimulationSettings) -> None:
        self.camera = scanner.camera(camera_id)
        self._lasers = scanner.lasers
        self._settings = settings
        self._view = camera_views(self.camera)[0]
        steps = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
        self._offsets = np.array([[i, j] for j in steps for i in steps])

    def jpeg(self, board: PrintedBoard, number: int, *, laser: bool) -> bytes:
        """The JPEG picture number `number` of the board in its pose, frame of the heads."""
        settings = self._settings
        random = np.random.default_rng([settings.seed, self.camera.id, number, int(laser), 7])
        level = LEVELS[settings.ambient]
        room = gaussian_blur(level * self._reflected(board), settings.blur_px, truncate=5.0)
        light = np.repeat(room[:, :, np.newaxis], 3, axis=2)
        if laser:
            stripe = stripe_picture(Scene(board.mesh, PAPER), 0.0, self._lasers, self._view, board, settings)
            light += stripe_on_sensor(stripe, settings, random)[:, :, np.newaxis] * laser_colour(settings)
        return compress(photograph(light.astype(np.float32), random, settings), settings)

    def _reflected(self, board: PrintedBoard) -> NDArray[np.float32]:
        """(rows, columns) share of the room's light that each pixel receives."""
        picture = BEHIND * WHITE * self._view.weights
        outline = self.camera.project(board.outline)
        low = np.clip(np.floor(outline.min(axis=0)).astype(int) - 2, 0, None)
        high = np.ceil(outline.max(axis=0)).astype(int) + 3
        rows, columns = np.mgrid[low[1] : min(high[1], HEIGHT), low[0] : min(high[0], WIDTH)]
        pixels = (rows * WIDTH + columns).ravel()
        origins, directions = self._view.at(pixels, self._offsets)
        normal = board.axes[2]
        distance = ((board.origin - origins) @ normal) / (directions @ normal)
        reflectance = board.at(origins + distance[:, np.newaxis] * directions)
        seen = np.where(reflectance > 0.0, reflectance, BEHIND * WHITE).reshape(len(self._offsets), -1).mean(axis=0)
        picture[pixels] = seen * self._view.weights[pixels]
        return picture.reshape(HEIGHT, WIDTH).astype(np.float32)

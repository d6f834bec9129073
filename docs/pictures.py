"""Draws docs/images/ from what `footscan demo` left; the same folder gives the same bytes.

.venv/bin/python docs/pictures.py [DEMO]
"""

import io
import sys
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.mesh.formats.files import read_mesh
from footscan.recordings.scans import read_scan
from footscan.report.calibration.figure import calibration_figure
from footscan.report.colours import distance_colours
from footscan.report.deviation import draw_colour_bar, write
from footscan.report.render import render_mesh
from footscan.stripe.film import extract_film
from footscan.stripe.points import StripePoints
from footscan.verify.distances import signed_distances
from footscan.virtual.optics.scanner import FAN_DEGREES, VOLUME_MM, standard_scanner
from schemas.calibration import read_calibration
from schemas.parameters.extraction import ExtractionParameters
from schemas.scan import Travel

IMAGES = Path(__file__).resolve().parent / "images"
LIMIT_MM = 0.5
"""Where the colours of distances end."""
SHOWN = 0.62
"""Where along the foot the frames are taken."""
SKIN = (224, 178, 150)
ABOVE = np.array([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]])
MEDIAL = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
BELOW = np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]])
"""Rows: the axes of the scanner to the right, up, and towards the viewer."""
Bytes = NDArray[np.uint8]


def main() -> None:
    demo = Path(sys.argv[1] if len(sys.argv) > 1 else "demo")
    scan = next((demo / "archive").glob("*/*/scan.yaml")).parent
    results = demo / "results" / scan.parent.name / scan.name
    IMAGES.mkdir(exist_ok=True)
    _draw_result(results / "foot.stl", scan).save(IMAGES / "foot.png", optimize=True)
    _draw_virtual_foot(scan / "truth.stl").save(IMAGES / "virtual_foot.png", optimize=True)
    for name, camera in (("upper_camera", 1), ("lower_camera", 6)):
        frame, _ = _frame_at(scan / f"cam{camera}.avi", SHOWN, scan)
        _few_colours(Image.fromarray(frame).resize((480, 360), Image.Resampling.LANCZOS)).save(
            IMAGES / f"{name}.png", optimize=True
        )
    _draw_geometry(IMAGES / "geometry.png")
    calibration = calibration_figure(read_calibration(demo / "calibration.json"))
    _few_colours(Image.open(io.BytesIO(calibration)).convert("RGB")).save(IMAGES / "calibration.png", optimize=True)


def _draw_result(mesh: Path, scan: Path) -> Image.Image:
    """The measured foot from above and from its inner side, coloured by its distance to the truth, and one frame."""
    vertices, faces = read_mesh(mesh)
    colours = distance_colours(signed_distances(vertices, read_mesh(scan / "truth.stl")), LIMIT_MM)
    above, side = (_view(vertices, faces, colours, axes, 1.55) for axes in (ABOVE, MEDIAL))
    frame, points = _frame_at(scan / "cam1.avi", SHOWN, scan)
    sheet = Image.new("RGB", (940, 424), "white")
    sheet.paste(above, (20, 34), above)
    sheet.paste(side, (20, 34 + above.height + 16), side)
    left = 40 + max(above.width, side.width)
    width = sheet.width - 16 - left
    film = _with_points(frame, points).resize((width, width * 3 // 4), Image.Resampling.LANCZOS)
    sheet.paste(film, (left, 34))
    pen = ImageDraw.Draw(sheet)
    write(pen, (20, 10), "The reconstructed foot, distance to the true one")
    write(pen, (left, 10), "One frame of camera 1, stripe points in green")
    draw_colour_bar(pen, (140, 392), 180, LIMIT_MM, signed=True)
    return sheet


def _draw_virtual_foot(mesh: Path) -> Image.Image:
    vertices, faces = read_mesh(mesh)
    colours = np.full((len(vertices), 3), SKIN, np.uint8)
    views = [_view(vertices, faces, colours, axes, 1.2) for axes in (ABOVE, MEDIAL, BELOW)]
    height = max(view.height for view in views)
    sheet = Image.new("RGB", (sum(view.width + 16 for view in views) + 16, height + 24), "white")
    left = 16
    for view in views:
        sheet.paste(view, (left, 12 + height - view.height), view)
        left += view.width + 16
    return _few_colours(sheet)


def _view(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], colours: Bytes, axes: NDArray[np.float64], scale: float
) -> Image.Image:
    """The mesh seen along an axis, `scale` px a mm, on a transparent ground."""
    seen = vertices @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    seen = seen - [low[0], high[1], 0]
    columns, rows = (int(np.ceil(size * scale)) for size in (high - low)[:2])
    return Image.fromarray(render_mesh(seen, faces, colours, (rows, columns), scale))


def _frame_at(film: Path, share: float, scan: Path) -> tuple[Bytes, StripePoints]:
    """The frame with the laser plane at a share of the foot's length from the heel, and its stripe points."""
    along = read_mesh(scan / "truth.stl")[0][:, 0]
    travel = read_scan(scan).document.travel or Travel(start_mm=0, step_mm=2)
    number = round((along.min() + share * np.ptp(along) - travel.start_mm) / travel.step_mm)
    opened = open_film(film)
    points = extract_film(pixel_frames(opened), ExtractionParameters())
    frames = (None if frame is None else frame.copy() for frame in islice(pixel_frames(opened), number, None))
    return next(frame for frame in frames if frame is not None), points[points["frame"] == number]


def _with_points(frame: Bytes, points: StripePoints) -> Image.Image:
    """The frame, twice as large, with every sixth of its points."""
    picture = Image.fromarray(frame).resize((2 * frame.shape[1], 2 * frame.shape[0]), Image.Resampling.BICUBIC)
    pen = ImageDraw.Draw(picture)
    for i, j in zip(2 * points["i"][::6] + 0.5, 2 * points["j"][::6] + 0.5, strict=True):
        pen.ellipse((i - 3, j - 3, i + 3, j + 3), fill=(60, 255, 90))
    return picture


def _few_colours(picture: Image.Image) -> Image.Image:
    """A palette makes a noisy PNG half as large."""
    return picture.quantize(256, dither=Image.Dither.NONE)


def _draw_geometry(path: Path) -> None:
    """Lasers, cameras and scan volume along the travel, and from above."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon, Rectangle

    scanner = standard_scanner()
    figure = Figure(figsize=(9, 4.2), layout="constrained")
    along, above = figure.subplots(1, 2)
    (y_low, y_high), (z_low, z_high) = VOLUME_MM
    along.add_patch(Rectangle((y_low, z_low), y_high - y_low, z_high - z_low, fill=False, ls="--", ec="0.4"))
    along.axhspan(-6, 0, color="tab:cyan", alpha=0.4, label="glass, 6 mm")
    above.axvline(0, color="tab:red", lw=1, label="laser plane")
    for laser in scanner.lasers:
        along.plot(*laser.position[1:], "s", color="tab:red")
        y, z = laser.axis[1:]
        turns = np.deg2rad([-FAN_DEGREES / 2, FAN_DEGREES / 2])
        edges = 300 * np.column_stack([np.cos(turns) * y - np.sin(turns) * z, np.sin(turns) * y + np.cos(turns) * z])
        fan = np.vstack([laser.position[1:], edges + laser.position[1:]])
        along.add_patch(Polygon(fan, color="tab:red", alpha=0.12, lw=0))
    for camera in scanner.cameras:
        x, y, z = camera.position
        target = camera.position + camera.rotation[2] * 250
        odd = camera.id % 2 == 1
        colour = "tab:blue" if odd else "tab:green"
        shift = -14 if odd else 14
        along.plot([y, target[1]], [z, target[2]], color=colour, lw=0.5)
        along.plot(y, z, "o", color=colour)
        along.annotate(str(camera.id), (y, z), (shift, -4), textcoords="offset points", ha="center", color=colour)
        above.plot([x, target[0]], [y, target[1]], color=colour, lw=0.5)
        above.plot(x, y, "o", color=colour, mfc="white" if camera.below_glass else colour)
        above.annotate(str(camera.id), (x, y), (0, 8), textcoords="offset points", ha="center", color=colour)
    along.set(xlabel="Y, mm", ylabel="Z, mm", aspect="equal", title="Along the travel", xlim=(280, -280))
    above.set(
        xlabel="X from the laser plane, mm",
        ylabel="Y, mm",
        aspect="equal",
        title="From above; hollow: below the glass",
    )
    along.legend(loc="upper center", fontsize=7)
    above.legend(loc="upper center", fontsize=7)
    figure.savefig(path, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()

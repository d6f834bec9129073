"""Sound files of every kind that the command reads, and the argument lines that read them: what is damaged later."""

import json
import shutil
from pathlib import Path

import numpy as np

from footscan.frames.film import open_film
from footscan.frames.image import decode_image, encode_png
from footscan.mesh.formats.files import mesh_bytes
from footscan.mesh.mesh import Mesh
from footscan.thesis.printed import CHARTS_FILE
from pipelines.cli.main import run_command

SCAN = "archive/P0001/S1"
RUN = f"plan --scan {SCAN} --calibration calibration.json --out out"
READERS: dict[str, tuple[str, ...]] = {
    "solid.stl": ("measure solid.stl", "export solid.stl --out new.ply", "compare solid.stl solid.obj"),
    "solid.ply": ("measure solid.ply", "export solid.ply --out new.obj", "verify sphere solid.ply --diameter 50"),
    "text.ply": ("compare text.ply solid.obj", "export text.ply --out new.stl"),
    "solid.obj": ("measure solid.obj", "export solid.obj --out new.glb", "compare solid.obj solid.stl"),
    "frame.png": ("extract frame.png --out new.csv",),
    "frame.jpg": ("extract frame.jpg --out new.csv", "extract frame.jpg --background frame.png --json"),
    "chart.csv": ("calibrate chart chart.csv --model quadratic --json", "calibrate chart chart.csv --out new.json"),
    "pixels.csv": ("map calibration.json pixels.csv --camera 1", "map calibration.json pixels.csv --camera 5 --json"),
    "lasts.csv": ("lasts left.json --lasts lasts.csv",),
    "left.json": (
        *("sizes left.json", "pair left.json right.json", "change left.json left.json"),
        "lasts left.json --lasts lasts.csv",
    ),
    "right.json": ("pair left.json right.json --json", "sizes right.json --for women"),
    "calibration.json": ("calibrate show calibration.json", "map calibration.json pixels.csv --camera 1", RUN),
    "workflow.yaml": ("plan", "config check", "config show", "cache show", "why P0001/S1 measure"),
    f"{SCAN}/scan.yaml": (RUN, "plan", f"ingest {SCAN}"),
    f"{SCAN}/cam1.csv": (RUN, "plan"),
    f"{SCAN}/cam1.avi": (f"extract {SCAN}/cam1.avi --out new.csv", f"ingest {SCAN}", RUN),
    "sizes.yaml": ("sizes left.json --table sizes.yaml", "pair left.json right.json --table sizes.yaml"),
    f"{SCAN}/frames.zarr/cam1/zarr.json": (f"extract {SCAN}/frames.zarr/cam1 --out new.csv", f"ingest {SCAN}", RUN),
    f"{SCAN}/frames.zarr/cam1/c.0.0.0.0": (f"extract {SCAN}/frames.zarr/cam1 --out new.csv", f"ingest {SCAN}"),
    f"{SCAN}/frames.zarr/zarr.json": (f"ingest {SCAN}",),
}  # fmt: skip
"""File -> argument lines."""
DOCUMENTS = tuple(name for name in READERS if name.endswith((".json", ".yaml")))
TABLES = tuple(name for name in READERS if name.endswith(".csv"))


def make_sound_files(pristine: Path, folder: Path) -> None:
    """Copies the small archive and puts a file of every kind beside it."""
    shutil.copytree(pristine, folder)
    scan = folder / SCAN
    document = (scan / "scan.yaml").read_text()
    (scan / "scan.yaml").write_text(document.replace("file: cam1.avi", "file: cam1.avi, positions: cam1.csv"))
    (scan / "cam1.csv").write_text("frame,x_mm\n" + "".join(f"{k},{10 * k}\n" for k in range(20)))
    assert run_command(["ingest", str(scan)]) == 0
    corners = np.array([[x, y, z] for x in (0.0, 240.0) for y in (0.0, 90.0) for z in (0.0, 70.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], np.int32)
    faces = np.vstack([faces, [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]]).astype(np.int32)
    solid = Mesh(corners, faces)
    for suffix in (".stl", ".ply", ".obj"):
        (folder / f"solid{suffix}").write_bytes(mesh_bytes(solid, suffix))
    header = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, row)) for row in corners.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    (folder / "text.ply").write_text(header + "\n".join(rows) + "\n")
    frame = next(open_film(scan / "cam1.avi").stored())
    assert isinstance(frame, bytes)
    (folder / "frame.jpg").write_bytes(frame)
    (folder / "frame.png").write_bytes(encode_png(decode_image(frame)))
    thesis = CHARTS_FILE
    shutil.copyfile(thesis, folder / "chart.csv")
    shutil.copyfile(Path(__file__).parents[2] / "footscan" / "sizing" / "sizes.yaml", folder / "sizes.yaml")
    (folder / "pixels.csv").write_text("i,j\n" + "".join(f"{300 + k}.5,{200 + k}\n" for k in range(20)))
    (folder / "lasts.csv").write_text("last,length_mm,ball_girth_mm\nA,270,240\nB,265,235\n")
    for side in ("left", "right"):
        names = {"foot_length": 262.0, "foot_breadth": 98.0, "ball_girth": 243.0, "instep_girth": 250.0}
        measures = {name: {"value": value, "unit": "mm", "status": "ok"} for name, value in names.items()}
        document = json.dumps({"format": "footscan.measures/1", "unit": "mm", "side": side, "measures": measures})
        (folder / f"{side}.json").write_text(document)

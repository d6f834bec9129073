"""Measures of parametric feet in random poses against those known from construction; and how long measuring takes.

.venv/bin/python -m benchmarks.measures [FEET]
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.compare import interleave, print_ratios, python
from footscan.measure.measures import measure_foot
from footscan.mesh.mesh import Mesh
from footscan.surface.decimate import decimate
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.foot.shape import sample_pair
from schemas.base.errors import RefusedInput

FEET = 200
SHIFT_MM = 500.0
TRIANGLES = 40_000
Side = Literal["left", "right"]


class Drawn(NamedTuple):
    """A foot of the population as a mesh from elsewhere: in any pose."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    side: Side
    known: dict[str, float]


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else FEET
    with ProcessPoolExecutor() as pool:
        errors = list(pool.map(measure_errors, range(count)))
    print(f"{count} feet, half of them left, any pose, mesh of 1 mm: error against construction, mm (arch_index: 1)")
    print(f"  {'':<22}{'bias':>9}{'sd':>9}{'worst':>9}{'missing':>9}")
    for name in errors[0]:
        values = [error[name] for error in errors]
        taken = np.array([value for value in values if value is not None])
        worst = taken[np.argmax(np.abs(taken))]
        figures = "".join(f"{figure:9.3f}" for figure in (taken.mean(), taken.std(), worst))
        print(f"  {name:<22}{figures}{len(values) - len(taken):9d}")
    compare_times()


def draw(seed: int) -> Drawn:
    """A foot of the population, turned and shifted anyhow."""
    rng = np.random.default_rng([20, seed])
    side: Side = "left" if seed % 2 else "right"
    while True:
        left, right = sample_pair(rng, "male" if seed % 4 < 2 else "female")
        try:
            foot = make_foot(left if side == "left" else right, side=side, resolution_mm=1.0)
            break
        except RefusedInput:  # no foot has these measures together
            continue
    vertices = Rotation.random(rng=rng).apply(foot.vertices) + rng.uniform(-SHIFT_MM, SHIFT_MM, 3)
    return Drawn(vertices, foot.faces.astype(np.int64), side, foot.measures)


def measure_errors(seed: int) -> dict[str, float | None]:
    """Measured less known, by name; None where it could not be measured."""
    foot = draw(seed)
    found = measure_foot(foot.vertices, foot.faces, foot.side).measures
    pairs = ((name, found[name].value, known) for name, known in foot.known.items())
    return {name: None if value is None else value - known for name, value, known in pairs}


def compare_times() -> None:
    """Measuring a mesh as it is handed on, against the start of Open3D."""
    foot = draw(0)
    mesh = decimate(Mesh(foot.vertices, foot.faces.astype(np.int32)), TRIANGLES)
    runs = {
        "python -c 'import open3d'": lambda: python("-c", "import open3d"),
        f"measuring a mesh of {len(mesh.faces)} triangles": lambda: measure_foot(mesh.vertices, mesh.faces, foot.side),
    }
    print_ratios("Time", interleave(runs), 1, "foot")


if __name__ == "__main__":
    main()

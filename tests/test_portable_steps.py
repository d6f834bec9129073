"""Films, captures and stripes are the same to the byte on every x86-64: by what their code uses, and by trying it.

Processors cannot be exchanged in a test. What differs between them can be forbidden, and most of it can be switched
off: the instructions that NumPy, numba, OpenBLAS and the C library choose for the processor that they find.
"""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipelines.engine.actions.code import code_identity

ROOT = Path(__file__).resolve().parents[1]
STEPS = ("simulate_scan", "simulate_capture", "ingest", "ingest_background", "extract")
OLDER_PROCESSOR = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3",
    "OPENBLAS_CORETYPE": "Prescott",
    "NUMBA_CPU_NAME": "nehalem",
    "NUMBA_CPU_FEATURES": "",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
}

BY_PROCESSOR = {"open3d"}
"""Libraries whose results depend on the processor: Open3D by Embree."""
DISPATCHED = {
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
    "arctan2", "sinh", "cosh", "tanh", "power", "float_power", "cbrt", "hypot", "dot", "vdot", "inner", "matmul",
    "tensordot", "convolve", "correlate", "corrcoef", "cov", "polyfit", "lstsq",
}  # fmt: skip
"""NumPy's functions that take other instructions on other processors, with other last digits."""

ONLY_FOR_OTHERS = {"footscan.mesh.mesh", "footscan.mesh.formats.threemf"}
"""Modules that are reached by import, for meshes that are read from files; the angles and colours of meshes, which they
compute so, go into no film."""


def test_films_captures_and_stripes_use_what_is_the_same_everywhere() -> None:
    modules = sorted({module for step in STEPS for module in code_identity(f"pipelines.steps.{step}").modules})
    footscan = [module for module in modules if module.startswith("footscan.") and module not in ONLY_FOR_OTHERS]
    assert {"footscan.virtual.optics.laser_light", "footscan.stripe.ridge", "footscan.virtual.foot.form"} <= set(
        footscan
    )
    complaints = []
    for module in footscan:
        path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
        if path.exists():
            complaints += [f"{module}:{line}: {what}" for line, what in unportable(path.read_text(encoding="utf-8"))]
    assert complaints == []


@pytest.mark.parametrize(
    "source",
    [
        "import open3d as o3d",
        "def f(a):\n    import open3d.core\n    return a",
        "c = a @ b",
        "a @= b",
        "y = np.exp(x)",
        "y = np.linalg.solve(a, b)",
        "y = np.linalg.norm(a)",
        "order = np.argsort(a)",
        "order = a.argsort()",
        "y = np.einsum('ij,jk', a, b, optimize=True)",
        "x = a.dot(b)",
        "f = numba.njit(fastmath=True)(g)",
    ],
)
def test_what_differs_between_processors_is_seen(source: str) -> None:
    assert list(unportable(source))


@pytest.mark.parametrize(
    "source",
    [
        "y = np.linalg.norm(a, axis=1)",
        "order = np.argsort(a, kind='stable')",
        "@compiled\ndef f(x):\n    return np.exp(x)",
        "y = np.einsum('ij,ij->i', a, b)",
        "y = np.sqrt(x) + portable.exp(x)",
    ],
)
def test_what_is_the_same_everywhere_is_free(source: str) -> None:
    assert not list(unportable(source))


@pytest.mark.slow
def test_frames_and_stripes_are_those_of_an_older_processor() -> None:
    here, there = (
        subprocess.run(
            [sys.executable, "-c", FILM_AND_EXTRACT],
            env=os.environ | settings, cwd=ROOT, capture_output=True, text=True, check=True,
        ).stdout.splitlines()
        for settings in ({}, OLDER_PROCESSOR)
    )  # fmt: skip
    assert len(here) == 8
    assert here == there


def unportable(source: str) -> Iterator[tuple[int, str]]:
    """Line and name of each operation outside compiled functions whose result depends on the processor."""
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef) and any(ast.unparse(by) == "compiled" for by in node.decorator_list):
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [name.name for name in node.names]
            yield from ((node.lineno, name) for name in names if name.split(".")[0] in BY_PROCESSOR)
        elif isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            yield node.lineno, "@"
        elif isinstance(node, ast.Call):
            name, given = ast.unparse(node.func), {word.arg: ast.unparse(word.value) for word in node.keywords}
            last = name.rsplit(".", maxsplit=1)[-1]
            if (
                (name.startswith("np.") and last in DISPATCHED)
                or (name.startswith("np.linalg.") and not (last == "norm" and "axis" in given))
                or (last == "argsort" and given.get("kind") != "'stable'")
                or (last == "dot" and "." in name)
                or (last == "einsum" and given.get("optimize", "False") != "False")
                or given.get("fastmath", "False") != "False"
            ):
                yield node.lineno, name


FILM_AND_EXTRACT = """
import hashlib
import numpy as np, simplejpeg
from footscan.stripe.extract import extract_stripe
from footscan.virtual.filming.capture import prism
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.stage.reference import standard_reference
from footscan.virtual.filming.renderers import Shot, Studio
from footscan.virtual.optics.scene import MATT_GREY, SKIN, Mesh
from schemas.parameters.extraction import ExtractionParameters
from schemas.parameters.simulation import SimulationSettings

settings = SimulationSettings(ambient="bright")
foot = make_foot(resolution_mm=4.0)
reference = prism(np.asarray(standard_reference().profile_mm, float))
for mesh, surface in ((Mesh(foot.vertices, foot.faces.astype(np.int64)), SKIN), (reference, MATT_GREY)):
    studio = Studio([mesh], surface, settings)
    for camera in (1, 6):
        [picture] = studio.shoot(camera, [Shot(0, 0.0 if surface is MATT_GREY else 100.0, 0)])
        points = extract_stripe(simplejpeg.decode_jpeg(picture, colorspace="RGB"), ExtractionParameters())
        print(hashlib.sha256(picture).hexdigest())
        print(len(points) > 50, hashlib.sha256(points.tobytes()).hexdigest())
"""

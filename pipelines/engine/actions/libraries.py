"""Classes of libraries: the keys of steps cover those whose arithmetic can change a result."""

import importlib.metadata
from functools import cache

COMPUTING = frozenset(
    {
        "PIL",
        "av",
        "cv2",
        "llvmlite",
        "matplotlib",
        "numba",
        "numpy",
        "open3d",
        "optuna",
        "scipy",
        "simplejpeg",
        "skimage",
    }
)
"""Libraries that compute, decode or draw. Their versions are in the keys of the steps that reach them."""

CARRYING = frozenset(
    {
        "dask",
        "distributed",
        "fsspec",
        "google_crc32c",
        "h11",
        "numcodecs",
        "pyarrow",
        "pydantic",
        "pydantic_core",
        "rich",
        "serial",
        "starlette",
        "typer",
        "uvicorn",
        "yaml",
        "zarr",
    }
)
"""Libraries that carry values without changing them. Their versions are in no key."""

COMPANIONS = {"numba": ("llvmlite",)}
"""Libraries that compute for another library; the project need not import them itself."""

DISTRIBUTIONS = {
    "PIL": ("pillow",),
    "skimage": ("scikit-image",),
    "cv2": ("opencv-python-headless", "opencv-python"),
    "open3d": ("open3d-cpu", "open3d"),
}
"""Names of the distributions of a module, if they differ from its name."""


def versions_that_count(library: str) -> dict[str, str]:
    """Versions of an imported library and its companions; none of a library that only carries values.

    A library in neither class counts as well. Raises `ModuleNotFoundError` if a library that counts is not installed.
    """
    if library in CARRYING:
        return {}
    return {name: _version(name) for name in (library, *COMPANIONS.get(library, ()))}


@cache
def _version(module: str) -> str:
    for distribution in DISTRIBUTIONS.get(module, (module,)):
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    raise ModuleNotFoundError(module)

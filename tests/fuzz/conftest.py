"""What all cases begin from, made once: a clean chart and a clean capture. `damage_*` modules find each other here."""

import sys
from pathlib import Path

import pytest
from shared_folders import MadeOnce

from pipelines.cli.main import run_command

sys.path.insert(0, str(Path(__file__).parent))

CAMERAS = (1, 5)
"""One above and one below the glass: two are enough for all that can go wrong, and quick."""


@pytest.fixture(scope="session")
def filmed(films: MadeOnce) -> Path:
    """A capture of three placements by two cameras, and its chart of all eight. To be read only."""
    return films("capture-of-two-cameras", _film)


def _film(folder: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        for module in ("record", "capture"):
            patch.setattr(f"footscan.virtual.filming.{module}.CAMERAS", CAMERAS)
        arguments = ["simulate", "capture", "--out", str(folder), "--placements", "3", "--scanner-seed", "3"]
        assert run_command(arguments) == 0

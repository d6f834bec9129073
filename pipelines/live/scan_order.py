"""The order of a scan, and its outcome."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.live.light import ScanLight

if TYPE_CHECKING:  # heads that are only moved do not wait for Zarr, Dask and the reconstruction
    from pipelines.live.measuring import Measured
    from pipelines.live.storing import FilmedScan, ScanName


@dataclass(frozen=True)
class ScanOrder:
    """Order of a scan: its name, its folders and its options."""

    name: "ScanName"
    archive: Path
    results: Path | None = None
    """Folder of the results; None: the scan is stored, but not measured."""
    calibration: Path | None = None
    """Calibration file; default: that of the rig."""
    light: ScanLight | None = None
    """Light of the scan; default: measured with the cameras."""
    texture: bool = False
    """True to film the way back with the lasers off: frames all along the foot, for the colours of its skin."""
    keep_partial: bool = False
    """True to store a scan although films of some cameras are incomplete; these cameras are left out."""


@dataclass(frozen=True)
class LiveResult:
    """The outcome of a scan."""

    stored: "FilmedScan"
    measured: "Measured | None"

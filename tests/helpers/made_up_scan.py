"""The documents of a scan that was never made."""

from typing import Any

from schemas.base.model import Side
from schemas.recording import Recording

CAMERAS = tuple(range(1, 9))


def measures_of(side: Side, length_mm: float = 262.0) -> dict[str, object]:
    """The content of measures.json."""
    values = {"foot_length": length_mm, "foot_breadth": 98.5, "ball_length": 194.0, "ball_girth": 243.5}
    return {
        "format": "footscan.measures/1",
        "side": side,
        "axis": "toe2",
        "transform": [[1, 0, 0, -70], [0, -1 if side == "left" else 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        "measures": {
            name: {"value": value, "unit": "mm", "status": "ok", "definition": "of an egg"}
            for name, value in values.items()
        },
    }


def quality_of(*, blind: int | None = None, lost: int = 0, apart_mm: float = 0.05) -> dict[str, object]:
    """The content of quality.json; a camera may be blind, lose frames or stand askew."""
    apart = {"median_mm": 0.0, "deviation_mm": apart_mm, "rms_mm": apart_mm}
    return {
        "calibration": {"name": "calibration.json", "sha256": "0" * 64},
        "cameras": [
            {
                "camera": camera,
                "frames": 200,
                "frames_lost": lost if camera == 3 else 0,
                "frames_with_stripe": 180,
                "points": 0 if camera == blind else 50_000,
                "removed": {},
            }
            for camera in CAMERAS
        ],
        "fusion": {
            "pairs": [{"cameras": [1, camera], "points": 99, "before": apart, "after": apart} for camera in (2, 3)]
        },
        "cloud_points": 300_000,
        "mesh": {
            "vertices": 642,
            "triangles": 1280,
            "open_edges": 0,
            "non_manifold_edges": 0,
            "components": 1,
            "holes": 0,
            "filled_share": 0.03,
        },
    }


def recorded(lost: int, latency: dict[str, Any] | None, warnings: list[str]) -> Recording:
    """How a scan by camera 3 was filmed, of whose 200 frames some are lost."""
    reasons = ["dropped: it never came", *["torn: ends too early"] * (lost - 1)][:lost]
    camera = {
        "id": 3, "device": "/dev/video3", "head": 2, "expected": 200, "stored": 200 - lost,
        "lost": [{"number": number, "reason": reason} for number, reason in enumerate(reasons)],
        "latency": latency, "position_sd_mm": 0.1, "largest_position_sd_mm": 0.2, "mm_per_s": 36.4,
        "frames_per_second": 18.2,
    }  # fmt: skip
    return Recording.model_validate(
        {
            "scanner": "S1",
            "started": "2026-11-20T10:00:00Z",
            "software": "footscan 1",
            "board": {"port": "p", "version": "1.1h", "settings_sha256": "0" * 64, "reports": 9, "report_sd_s": 0.002},
            "light": {"power": 0.8, "looks": 2},
            "passes": [{"cameras": [3], "reason": "all", "start_mm": 0, "end_mm": 400, "mm_per_s": 36, "seconds": 11}],
            "cameras": [camera],
            "warnings": warnings,
        }
    )

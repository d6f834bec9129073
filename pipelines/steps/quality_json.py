"""Quality and measures of a scan to quality.json, with the warnings of the scan."""

from collections.abc import Mapping
from pathlib import Path

from footscan.report.scan_warnings import scan_warnings
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.recording import Recording


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Add the warnings to the quality figures.

    `inputs`: `quality`, `measures`, and `recording` if the scan has a recording.json, which is in `places`.
    """
    del parameters
    quality, measures = Quality.model_validate_json(inputs["quality"]), Measures.model_validate_json(inputs["measures"])
    warnings = scan_warnings(measures, quality, _recording(places.get("recording")))
    return (quality.model_copy(update={"scan_warnings": warnings}).model_dump_json(indent=2) + "\n").encode()


def _recording(file: Path | None) -> Recording | None:
    """The content of recording.json; None without it, or if another program wrote it."""
    try:
        return None if file is None else read_json(file, Recording)
    except RefusedInput:
        return None

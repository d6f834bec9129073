"""Evidence of the errors of a scan, from the results of its steps."""

from collections.abc import Mapping

from footscan.surface.errors.evidence import Evidence
from pipelines.arrays import unpack
from schemas.fusion import FusionReport
from schemas.movement import MovementReport


def evidence_of(inputs: Mapping[str, bytes]) -> Evidence:
    """Collect the evidence; `inputs`: `clean`, `fused` and `surface`."""
    cleaned, fused = unpack(inputs["clean"]), unpack(inputs["fused"])
    return Evidence(
        cloud=fused["cloud"],
        seen=cleaned["points"],
        parted_mm=cleaned["parted"],
        agreement=FusionReport.model_validate_json(fused["report"].tobytes()),
        movement=MovementReport.model_validate_json(cleaned["movement"].tobytes()),
        lasers=cleaned["lasers"],
        contested_mm=tuple(cleaned["contested"].tolist()),
        tip_doubts_mm=tuple(unpack(inputs["surface"])["tip_doubts"].tolist()),
    )

"""Measures to sizes.json."""

from collections.abc import Mapping
from pathlib import Path

from footscan.sizing.sizes import foot_sizes
from schemas.feet import Foot
from schemas.measures import Measures
from schemas.parameters.delivery import SizesParameters
from schemas.sizes import FootSizes, SizeTable


def run(inputs: Mapping[str, bytes], parameters: SizesParameters, places: Mapping[str, Path]) -> bytes:
    """Find sizes and widths of shoes for the foot, as sizes.json.

    `inputs`: `measures`, and the `table` of sizes.
    """
    del places
    measures = Measures.model_validate_json(inputs["measures"])
    foot = Foot.model_validate(measures.model_dump(mode="json"))
    found = foot_sizes(foot, SizeTable.model_validate_json(inputs["table"]), parameters.people)
    wanted = set(parameters.systems) or {*(one.system for one in found.sizes), *(one.system for one in found.widths)}
    sizes = FootSizes(
        format="footscan.foot_sizes/1",
        side=measures.side,
        people=parameters.people,
        measures_mm=found.measures_mm,
        sizes=[one for one in found.sizes if one.system in wanted],
        widths=[one for one in found.widths if one.system in wanted],
    )
    return (sizes.model_dump_json(indent=2) + "\n").encode()

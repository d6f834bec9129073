"""Single faults of a scanner, and of what stands on it: each in a world that has no other."""

from collections.abc import Mapping
from typing import Any

from schemas.world import World

Fault = Mapping[str, Any]
"""Part of a world -> what differs there; of `heads` also the index of the one that differs, or None for all."""

FAULTS: dict[str, Fault] = {
    "none": {},
    "cameras 1, 2 missing": {"cameras": {"missing": [1, 2]}},
    "cameras 1, 3 missing": {"cameras": {"missing": [1, 3]}},
    "cameras 5, 6 missing": {"cameras": {"missing": [5, 6]}},
    "cameras 5, 7 missing": {"cameras": {"missing": [5, 7]}},
    "camera 3 missing": {"cameras": {"missing": [3]}},
    "glass 1.5 mm higher": {"glass": {"height_mm": 1.5}},
    "glass 1.5 mm lower": {"glass": {"height_mm": -1.5}},
    "glass tilted": {"glass": {"tilt_x_deg": 0.5, "tilt_y_deg": -0.5}},
    "foot moved along": {"subject": {"shift_mm": (2.0, 0.0)}},
    "foot moved across": {"subject": {"shift_mm": (0.0, 2.0)}},
    "foot moved a little": {"subject": {"shift_mm": (0.4, -0.4)}},
    "foot sways": {"subject": {"sway_mm": 1.0}},
    "foot trembles": {"subject": {"tremor_mm": 0.3}},
    "camera 3 knocked": {"cameras": {"knocked": [{"camera": 3, "mm": (0.3, 0.5, -0.4), "turn_deg": (0.2, 0.1, -0.2)}]}},
    "camera 6 knocked": {"cameras": {"knocked": [{"camera": 6, "mm": (0.0, 0.2, 0.2), "turn_deg": (0.0, 0.0, 0.0)}]}},
    "head 2 lost steps": {"heads": (1, {"lost_mm": 1.5})},
    "head 3 1 mm off": {"heads": (2, {"offset_mm": 1.0})},
    "head 1 turned": {"heads": (0, {"yaw_deg": 0.4, "pitch_deg": -0.4})},
    "travel 0.3 % long": {"heads": (0, {"travel_scale": 0.003})},
    "all heads jitter": {"heads": (None, {"jitter_mm": 0.15, "ripple_mm": 0.2})},
    "coarse chart": {"cameras": {"corner_px": 0.3}},
    "steps of 4 mm": {"cameras": {"step_mm": 4.0, "frames": 100}},
    "child": {"subject": {"length_mm": 150.0}},
}


def with_fault(world: World, fault: Fault) -> World:
    """The world with a fault.

    >>> with_fault(World(seed=1), FAULTS["head 3 1 mm off"]).heads[2].offset_mm
    1.0
    """
    update: dict[str, Any] = {}
    for part, change in fault.items():
        if part == "heads":
            index, of_head = change
            faulty = range(len(world.heads)) if index is None else (index,)
            update[part] = [
                {**head.model_dump(), **(of_head if n in faulty else {})} for n, head in enumerate(world.heads)
            ]
        else:
            update[part] = {**getattr(world, part).model_dump(), **change}
    return World.model_validate({**world.model_dump(), **update})

"""The laser as a camera sees it."""

from typing import Literal

Laser = Literal["red", "green", "blue", "mono"]
"""Its colour in the pictures; `mono` for a camera without colours, whose laser may be infrared."""

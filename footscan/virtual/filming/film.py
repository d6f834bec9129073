"""Films: JPEG pictures into a Motion-JPEG AVI, byte for byte."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av


def write_film(path: Path, pictures: Sequence[bytes], width: int, height: int, frames_per_second: int) -> None:
    """Write JPEG `pictures` unchanged as the packets of an AVI; the film appears under its name when it is complete."""
    partial = path.with_name(path.name + ".part")
    with av.open(partial, "w", format="avi", options={"fflags": "+bitexact"}) as container:
        stream = container.add_mux_stream("mjpeg", rate=frames_per_second, width=width, height=height)
        stream.time_base = Fraction(1, frames_per_second)
        for number, picture in enumerate(pictures):
            packet = av.Packet(picture)
            packet.stream = stream
            packet.time_base = stream.time_base
            packet.pts = packet.dts = number
            packet.duration = 1
            packet.is_keyframe = True
            container.mux(packet)
    partial.replace(path)

"""Films keep pictures byte for byte."""

from pathlib import Path

import av
import numpy as np
import simplejpeg

from footscan.virtual.filming.film import write_film


def test_packets_are_the_pictures(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    pictures = [
        simplejpeg.encode_jpeg(random.integers(0, 255, (480, 640, 3), dtype=np.uint8), quality=quality)
        for quality in (20, 50, 85)
    ]
    write_film(tmp_path / "cam1.avi", pictures, 640, 480, 18)
    with av.open(tmp_path / "cam1.avi") as film:
        stream = film.streams.video[0]
        assert (stream.frames, stream.width, stream.height, stream.average_rate) == (3, 640, 480, 18)
        assert [bytes(packet) for packet in film.demux(stream) if packet.size] == pictures
    assert [path.name for path in tmp_path.iterdir()] == ["cam1.avi"]

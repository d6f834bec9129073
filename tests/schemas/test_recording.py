"""recording.json: written and read again; what does not add up is refused."""

from datetime import UTC, datetime

import pytest
from pydantic import ValidationError

from schemas.recording import (
    LeftOut,
    RecordedBoard,
    RecordedCamera,
    RecordedLight,
    RecordedPass,
    Recording,
)
from schemas.rig import RigLatency


def camera(stored: int = 198) -> RecordedCamera:
    return RecordedCamera(
        id=1,
        device="/dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0",
        head=1,
        exposure_ms=2.5,
        expected=200,
        stored=stored,
        lost=[LeftOut(number=31, reason="dropped"), LeftOut(number=77, reason="torn")],
        left_out=[LeftOut(number=3, reason="the head stood where it was at frame 2")],
        latency=RigLatency(seconds=0.06, sd_s=0.001),
        position_sd_mm=0.05,
        largest_position_sd_mm=0.2,
        mm_per_s=36.4,
        frames_per_second=18.18,
    )


def test_a_recording_is_read_as_it_was_written() -> None:
    recording = Recording(
        scanner="S1",
        started=datetime(2026, 11, 21, 9, 30, tzinfo=UTC),
        software="0.1.0",
        board=RecordedBoard(port="p", version="1.1h", settings_sha256="0" * 64, reports=110, report_sd_s=0.002),
        light=RecordedLight(power=1.0, looks=4),
        passes=[RecordedPass(cameras=[1], reason="one bus", start_mm=0, end_mm=400, mm_per_s=36.4, seconds=11.2)],
        cameras=[camera()],
    )
    assert Recording.model_validate_json(recording.model_dump_json()) == recording


def test_more_frames_than_there_were_are_refused() -> None:
    with pytest.raises(ValidationError, match="200 stored and 2 lost of 200 expected frames"):
        camera(stored=200)
